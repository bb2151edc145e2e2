"""`wallride new`: examples to begin with, which the command writes under names of the user."""
