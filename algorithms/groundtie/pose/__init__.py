"""Rotation, scale and shift between two images beyond their georeferencing."""
