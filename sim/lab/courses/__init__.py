"""What the experiments drive: courses, places in buildings, sudden obstacles, the prototype."""
