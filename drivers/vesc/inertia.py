"""Inertial measurements of the VESC: requested along with its values, until the sensor turns out to be absent."""

import math
from collections.abc import Callable

from wallride.drivers.vesc import codec, replies

Vector = tuple[float, float, float]

ABSENT_BELOW_MPS2 = 2.0
"""Maximum acceleration that indicates an absent sensor: one at rest reads 9.8; hardware without one answers zeros
(vesc.md, section 6)."""
ABSENT_AFTER_S = 1.0
_ACCELERATION_AND_RATE = 0b1_1111_1000
_ASK = codec.frame(codec.get_imu(_ACCELERATION_AND_RATE))


class Inertia:
    """Decides whether to request measurements, and passes them on.

    on_measurement: takes stamp [s], rate of turn [rad/s] and acceleration [m/s2], in the axes that were set up with
        VESC Tool (x forward, y left, z up when its mounting was entered there). Called in the event loop.
    """

    def __init__(self, *, wanted: bool) -> None:
        self.on_measurement: Callable[[float, Vector, Vector], None] | None = None
        self._wanted = wanted
        self._weak_since_s: float | None = None

    def question(self) -> bytes:
        """Return the bytes to send after the request for values; empty where no measurement is wanted."""
        return _ASK if self._wanted and self.on_measurement is not None else b""

    def take(self, payload: bytes, stamp_s: float) -> bool:
        """Take in a reply; False when it is invalid."""
        imu = replies.decode_imu(payload)
        if imu is None:
            return False
        (ax, ay, az), (gx, gy, gz) = imu.acceleration_mps2, imu.rate_radps
        strength_mps2 = math.hypot(ax, ay, az)
        if not (math.isfinite(strength_mps2) and math.isfinite(gx + gy + gz)):
            return False
        if strength_mps2 >= ABSENT_BELOW_MPS2:
            self._weak_since_s = None
            if self.on_measurement is not None:
                self.on_measurement(stamp_s, (gx, gy, gz), (ax, ay, az))
        elif self._weak_since_s is None:
            self._weak_since_s = stamp_s
        elif stamp_s - self._weak_since_s >= ABSENT_AFTER_S:
            self._wanted = False
        return True
