"""`wallride doctor`: everything from cable to certificate, each line with its remedy. `examine` runs the checks."""

GROUPS = ("program", "computer", "ports", "lidar", "motor", "access", "joystick")
"""What can be looked at, in the order in which a car is set up."""
