"""Evaluation of a run: its summary, its picture, the comparison with a recording."""
