"""What is read off a run: its summary, its picture, the comparison with a recording."""
