"""Tells a view that changed at once in all directions: a lidar that was knocked, turned or replaced in the drive."""

import math
from collections import deque
from dataclasses import dataclass

import numpy as np

from wallride.drivers.api import Scan
from wallride.runtime.control.perception.geometry import Floats

EVERY_RAD = math.radians(2.0)
WINDOW_S = 0.1
"""Time over which a change is sudden; at least from one scan to the next."""
ENOUGH_BEARINGS = 20
CHANGED_LOG = 0.35
"""Median change of the ranges, as a logarithm, that no drive of a tenth of a second gives: 40 % nearer or farther."""


@dataclass(frozen=True, slots=True, eq=False)
class _Look:
    """Ranges of every bearing, (k,), NaN without a return, and the heading of the car."""

    stamp_s: float
    kind: tuple[float, float, int]
    range_m: Floats
    step_rad: float
    yaw_rad: float


class SuddenChange:
    """Compares each scan with one shortly before, turned by what the car has turned."""

    def __init__(self) -> None:
        self._looks: deque[_Look] = deque()

    def learn(self, scan: Scan, yaw_rad: float) -> bool:
        """Take in a scan; return whether the view has changed at once."""
        every = max(1, round(EVERY_RAD / scan.angle_step_rad))
        range_m = scan.ranges_m[::every].astype(np.float64)
        range_m[~((range_m > scan.range_min_m) & (range_m < scan.range_max_m))] = np.nan
        kind = (scan.angle_min_rad, scan.angle_step_rad, scan.ranges_m.size)
        now = _Look(scan.stamp_s, kind, range_m, every * scan.angle_step_rad, yaw_rad)
        looks = self._looks
        while len(looks) > 1 and looks[1].stamp_s <= now.stamp_s - WINDOW_S:
            looks.popleft()
        changed = bool(looks) and _has_changed(looks[0], now)
        if changed:
            looks.clear()
        looks.append(now)
        return changed


def _has_changed(before: _Look, now: _Look) -> bool:
    if before.kind != now.kind:
        return True
    turned = round(math.remainder(now.yaw_rad - before.yaw_rad, math.tau) / now.step_rad)
    count = now.range_m.size - abs(turned)
    if count < ENOUGH_BEARINGS:
        return False
    was_m = before.range_m[max(turned, 0) : max(turned, 0) + count]
    is_m = now.range_m[max(-turned, 0) : max(-turned, 0) + count]
    change = np.abs(np.log(is_m / was_m))
    change = change[np.isfinite(change)]
    return change.size >= ENOUGH_BEARINGS and bool(np.median(change) > CHANGED_LOG)
