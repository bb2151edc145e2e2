"""`wallride service`: the car's systemd service: what it consists of (`parts`), and the command (`options`)."""
