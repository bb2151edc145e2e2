"""Recovery from a dead end."""
