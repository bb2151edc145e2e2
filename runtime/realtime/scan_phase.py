"""The phase of the scans: no job starts when one is due, and pending jobs run just before. Pure.

Scans come every 25 ms, polls and ticks every 20 ms: where their phases meet, every fourth answer waits for
housekeeping, and takes three times as long as the others. Where they do not, each job wakes the process by itself, with
cold caches. So all are moved to a moment shortly before a scan, which then finds a motor state that is a millisecond or
two old: as late as the motor's own reply times permit.
"""

import math
from typing import Final

MAX_BEFORE_S: Final = 0.0045
"""Maximum lead of the timers before a scan, and the initial one; from then on no job starts. A VESC needs 1 to 3 ms for
its reply."""
SPARE_S: Final = 0.001
"""Minimum time between the motor's reply and the scan: a scan comes a little early sometimes."""
AFTER_S: Final = 0.002
"""Maximum delay of a scan that still finds the loop free; after it the waiting jobs go first."""
MIN_PERIOD_S: Final = 0.015
"""Minimum scan period: below it no time between two scans could be kept free."""
_SAME_SHARE: Final = 0.1
_BEAT_GAIN: Final = 0.2
_PERIOD_GAIN: Final = 0.02
_PLANNED_PERIODS: Final = 6.0
_FASTER_GAIN: Final = 0.02


class ScanPhase:
    """Estimates period and phase of the lidar from the arrivals; without an estimate each timer keeps its own time.

    A scan comes in phase and a little late, now and then very late: the phase is tracked slowly (an alpha-beta filter),
    because a prediction from the last arrival and the gap before it is two and a half times worse.

    period_s: between two scans; NaN until two gaps in a row agree, and where scans come too fast.
    before_s: lead of the timers before a scan.
    """

    def __init__(self) -> None:
        self.period_s = math.nan
        self.before_s = MAX_BEFORE_S
        self._gap_s = math.nan
        self._last_s = math.nan
        self._beat_s = math.nan  # arrival of the newest scan, real or expected
        self._off_beat = False

    def arrived(self, now_s: float) -> None:
        """Note a scan. A missing or late one changes nothing; a new period counts when it occurs twice."""
        gap_s, self._last_s = now_s - self._last_s, now_s
        same_s = _SAME_SHARE * gap_s
        if abs(gap_s - self._gap_s) <= same_s and not abs(gap_s - self.period_s) <= same_s:  # NaN is no period
            self.period_s = gap_s if gap_s >= MIN_PERIOD_S else math.nan
            self._beat_s = now_s
        self._gap_s = gap_s
        self._keep_time(now_s)

    def replied(self, took_s: float) -> None:
        """Note the time that the motor took for a reply: slower ones count at once, faster ones slowly."""
        before_s = min(took_s + SPARE_S, MAX_BEFORE_S)
        self.before_s = max(before_s, self.before_s + _FASTER_GAIN * (before_s - self.before_s))

    @property
    def next_s(self) -> float:
        """Return the time of the scan after the newest; NaN without an estimate."""
        return self._beat_s + self.period_s

    def _keep_time(self, now_s: float) -> None:
        """Correct the phase by a part of the arrival's error; restart after two large errors."""
        self._beat_s = self._due_s(now_s)
        off_s = now_s - self._beat_s
        if abs(off_s) <= _SAME_SHARE * self.period_s:
            self._off_beat = False
            self._beat_s += _BEAT_GAIN * off_s
            self.period_s += _PERIOD_GAIN * off_s
        elif self._off_beat:
            self._beat_s, self._off_beat = now_s, False
        else:
            self._off_beat = True

    def clear_s(self, wanted_s: float, slack_s: float) -> float:
        """Return the time for a job due at `wanted_s`: before a scan together with the other timers, where one is near.

        slack_s: permitted advance or delay. Where no scan is so near, the result is at most 3.3 ms from `wanted_s`, and
            never a moment at which a scan is due.
        """
        periods = (wanted_s - self._beat_s) / self.period_s
        if not -1.0 < periods < _PLANNED_PERIODS:  # NaN included
            return wanted_s
        before_s = self.before_s
        meeting_s = self._due_s(wanted_s + before_s) - before_s
        if abs(meeting_s - wanted_s) <= slack_s:
            return meeting_s
        due_s = self._due_s(wanted_s)
        since_s = wanted_s - due_s
        if not -before_s < since_s < AFTER_S:
            return wanted_s
        return due_s - before_s if since_s < (AFTER_S - before_s) / 2 else due_s + AFTER_S

    def _due_s(self, near_s: float) -> float:
        """Return the time of the scan nearest to a moment, past or due."""
        periods = (near_s - self._beat_s) / self.period_s
        return self._beat_s + (round(periods) * self.period_s if math.isfinite(periods) else math.nan)
