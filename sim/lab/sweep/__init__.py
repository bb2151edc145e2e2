"""Declared sweeps: many drives from one file, into one table."""
