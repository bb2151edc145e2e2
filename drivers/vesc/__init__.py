"""The VESC, the motor and steering controller, over its USB serial port.

Read in this order: `settings` (what may be configured), `codec` (frames and requests as bytes), `replies` (what it
answers), `faults` (its trouble in words), `calibration` (m/s and rad to its units), `tachometer` (distance),
`condition` (what all of that says over time), `driver` (the connection). All but the driver are pure.
"""
