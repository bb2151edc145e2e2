"""What a follower remembers of its laps: how exact they were, and how fast the next one may be."""

import math
from typing import Final

import numpy as np

from wallride.drivers.value import value
from wallride.runtime.control.perception.geometry import quantile

FALLS_MPS2: Final = 5.4
"""The set speed of a VESC falls by this much in a second; braking by hand of safety is faster."""
OBEYS_S: Final = 0.15
"""Time in which the wheels follow the set speed."""
HELD_SHARE, HELD_MPS = 0.6, 0.3
"""A car that is slower than this share of what it should have reached, less this speed, is held back."""
HELD_SCANS: Final = 4
MOVED_M: Final = 0.005
"""Way along the line from which a scan counts for the errors of a lap."""
REGAINED: Final = 0.04
SECTORS: Final = 3
"""Parts of a lap of equal way, from where it began, that have a time of their own."""
RESTS_S: Final = 2.0
"""Time of driving as asked after which it may count as held back again."""


@value()
class LapErrors:
    """Number of laps done, the last one's time with rms, 99 % and largest of its lateral errors, and the best time.

    sectors_s: times of the parts of the last one, () before it.
    """

    laps: int = 0
    time_s: float = math.nan
    rms_m: float = math.nan
    p99_m: float = math.nan
    largest_m: float = math.nan
    best_s: float = math.nan
    sectors_s: tuple[float, ...] = ()


class LapMemory:
    """Counts the laps of a line of `length_m` from where it is joined. since_s: begin of this one, NaN without one."""

    def __init__(self, length_m: float) -> None:
        self._length_m = length_m
        self.begin()
        self.last = LapErrors()

    def begin(self) -> None:
        """Begin a lap here, whatever there was of one."""
        self._way_m, self._along_m, self.since_s = 0.0, math.nan, math.nan
        self._errors_m: list[float] = []
        self._splits_s: list[float] = []

    def take(self, stamp_s: float, along_m: float, aside_m: float) -> bool:
        """Take in a scan's place on the line; return whether a lap is complete with it."""
        if math.isnan(self._along_m):
            self._along_m, self.since_s = along_m, stamp_s
        moved_m = math.remainder(along_m - self._along_m, self._length_m)
        if abs(moved_m) > MOVED_M:  # a car that stands on its line for hours remembers nothing of it
            self._way_m += moved_m
            self._along_m = along_m
            self._errors_m.append(abs(aside_m))
        while len(self._splits_s) < SECTORS and self._way_m * SECTORS >= self._length_m * (len(self._splits_s) + 1):
            self._splits_s.append(stamp_s)
        if self._way_m < self._length_m:
            return False
        errors_m, took_s = np.array(self._errors_m), stamp_s - self.since_s
        self.last = LapErrors(
            self.last.laps + 1, took_s, float(np.sqrt(np.mean(errors_m**2))), quantile(errors_m, 0.99),
            float(errors_m.max()), float(np.fmin(took_s, self.last.best_s)),
            tuple(map(float, np.diff([self.since_s, *self._splits_s]))),
        )  # fmt: skip
        self._way_m -= self._length_m
        self.since_s, self._errors_m, self._splits_s = stamp_s, [], []
        return True


class BuildUp:
    """The share of the line's speed that may be driven: rises from lap to lap, falls when the car was held back.

    first: share of the first lap. step: added by each lap in which nothing held it back, and else taken away. Held back
    again at about the share of an earlier time, and above that of the second lap, the car keeps half a step below it:
    then it rises by REGAINED of a step each lap, so a line too fast for the floor stops it seldom.
    """

    def __init__(self, first: float, step: float) -> None:
        self._first, self._step = first, step
        self._reached, self._grip = first, math.inf
        self._most, self._failed = 1.0, math.inf
        self._clean = True

    @property
    def share(self) -> float:
        """Return the share that may be driven now."""
        return min(self._reached, self._grip)

    def bound(self, most: float) -> None:
        """Drive no larger share than the grip that is observed allows; what the laps have reached is kept."""
        self._grip = most

    def tune(self, first: float, step: float) -> None:
        """Change both; the share that was reached is kept."""
        self._first, self._step = first, step
        self._reached, self._most = max(self._reached, first), max(self._most, first)

    def lap_done(self) -> None:
        """Raise the share, unless the lap that is done was held back."""
        if self._clean:
            self._most = min(1.0, self._most + REGAINED * self._step)
            self._reached = min(self._most, self._reached + self._step)
        self._clean = True

    def slower(self) -> None:
        """Lower the share: something held the car back."""
        self._reached = self.share
        if self._clean and self._reached > self._first + self._step:
            below = self._failed - self._step / 2
            if self._reached > below:
                self._most = max(self._first + self._step, below)
            self._failed = min(self._failed, self._reached)
        self._clean = False
        self._reached = max(self._first, self._reached - self._step)


class HeldBack:
    """Tells from the wheels alone that something else than the follower slowed the car: safety, or a human.

    rises_mps2: how fast the commanded speed rises.
    """

    def __init__(self, rises_mps2: float) -> None:
        self._rises_mps2 = rises_mps2
        self._asked_mps = 0.0
        self.begin(0.0)

    def begin(self, speed_mps: float) -> None:
        """Expect nothing but this speed."""
        self._asked_mps = self._ramp_mps = self._expected_mps = speed_mps
        self._scans, self._rests_s = 0, RESTS_S

    def asks(self, speed_mps: float) -> None:
        """Note the speed that the answer to this scan asks for."""
        self._asked_mps = speed_mps

    def tells(self, speed_mps: float, since_s: float) -> bool:
        """Take in the wheels' speed at a scan; return whether the car turns out to be held back."""
        rise = min(max(self._asked_mps - self._ramp_mps, -FALLS_MPS2 * since_s), self._rises_mps2 * since_s)
        self._ramp_mps += rise
        self._expected_mps += (1.0 - math.exp(-since_s / OBEYS_S)) * (self._ramp_mps - self._expected_mps)
        held = speed_mps < HELD_SHARE * self._expected_mps - HELD_MPS
        self._rests_s -= 0.0 if held else since_s  # a stop with its way out is one, however long it takes
        self._scans = self._scans + 1 if held else 0
        if self._scans < HELD_SCANS or self._rests_s > 0.0:
            return False
        self.begin(speed_mps)
        return True
