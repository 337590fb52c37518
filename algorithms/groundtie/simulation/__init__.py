"""Simulated SAR–optical pairs whose misregistration is known exactly."""
