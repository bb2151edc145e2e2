"""Freshness and origin of a scan, judged from the sensor's clock and the moment of arrival, without I/O.

A sensor stamps each scan with a millisecond counter of 24 bits (it wraps every 4 h 39 min). Arrival minus stamp is an
unknown constant plus the delay on the way. Its lower envelope is the constant plus the shortest delay, so the excess of
a scan over that envelope is its delay: 2 ms on a good cable, 350 ms after a stall. The envelope may creep upwards with
the drift of the two crystals; a single prompt scan pulls it down again.
"""

from collections.abc import Callable
from typing import Final

WRAP_MS: Final = 1 << 24
DRIFT: Final = 200e-6
"""Maximum drift between the clocks: crystals differ by tens of ppm. Also bounds how fast an envelope that is too low
recovers: 0.2 ms a second."""
EARLY_LIMIT_S: Final = 0.5
"""Minimum advance over the most prompt scan that identifies another clock. Late first scans reach about 0.35 s."""
NEW_CLOCK_AFTER_S: Final = 1.0
"""Duration for which stamps must agree with each other, and with none before, to be accepted as a new clock of the same
sensor."""
_HALF_RESOLUTION_S: Final = 0.0005


class StampGate:
    """Admits the scans of one sensor, in order, not too late; keeps no history and tolerates long gaps.

    The kind of a rejected scan is passed to `count`: "stale" (came too late), "foreign" (repeats or goes back in time,
    or runs on another clock), and "clock_reset" when a new clock has been accepted after all.
    """

    def __init__(self, stale_after_s: float, count: Callable[[str], None]) -> None:
        self._stale_after_s = stale_after_s
        self._count = count
        self._ours: _SensorClock | None = None
        self._rival: _SensorClock | None = None

    def restart(self) -> None:
        """Forget the clock: the next scan is taken as prompt, whatever its stamp."""
        self._ours = self._rival = None

    def accept(self, sensor_ms: int, arrival_s: float) -> float | None:
        """Return the delay of the scan (s, 0 for the most prompt), or None when it is rejected."""
        if self._ours is None:
            self._ours = _SensorClock(sensor_ms, arrival_s)
            return 0.0
        lateness_s = self._ours.follow(sensor_ms, arrival_s)
        if lateness_s is None:
            lateness_s = self._follow_rival(sensor_ms, arrival_s)
            if lateness_s is None:
                self._count("foreign")
                return None
        self._rival = None
        if lateness_s > self._stale_after_s:
            self._count("stale")
            return None
        return lateness_s

    def _follow_rival(self, sensor_ms: int, arrival_s: float) -> float | None:
        """Track the clock that does not fit; accept it when it has been the only one for long enough."""
        lateness_s = self._rival.follow(sensor_ms, arrival_s) if self._rival else None
        if self._rival is None or lateness_s is None:
            self._rival = _SensorClock(sensor_ms, arrival_s)
            return None
        if arrival_s - self._rival.first_seen_s < NEW_CLOCK_AFTER_S:
            return None
        self._ours = self._rival
        self._count("clock_reset")
        return lateness_s


class _SensorClock:
    """The sensor's clock relative to the computer's: differences between scans, so wraps and gaps do not matter."""

    __slots__ = ("_arrival_s", "_lateness_s", "_sensor_ms", "first_seen_s")

    def __init__(self, sensor_ms: int, arrival_s: float) -> None:
        self.first_seen_s = arrival_s
        self._sensor_ms = sensor_ms
        self._arrival_s = arrival_s
        self._lateness_s = 0.0

    def follow(self, sensor_ms: int, arrival_s: float) -> float | None:
        """Take the next scan and return its delay; None, and no change, when it cannot be of this clock."""
        elapsed_s = arrival_s - self._arrival_s
        slip_s = _wrap_ms(elapsed_s * 1000 - (sensor_ms - self._sensor_ms)) / 1000
        advanced_s = elapsed_s - slip_s  # by the sensor's own clock, whole wraps included
        drift_s = DRIFT * elapsed_s
        lateness_s = self._lateness_s + slip_s - drift_s
        if advanced_s < _HALF_RESOLUTION_S or lateness_s < -(EARLY_LIMIT_S + drift_s):
            return None
        self._sensor_ms = sensor_ms
        self._arrival_s = arrival_s
        self._lateness_s = max(0.0, lateness_s)
        return self._lateness_s


def _wrap_ms(difference_ms: float) -> float:
    """Bring a difference of stamps into half a wrap either side of zero."""
    return (difference_ms + WRAP_MS / 2) % WRAP_MS - WRAP_MS / 2
