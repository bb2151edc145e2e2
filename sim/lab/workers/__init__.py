"""Where cells are run: `submit` and what is behind it."""
