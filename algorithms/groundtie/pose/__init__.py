"""Rotation, scale and shift between two images that georeferencing does not know."""
