"""Speckle: its statistics, and filters that smooth it and keep edges."""
