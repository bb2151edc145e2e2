"""`wallride lab`: experiments on the car's own control code, faster than real time and on all cores."""
