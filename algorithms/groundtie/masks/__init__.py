"""What takes part: masks that keep what stands up from the ground out of the similarity."""
