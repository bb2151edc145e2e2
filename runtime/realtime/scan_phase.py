"""When the next scan is due: nothing is begun just then, and what has to be done anyway is done just before. Pure.

Scans come every 25 ms, polls and ticks every 20 ms: where their phases meet, every fourth answer waits for
housekeeping, and takes three times as long as the others. Where they do not, each wakes by itself, at a moment at
which the processor has forgotten everything. So they meet shortly before a scan, which then finds a motor state that
is a millisecond or two old: as late as the motor's own answers permit.
"""

import math
from typing import Final

MAX_BEFORE_S: Final = 0.0045
"""So long before a scan the timers meet at most, and at first, and from then on nothing is begun: a VESC needs 1 to 3
ms for its reply."""
SPARE_S: Final = 0.001
"""The reply has to be read so long before the scan: a scan comes a little early sometimes."""
AFTER_S: Final = 0.002
"""So late a scan may come and still find the way clear; then whatever waited goes first."""
MIN_PERIOD_S: Final = 0.015
"""At a faster beat there is no time between two scans that could be kept free."""
_SAME_SHARE: Final = 0.1
_BEAT_GAIN: Final = 0.2
_PERIOD_GAIN: Final = 0.02
_PLANNED_PERIODS: Final = 6.0
_FASTER_GAIN: Final = 0.02


class ScanPhase:
    """Learns the lidar's beat from the arrivals; without one, each timer keeps its own time.

    A scan comes at its beat and a little late, now and then very late: the beat is followed slowly (an alpha-beta
    filter), because the last arrival and the gap before it promise the next one two and a half times worse.

    period_s: between two scans; NaN until two gaps in a row agree, and where the beat is too fast.
    before_s: so long before a scan the timers meet.
    """

    def __init__(self) -> None:
        self.period_s = math.nan
        self.before_s = MAX_BEFORE_S
        self._gap_s = math.nan
        self._last_s = math.nan
        self._beat_s = math.nan  # when the newest scan came, or should have come
        self._off_beat = False

    def arrived(self, now_s: float) -> None:
        """Note a scan. One that is missing or late changes nothing; a new beat counts when it comes twice."""
        gap_s, self._last_s = now_s - self._last_s, now_s
        same_s = _SAME_SHARE * gap_s
        if abs(gap_s - self._gap_s) <= same_s and not abs(gap_s - self.period_s) <= same_s:  # NaN is no beat
            self.period_s = gap_s if gap_s >= MIN_PERIOD_S else math.nan
            self._beat_s = now_s
        self._gap_s = gap_s
        self._keep_time(now_s)

    def replied(self, took_s: float) -> None:
        """Note how long the motor took for a reply: slower ones count at once, faster ones slowly."""
        before_s = min(took_s + SPARE_S, MAX_BEFORE_S)
        self.before_s = max(before_s, self.before_s + _FASTER_GAIN * (before_s - self.before_s))

    def expects(self, now_s: float) -> bool:
        """Tell whether a scan is due in a moment."""
        return now_s < self._due_s(now_s) < now_s + MAX_BEFORE_S  # NaN: no

    def _keep_time(self, now_s: float) -> None:
        """Follow the beat by a part of what the arrival was off it; begin anew after two that were far off."""
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
        """Return when to do what is due at `wanted_s`: before a scan together with the other timers, where one is near.

        slack_s: how much sooner or later may be. Where no scan is so near, the moment is at most 3.3 ms from the one
        wanted, and none at which a scan is due.
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
        """Return when the scan nearest to a moment is due, or was."""
        periods = (near_s - self._beat_s) / self.period_s
        return self._beat_s + (round(periods) * self.period_s if math.isfinite(periods) else math.nan)
