"""Features: points that are found again, what is around them, and which belong together."""
