"""Parameters of a real car, estimated from its recordings, as conditions for the simulator.

Read in this order: `drive` (what the cars did, by their scans), `responses` (delay and rate of an effect), `steering`
with `yaw_lag`, `driving`, `sensor` (the fits), `estimate` (the result), `command`.
"""
