"""Pages and pictures that show a result."""
