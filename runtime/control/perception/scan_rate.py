"""How often the lidar measures. Pure.

Everything that waits for the next scan was made for a lidar of 40 Hz. With a slower one it waits longer by `waits_s`:
commands and limits live longer, a scan is late later, and what was seen in the last scan is looked for in this one.
What this costs is paid in speed (`safety/lidar_reach.py`).
"""

import math

USUAL_S = 0.03
"""Period up to which nothing waits longer: a lidar of 40 Hz, with a margin for its clock."""
SLOWEST_S = 0.2
"""Period beyond which nothing waits still longer: with a lidar slower than 5 Hz commands expire between its scans."""
GAP_S = 0.3
"""Interval from which on scans were lost, and none is a period."""
MIN_INTERVALS, MAX_INTERVALS = 2, 4
"""Number of intervals in a row of which the shortest is the period: scans are lost, but none comes early."""


class ScanRate:
    """Measures the period of a lidar from the stamps of its scans.

    period_s: at most SLOWEST_S; 0 before it is known. waits_s: the period beyond the usual one.
    """

    def __init__(self) -> None:
        self.period_s = self.waits_s = 0.0
        self._stamp_s = -math.inf
        self._intervals_s: tuple[float, ...] = ()

    def note(self, stamp_s: float) -> float:
        """Take in the stamp of a scan, the same one as often as needed, and return waits_s."""
        interval_s, self._stamp_s = stamp_s - self._stamp_s, stamp_s
        if interval_s == 0.0:
            return self.waits_s
        if not 0.0 < interval_s < GAP_S:  # the first scan, or another clock
            self._intervals_s = ()
            return self.waits_s
        self._intervals_s = (*self._intervals_s[1 - MAX_INTERVALS :], interval_s)
        if len(self._intervals_s) < MIN_INTERVALS:
            return self.waits_s
        self.period_s = min(SLOWEST_S, *self._intervals_s)
        self.waits_s = max(0.0, self.period_s - USUAL_S)
        return self.waits_s
