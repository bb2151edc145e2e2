"""`wallride calibrate` of a car by servo pulses, while the car's own process does not run.

Read in this order: `devices` (lidar and board), `bench` (both, opened for one step), `link` (the car as a calibration
drives it), `command`. What is driven and estimated: `wallride.clients.calibration` (`pulse_ways`, `pulse_steps`).
"""
