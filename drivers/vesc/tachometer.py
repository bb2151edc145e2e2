"""From the VESC's tachometer to a distance that survives wrap-around, missed polls and reboots."""

MAX_STEPS_PER_POLL = 1000
"""More between two polls is no driving: 2.2 m at the stock gearing."""


class Tachometer:
    """Sums signed steps; 6 steps are one electrical turn of the motor.

    The counter is an int32 that wraps, and restarts at 0 when the VESC does. A reboot shows in the absolute counter
    beside it, which otherwise never runs backwards, or in a jump that is too large to have been driven; then the
    sum continues from where it was and what was driven in between is not known. Source: `motor/mcpwm_foc.c`.

    steps: signed sum since the first update.
    restarts: how often the sum had to be anchored anew.
    """

    def __init__(self) -> None:
        self.steps = 0
        self.restarts = 0
        self._last: tuple[int, int] | None = None

    def update(self, tachometer: int, tachometer_abs: int) -> None:
        """Take one reading of both counters."""
        if self._last is not None:
            moved = _wrapped(tachometer - self._last[0])
            went_back = _wrapped(tachometer_abs - self._last[1]) < 0
            if went_back or abs(moved) > MAX_STEPS_PER_POLL:
                self.restarts += 1
            else:
                self.steps += moved
        self._last = (tachometer, tachometer_abs)


def _wrapped(difference: int) -> int:
    """Bring the difference of two int32 counters back into the int32 range."""
    return (difference + 2**31) % 2**32 - 2**31
