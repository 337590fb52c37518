"""Search: from a rough shift to tie points."""
