"""Does a turning lidar still measure? A turn that shows the same again while the car moves is a stored one. Pure.

So is one that was seen before, to the bit, some way back, and the one after it: they are played again. It is judged
before the car's motion is taken out of a turn, which makes a different scan of every repetition.
"""

from collections import OrderedDict
from typing import Final

import numpy as np

from wallride.drivers.turning.samples import Floats

SAME_SHARE: Final = 0.9
"""Minimum share of the samples with an echo that are equal to the bit to one of three of the turn before: a turn may
have one sample more than another. Noise leaves two thirds at most."""
MIN_SAMPLES: Final = 40
MOVES_MPS: Final = 0.1
REPEATED_M: Final = 0.3
"""Way of the car after which a turn that repeats is a stored one."""
PLAYED_TURNS: Final = 2
"""Minimum number in a row of turns that were seen before, REPEATED_M ago or more."""
NEW_TURNS: Final = 3
"""Minimum number in a row of other turns that end it: where the played bytes begin again, one turn is of two halves."""
REMEMBERED_TURNS: Final = 100


class Repetition:
    """Compares each turn with the one before. stored: whether the turns are a stored one, until another comes."""

    def __init__(self) -> None:
        self._before_m: Floats = np.empty(0)
        self._way_m = self._driven_m = 0.0
        self._seen: OrderedDict[int, float] = OrderedDict()
        self._played = self._new = 0
        self.stored = False

    def is_stored(self, ranges_m: Floats, speed_mps: float, turn_s: float) -> bool:
        """Take in the samples of a turn as measured, (n,); return whether it is a stored one. turn_s: its duration."""
        before_m, self._before_m = self._before_m, ranges_m
        self._driven_m += abs(speed_mps) * turn_s
        if not _is_same(before_m, ranges_m):
            self._way_m, self.stored = 0.0, self._is_played(ranges_m)
        elif abs(speed_mps) > MOVES_MPS:
            self._way_m += abs(speed_mps) * turn_s
            self.stored = self.stored or self._way_m >= REPEATED_M
        return self.stored

    def _is_played(self, ranges_m: Floats) -> bool:
        if np.count_nonzero(np.isfinite(ranges_m)) < MIN_SAMPLES:
            return self._played >= PLAYED_TURNS
        key = hash(ranges_m.tobytes())
        first_m = self._seen.setdefault(key, self._driven_m)
        self._seen.move_to_end(key)
        if len(self._seen) > REMEMBERED_TURNS:
            self._seen.popitem(last=False)
        if self._driven_m - first_m >= REPEATED_M:
            self._played, self._new = self._played + 1, 0
        elif self._played < PLAYED_TURNS or self._new + 1 >= NEW_TURNS:
            self._played = self._new = 0
        else:
            self._new += 1
        return self._played >= PLAYED_TURNS


def _is_same(before_m: Floats, now_m: Floats) -> bool:
    size = min(before_m.size, now_m.size)
    if abs(before_m.size - now_m.size) > 1:
        return False
    before_m, now_m = before_m[:size], now_m[:size]
    count = int(np.count_nonzero(np.isfinite(now_m)))
    if count < MIN_SAMPLES:
        return False
    same = before_m == now_m  # NaN is not
    same |= np.roll(before_m, 1) == now_m
    same |= np.roll(before_m, -1) == now_m
    return int(np.count_nonzero(same)) >= SAME_SHARE * count
