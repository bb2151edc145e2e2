"""Commands for several cars."""
