"""Geometry: tie points, transforms between images, and their estimation."""
