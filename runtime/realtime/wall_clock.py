"""Time since 1970, from the monotonic clock and its difference to civil time, which changes when the clock is set.

A computer without a battery-backed clock starts in the past, and NTP sets its clock once the network is up. NTP's slow
corrections move the monotonic clock as well; a change of the difference is a step.
"""

import time
from collections.abc import Callable

from wallride.drivers.api import Clock

NS = 1_000_000_000
MIN_STEP_NS = 20_000_000
"""Minimum step; a smaller difference may be a pause of this process between two readings."""
READINGS = 3
FIRST_S, LAST_S = 1_704_067_200, 2**31
"""Times since 1970 between which a computer's clock is believed: 2024, and the end of ROS 2's stamps (2038-01-19)."""


class WallClock:
    """Converts monotonic times into times since 1970.

    epoch_ns: added to a monotonic time [ns] gives the time since 1970, by the clock as it stands now.
    started_epoch_ns: the same as it stood when this object was made. Both may be read in any thread.
    """

    def __init__(self, clock: Clock, unix_ns: Callable[[], int] = time.time_ns) -> None:
        self._clock = clock
        self._unix_ns = unix_ns
        self.epoch_ns = self.started_epoch_ns = self._difference_ns()

    def follow(self) -> int:
        """Apply a step of the computer's clock, and return it [ns]; 0 without one. To be called once a second."""
        step_ns = self._difference_ns() - self.epoch_ns
        if abs(step_ns) < MIN_STEP_NS:
            return 0
        self.epoch_ns += step_ns
        return step_ns

    @property
    def stepped_ns(self) -> int:
        """Total step of the clock since the start, positive forward."""
        return self.epoch_ns - self.started_epoch_ns

    @property
    def trouble(self) -> str:
        """What is wrong with the clock, with the remedy, the same text while it lasts; "" when it can be right."""
        now_s = self.now_unix_ns() // NS
        if FIRST_S <= now_s < LAST_S:
            return ""
        when = "before 2024" if now_s < FIRST_S else "after 2038-01-19"
        return f"the computer's clock says a time {when}: set it (timedatectl); stamps are wrong"

    def unix_ns(self, stamp_s: float) -> int:
        """Return the time since 1970 of a time on the monotonic clock."""
        return self.epoch_ns + round(stamp_s * NS)

    def now_unix_ns(self) -> int:
        """Return the present time since 1970."""
        return self.unix_ns(self._clock())

    def started_unix_ns(self, stamp_s: float) -> int:
        """Return the same by the clock as it stood when this object was made: never steps."""
        return self.started_epoch_ns + round(stamp_s * NS)

    def _difference_ns(self) -> int:
        """Return wall minus monotonic time: of a few readings the one with the shortest time between its halves."""
        return min(self._reading() for _ in range(READINGS))[1]

    def _reading(self) -> tuple[float, int]:
        before_s = self._clock()
        unix_ns = self._unix_ns()
        after_s = self._clock()
        return after_s - before_s, unix_ns - round((before_s + after_s) / 2 * NS)


def never_set(clock: Clock) -> WallClock:
    """Return a wall clock for a clock whose seconds are not the computer's, as in a simulation."""
    begin_ns = time.time_ns() - round(clock() * NS)
    return WallClock(clock, lambda: begin_ns + round(clock() * NS))
