"""Recorded drives through the car's own perception and safety."""
