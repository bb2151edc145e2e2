"""`wallride doctor`: everything from cable to certificate, each line with its remedy. `examine` runs the checks."""
