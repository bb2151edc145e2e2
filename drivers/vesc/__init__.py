"""The VESC, the motor and steering controller, over its USB serial port.

Read in this order: `settings` (what may be configured), `codec` (frames and requests as bytes), `replies` (what it
answers), `faults` (its trouble in words), `calibration` (m/s and rad to its units), `tachometer` (distance),
`driver` (the connection). All but the driver are pure.
"""

from drivers.vesc.driver import Vesc
from drivers.vesc.settings import VescSettings

__all__ = ["Vesc", "VescSettings"]
