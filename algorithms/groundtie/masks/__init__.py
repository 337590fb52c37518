"""Masks: which pixels of an image take part."""
