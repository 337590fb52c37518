"""What takes part: masks that keep elevated objects out of the similarity."""
