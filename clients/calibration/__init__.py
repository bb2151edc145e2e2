"""`wallride calibrate`: drives a car through short ways as an operator does, and proposes settings from what it saw.

Read in this order: `ways` (what is driven), `link` (the car over the network), `steps` (what each step drives and
estimates), `command`.
"""
