"""The way that bends least, and least suddenly, between two borders: offsets along the normals of a given way.

As the race line (Heilmeier et al. 2019), but open, with its first points fixed, and solved by Newton steps: bounds cost
the square of what lies beyond them, so that the cost is quadratic piece by piece. Linearized again at each scan.
"""

from functools import lru_cache
from typing import Final, NamedTuple

import numpy as np

from wallride.drivers.accelerated import accelerated
from wallride.runtime.control.corridor_following.borders import CourseBorders
from wallride.runtime.control.corridor_following.marching import STEP_M, curvature_of
from wallride.runtime.control.perception.geometry import Booleans, Floats, Places

KEEP_M: Final = 0.6
"""Wanted distance of the middle of the rear axle from either border."""
LEAST_KEEP_M: Final = 0.27
"""Least distance: a way with less room ends there."""
MOST_MOVE_M: Final = 0.5
BEYOND_M: Final = 0.6
"""How far a border may lie on the wrong side of a way that is pushed back by it."""
FREE_M: Final = 2.0
SUDDEN_M2: Final = 0.05
"""Weight of the change of curvature beside that of curvature: servo and tyres follow within about 0.2 m."""
OUTSIDE_COST: Final = 2e3
"""Cost of the square of a distance beyond a bound [1/m4]: a centimetre costs as much as a curvature of 1/m."""
CHANGE_COST: Final = 0.3
"""Cost of the square of a change from scan to scan [1/m4]: noise of the borders is not worth it."""
NEWTON_STEPS: Final = 6
TIGHTEST_PER_M: Final = 0.8
"""Tightest bend: the car's own, 1.07 /m, less slip of the tyres, trim and corrections."""
TIGHT_COST: Final = 30.0
"""Cost of the square of what a bend is beyond that, beside that of bends."""


class Bounds(NamedTuple):
    """How far the points of a way may be moved, (n,) each: to the right (least, < 0 with room), to the left (most).

    lack_m: by how much the course is narrower than twice KEEP_M; there both bounds are its middle.
    """

    least_m: Floats
    most_m: Floats
    lack_m: Floats

    def off_m(self, part: slice) -> float:
        """Return how far some of the points are beyond their bounds, at most."""
        return max(float(self.least_m[part].max()), -float(self.most_m[part].min()), 0.0)

    def first(self, end: int) -> "Bounds":
        """Return those of the first points."""
        return Bounds(self.least_m[:end], self.most_m[:end], self.lack_m[:end])


def bounds_of(way_m: Places, course: Places, borders: CourseBorders) -> Bounds:
    """Return the bounds within which the points (n,) of a way, with their directions (n,), keep off both borders."""
    most_m = free_beside_m(way_m, course, borders.left_m, 1.0)
    least_m = -free_beside_m(way_m, course, borders.right_m, -1.0)
    lack_m = np.maximum(least_m - most_m, 0.0)
    middle_m = (least_m + most_m) / 2
    narrow = lack_m > 0.0
    bounds = np.where(narrow, middle_m, least_m), np.where(narrow, middle_m, most_m)
    least_m, most_m = (np.clip(bound, -MOST_MOVE_M, MOST_MOVE_M) for bound in bounds)
    return Bounds(least_m, most_m, lack_m)


@accelerated
def free_beside_m(way_m: Places, course: Places, border_m: Places, side: float) -> Floats:
    """Return how far the points (n,) of a way may move to a side until KEEP_M from a border (k,), (n,), at most FREE_M.

    course: (n,). side: 1.0 is the left one, -1.0 the right one.
    """
    seen = (border_m - way_m[:, None]) * course.conj()[:, None]
    aside_m, chord2 = side * seen.imag, KEEP_M * KEEP_M - seen.real * seen.real
    met = (chord2 > 0.0) & (aside_m > -BEYOND_M)
    free_m: Floats = np.where(met, aside_m - np.sqrt(np.maximum(chord2, 0.0)), FREE_M).min(axis=1, initial=FREE_M)
    return free_m


@lru_cache(maxsize=128)
def _differences(count: int) -> tuple[Floats, Floats]:
    """Return the second differences (count - 2, count) of a way's points, and the weights (count - 2,) * 2 of bends."""
    second = np.diff(np.eye(count), 2, axis=0) / STEP_M**2
    change = np.diff(np.eye(count - 2), axis=0) / STEP_M
    return second, np.eye(count - 2) + SUDDEN_M2 * (change.T @ change)


def straightened(way_m: Places, course: Places, fixed: int, bounds: Bounds) -> Places:
    """Return a way (n,) moved along its normals. fixed: number of its first points that stay.

    An offset n changes the curvature k by n''. (By n'' + k^2 n, which is exact, two rounds of bends swing: measured.)
    """
    least_m, most_m = bounds.least_m[fixed:], bounds.most_m[fixed:]
    bend = curvature_of(way_m)[1:-1]
    second, weight = _differences(way_m.size)
    bent = second[:, fixed:]
    weighted = bent.T @ weight
    cost, pull = weighted @ bent + CHANGE_COST * np.eye(least_m.size), weighted @ bend
    offset_m: Floats = np.zeros(least_m.size)
    kinds = _beyond(offset_m, bend, least_m, most_m)
    for _ in range(NEWTON_STEPS):
        above, below, tight = kinds
        beyond = OUTSIDE_COST * (above | below)
        wanted_m = np.where(above, most_m, least_m)
        rows = bent[tight]
        excess = bend[tight] - np.copysign(TIGHTEST_PER_M, bend[tight])
        matrix = cost + np.diag(beyond) + TIGHT_COST * (rows.T @ rows)
        offset_m = np.asarray(
            np.linalg.solve(matrix, beyond * wanted_m - pull - TIGHT_COST * (excess @ rows)), np.float64
        )
        before, kinds = kinds, _beyond(offset_m, bend + bent @ offset_m, least_m, most_m)
        if all((one == other).all() for one, other in zip(before, kinds, strict=True)):
            break
    moved_m = way_m.copy()
    moved_m[fixed:] += np.clip(offset_m, -MOST_MOVE_M, MOST_MOVE_M) * 1j * course[fixed:]
    return moved_m


def _beyond(offset_m: Floats, bend: Floats, least_m: Floats, most_m: Floats) -> tuple[Booleans, Booleans, Booleans]:
    """Return which points lie beyond their bounds, to the left and to the right, and which bends are too tight."""
    return offset_m > most_m, offset_m < least_m, np.abs(bend) > TIGHTEST_PER_M
