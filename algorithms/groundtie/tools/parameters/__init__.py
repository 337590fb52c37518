"""Parameters that several tools share, declared once."""
