"""Similarity of two windows over shifts: mutual information, orientation, correlation, fusion."""
