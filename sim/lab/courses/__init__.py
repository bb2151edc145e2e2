"""Courses of the experiments: lanes, places in buildings, sudden obstacles, the prototype."""
