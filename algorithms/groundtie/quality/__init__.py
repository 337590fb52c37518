"""Quality: the verdict on a registration, and the report that shows it."""
