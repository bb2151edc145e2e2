"""Out of a dead end."""
