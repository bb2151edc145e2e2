"""Parameters of a car, estimated from what it did: pure functions of recorded scans, motor states and commands.

Read in this order: `scan_motion` (motion by the scans alone), `trace` (a recorded drive, its stops and arcs), `arc_fit`
(speed, steering and the lidar's pose), `responses` and `delays` (delay and rate of an effect), `braking`, `near_parts`,
`proposals` (settings from estimates). Used by `wallride calibrate` and `wallride lab fit`; the driving car imports none
of it.
"""
