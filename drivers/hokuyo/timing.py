"""Freshness and origin of a scan, judged from the sensor's clock and the moment of arrival, without I/O.

A sensor stamps each scan with a millisecond counter of 24 bits (it wraps every 4 h 39 min). Arrival minus stamp is an
unknown constant plus the delay on the way. Its lower envelope is the constant plus the shortest delay, so the excess of
a scan over that envelope is its delay: 2 ms on a good cable, 350 ms after a stall. The envelope may creep upwards with
the drift of the two crystals; a single prompt scan pulls it down again.

A link that is late from the first scan on has a late envelope. So the first scan does not count as prompt: its delay is
what a reading of the counter tells (TM1), taken as early as it may have been, when the request was sent. Of a sensor
that does not tell it, or tells another clock than it stamps with (a UST-20LX of 2014: 402 s off), the delay is that of
its quickest answer: both ways, so never less.
"""

import math
from collections.abc import Callable
from dataclasses import dataclass
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
SLOW_READING_S: Final = 0.03
"""Maximum round trip of a reading beyond that of the quickest answer; a slower one tells less than that answer."""
_EARLY_S: Final = 0.005
"""Tolerance for a scan that arrives before it was taken: both clocks are read in whole milliseconds."""
_HALF_RESOLUTION_S: Final = 0.0005


@dataclass(frozen=True, slots=True)
class ClockReading:
    """The sensor's counter at a moment between our request and its reply."""

    sensor_ms: int
    asked_s: float
    answered_s: float

    @property
    def round_trip_s(self) -> float:
        """Time from the request to the reply: the uncertainty of the moment."""
        return self.answered_s - self.asked_s


class StampGate:
    """Admits the scans of one sensor, in order, not too late; keeps no history and tolerates long gaps.

    The kind of a rejected scan is passed to `count`: "stale" (came too late), "foreign" (repeats or goes back in time,
    or runs on another clock), and "clock_reset" when a new clock has been accepted after all.

    link_s: the longest that a byte takes on the present link, by its quickest answer. dated: whether the delays are by
    the sensor's own clock. least_s: the shortest delay since it was last set to infinity.
    """

    def __init__(self, stale_after_s: float, count: Callable[[str], None]) -> None:
        self._stale_after_s = stale_after_s
        self._count = count
        self._ours: _SensorClock | None = None
        self._rival: _SensorClock | None = None
        self._reading: ClockReading | None = None
        self._turn_s = 0.0
        self.link_s = 0.0
        self.dated = False
        self.least_s = math.inf

    def restart(self, link_s: float = 0.0, reading: ClockReading | None = None, turn_s: float = 0.0) -> None:
        """Forget the clock: the next scan sets it anew, whatever its stamp.

        reading: of the counter, since the last stream. turn_s: of one revolution; a scan comes so long after its stamp.
        """
        self._ours = self._rival = None
        self._reading, self._turn_s, self.link_s = reading, turn_s, link_s
        self.dated = False
        self.least_s = math.inf

    def accept(self, sensor_ms: int, arrival_s: float) -> float | None:
        """Return the delay of the scan (s, 0 for the most prompt), or None when it is rejected."""
        if self._ours is None:
            self._ours = _SensorClock(sensor_ms, arrival_s, self._first_delay_s(sensor_ms, arrival_s))
            lateness_s: float | None = self._ours.lateness_s
        else:
            lateness_s = self._ours.follow(sensor_ms, arrival_s)
        if lateness_s is None:
            lateness_s = self._follow_rival(sensor_ms, arrival_s)
            if lateness_s is None:
                self._count("foreign")
                return None
        self._rival = None
        self.least_s = min(self.least_s, lateness_s)
        if lateness_s > self._stale_after_s:
            self._count("stale")
            return None
        return lateness_s

    def _first_delay_s(self, sensor_ms: int, arrival_s: float) -> float:
        """Return the longest delay that the first scan can have."""
        reading = self._reading
        if reading is None or reading.round_trip_s > self.link_s + SLOW_READING_S:
            return self.link_s
        taken_s = reading.asked_s + _wrap_ms(sensor_ms - reading.sensor_ms) / 1000
        # It was taken since the reading, and before it arrived; else the reading is of another clock.
        self.dated = reading.asked_s - self._turn_s - _EARLY_S <= taken_s <= arrival_s + _EARLY_S
        return max(0.0, arrival_s - taken_s - self._turn_s) if self.dated else self.link_s

    def _follow_rival(self, sensor_ms: int, arrival_s: float) -> float | None:
        """Track the clock that does not fit; accept it when it has been the only one for long enough."""
        lateness_s = self._rival.follow(sensor_ms, arrival_s) if self._rival else None
        if self._rival is None or lateness_s is None:
            # Another clock does not make the link more prompt.
            self._rival = _SensorClock(sensor_ms, arrival_s, self._ours.lateness_s if self._ours else self.link_s)
            return None
        if arrival_s - self._rival.first_seen_s < NEW_CLOCK_AFTER_S:
            return None
        self._ours = self._rival
        self._count("clock_reset")
        return lateness_s


class _SensorClock:
    """The sensor's clock relative to the computer's: differences between scans, so wraps and gaps do not matter.

    lateness_s: delay of the newest scan. A known delay does not wear off: the creep for the drift ends at the shortest.
    """

    __slots__ = ("_arrival_s", "_sensor_ms", "_shortest_s", "first_seen_s", "lateness_s")

    def __init__(self, sensor_ms: int, arrival_s: float, lateness_s: float) -> None:
        self.first_seen_s = arrival_s
        self._sensor_ms = sensor_ms
        self._arrival_s = arrival_s
        self.lateness_s = self._shortest_s = lateness_s

    def follow(self, sensor_ms: int, arrival_s: float) -> float | None:
        """Take the next scan and return its delay; None, and no change, when it cannot be of this clock."""
        elapsed_s = arrival_s - self._arrival_s
        slip_s = _wrap_ms(elapsed_s * 1000 - (sensor_ms - self._sensor_ms)) / 1000
        advanced_s = elapsed_s - slip_s  # by the sensor's own clock, whole wraps included
        drift_s = DRIFT * elapsed_s
        lateness_s = self.lateness_s + slip_s
        if advanced_s < _HALF_RESOLUTION_S or lateness_s < -(EARLY_LIMIT_S + 2 * drift_s):
            return None
        self._sensor_ms = sensor_ms
        self._arrival_s = arrival_s
        self._shortest_s = min(self._shortest_s, max(0.0, lateness_s))
        self.lateness_s = max(self._shortest_s, lateness_s - drift_s)
        return self.lateness_s


def _wrap_ms(difference_ms: float) -> float:
    """Bring a difference of stamps into half a wrap either side of zero."""
    return (difference_ms + WRAP_MS / 2) % WRAP_MS - WRAP_MS / 2
