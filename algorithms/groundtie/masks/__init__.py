"""Masks that keep elevated objects out of the similarity."""
