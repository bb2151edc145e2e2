"""`wallride calibrate`: drives short ways, and proposes settings from what it saw. Read `ways`, `link`, `steps`."""
