"""Sensor models: rational polynomial coefficients, heights, and their refinement."""
