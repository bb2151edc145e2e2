"""What the follower `line` promises to drive: the way back to the line and along it, and how true that proved so far.

With the gains of `line_law` the lateral error e and its slope e' come to nothing along the way s as

    e(s) = (e + (e' + p e) s) exp(-p s),   p = frequency / speed

which is the same pair of poles without their slight swing. Where that bends more than the grip allows, p is smaller.
"""

import cmath
import math
from collections import deque
from typing import Final

import numpy as np

from wallride.drivers.value import value
from wallride.runtime.control.line_following.race_line import CourseLine, OnLine
from wallride.runtime.control.perception.geometry import Floats, Places

STEP_M: Final = 0.2
SLOWER_SHARE, SLOWER_TIMES = 0.8, 4
"""By how much slower the way back becomes where it bends too much, and how often."""
REACH_S, REACH_M, BRAKES_MPS2 = 0.6, 1.5, 3.0
"""The promise reaches as far as a gentle stop: the way in a time, of a brake, and a spare."""
FIRST_MARGIN_M, LEAST_MARGIN_M, MOST_MARGIN_M = 0.10, 0.02, 0.4
CHECKED_SCANS: Final = 16
"""After so many scans a promise is compared with what was driven."""
FORGETS_S: Final = 20.0
"""Time in which the largest error so far fades."""


@value()
class Return:
    """How a car comes back to its line. aside_m: lateral error. slope: its change by way. per_m: p, above."""

    along_m: float
    aside_m: float
    slope: float
    per_m: float

    @staticmethod
    def of(on: OnLine, course_rad: float, per_m: float, most_radpm: float = math.inf) -> "Return":
        """Return the way back of a car whose rear axle moves in a direction on the map. most_radpm: at most bent so."""
        slope = math.tan(min(max(math.remainder(course_rad - on.yaw_rad, math.tau), -1.0), 1.0))
        for _ in range(SLOWER_TIMES):
            if abs(on.curvature_radpm - per_m * (per_m * on.aside_m + 2.0 * slope)) <= most_radpm:
                break
            per_m *= SLOWER_SHARE
        return Return(on.along_m, on.aside_m, slope, per_m)

    def aside_at(self, way_m: Floats) -> Floats:
        """Return the lateral error after ways (n,) along the line."""
        grown = self.aside_m + (self.slope + self.per_m * self.aside_m) * way_m
        aside_m: Floats = grown * np.exp(-self.per_m * way_m)
        return aside_m


class Promises:
    """Makes a promise for each scan, and knows by how much the earlier ones were missed. margin_m: at most, lately."""

    def __init__(self) -> None:
        self.margin_m = FIRST_MARGIN_M
        self._made: deque[Return] = deque(maxlen=CHECKED_SCANS)

    def begin(self) -> None:
        """Forget what was promised, and keep what it was worth."""
        self._made.clear()

    def held_back(self) -> None:
        """Forget the promises that something else broke, and what they were worth: from here on the line is slower."""
        self._made.clear()
        self.margin_m = min(self.margin_m, FIRST_MARGIN_M)

    def check(self, now: Return, length_m: float, since_s: float) -> None:
        """Compare the promise of a while ago with where the car is, and note the one of now."""
        self.margin_m += (LEAST_MARGIN_M - self.margin_m) * min(1.0, since_s / FORGETS_S)
        if len(self._made) == CHECKED_SCANS:
            way_m = math.remainder(now.along_m - self._made[0].along_m, length_m)
            if way_m > 0.0:
                missed_m = abs(float(self._made[0].aside_at(np.array([way_m]))[0]) - now.aside_m)
                self.margin_m = min(max(self.margin_m, missed_m), MOST_MARGIN_M)
        self._made.append(now)


def way_ahead(
    line: CourseLine, now: Return, pose: tuple[complex, float], speed_mps: float, most_m: float = math.inf
) -> tuple[Places, Floats]:
    """Return places in base_link, the first one the car's own, and the line's speed at each of them, (n,).

    pose: place and heading of the rear axle on the map. most_m: way along the line beyond which nothing is promised.
    """
    reach_m = REACH_M + REACH_S * speed_mps + speed_mps**2 / (2.0 * BRAKES_MPS2)
    way_m: Floats = np.arange(STEP_M, min(reach_m + STEP_M, most_m), STEP_M)
    places, directions, speeds_mps = line.ahead(now.along_m, way_m)
    places = places + 1j * now.aside_at(way_m) * directions
    place_m, heading_rad = pose
    seen = (places - place_m) * cmath.exp(-1j * heading_rad)
    return np.concatenate([[0j], seen]), np.concatenate([speeds_mps[:1], speeds_mps])
