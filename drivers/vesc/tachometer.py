"""Distance from the VESC's tachometer, across wrap-around, missed polls and reboots."""

import math

MAX_STEPS_PER_POLL = 1000
"""Maximum steps between two polls while driving: 2.2 m at the stock gearing."""
RESTARTS_APART_S = 1.0
"""Minimum time between two restarts: no VESC boots twice within this."""


class Tachometer:
    """Sums signed steps; 6 steps are one electrical turn of the motor.

    The counter is an int32 that wraps, and restarts at 0 when the VESC does. A reboot shows in the absolute counter
    beside it, which otherwise never runs backwards and begins at 0, or in a jump that is too large to have been driven;
    then the sum continues from its last value and the distance in between is unknown. An absolute counter that runs
    backwards without a reboot is ignored. Source: `motor/mcpwm_foc.c`.

    steps: signed sum since the first update.
    restarts: number of times that the sum was re-anchored. contradictions: number of times that the absolute counter
        ran backwards.
    """

    def __init__(self) -> None:
        self.steps = 0
        self.restarts = 0
        self.contradictions = 0
        self._restarted_s = -math.inf
        self._last: tuple[int, int] | None = None

    def update(self, tachometer: int, tachometer_abs: int, stamp_s: float) -> None:
        """Take one reading of both counters, and its time."""
        if self._last is not None:
            moved = _wrapped(tachometer - self._last[0])
            went_back = _wrapped(tachometer_abs - self._last[1]) < 0
            booted = went_back and 0 <= tachometer_abs <= MAX_STEPS_PER_POLL
            if abs(moved) > MAX_STEPS_PER_POLL or (booted and stamp_s - self._restarted_s > RESTARTS_APART_S):
                self.restarts += 1
                self._restarted_s = stamp_s
            else:
                self.steps += moved
                self.contradictions += went_back
        self._last = (tachometer, tachometer_abs)


def _wrapped(difference: int) -> int:
    """Bring the difference of two int32 counters back into the int32 range."""
    return (difference + 2**31) % 2**32 - 2**31
