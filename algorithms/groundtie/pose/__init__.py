"""Rotation, scale and shift between two images beyond what georeferencing gives."""
