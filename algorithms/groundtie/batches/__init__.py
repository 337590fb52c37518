"""One tool run over the rows of a table."""
