"""The VESC, the motor and steering controller, over its USB serial port.

Read in this order: `settings`, `codec` (frames and requests as bytes), `replies` (decoding of its replies), `faults`
(its fault codes as text), `calibration` (m/s and rad to its units), `tachometer` (distance), `condition` (state, faults
and battery over time), `driver` (the connection). All but the driver are pure.
"""
