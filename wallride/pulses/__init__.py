"""`wallride calibrate` of a car by servo pulses, in place of its process. Read `devices`, `link`, `command`."""
