"""Geometry: tie points, transforms between images, and how these are fitted."""
