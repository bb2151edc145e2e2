"""Drivers of the user: loaded by name, run within the car's process, and watched by it."""
