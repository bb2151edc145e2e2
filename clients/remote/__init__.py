"""The car from Python, for notebooks and scripts: `wallride.connect` and `wallride.open_recording` (docs/python.md)."""
