"""The path of a ball that is rolled along the wall, seen from the rear axle.

Around the rear axle lies a fan of places: on each circle 35 bearings from the free side (-85 deg) to the wall side
(+85 deg). On each circle the first place that is nearer to the wall than D is on the ball's path: no corner rule.
All distances at once are one matrix product: |c - q|^2 = |c|^2 + |q|^2 - 2 c.q.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from runtime.control.geometry import Floats

Booleans = npt.NDArray[np.bool_]
_Singles = npt.NDArray[np.float32]

BEARINGS = 35
"""5 deg apart: the linear interpolation between two of them is off by 1e-3 tan(bearing) rad beside a straight wall."""
WIDEST_RAD = math.radians(85)
BEARING_RAD = np.linspace(-WIDEST_RAD, WIDEST_RAD, BEARINGS)
BEARING_STEP_RAD = 2 * WIDEST_RAD / (BEARINGS - 1)
RADII_M: Floats = np.linspace(0.3, 3.0, 10)
"""The circles of the path: how far it is looked at by the speed profile."""
_BEND_CIRCLES = slice(1, 5)
"""Circles of 0.6 to 1.5 m, by which the bend of the path is measured."""


@dataclass(frozen=True, slots=True, eq=False)
class BallPath:
    """The ball on each circle, all (k,).

    crosses: the path really crosses the circle there. meets: the wall is within D somewhere on it; where it meets but
    does not cross, even the place farthest to the free side is too near, and that place is the answer. Where it does
    not meet, the answer is the bearing nearest to the wall.
    """

    radius_m: Floats
    bearing_rad: Floats
    meets: Booleans
    crosses: Booleans

    def first(self, count: int) -> "BallPath":
        """Return the part on the first circles."""
        return BallPath(self.radius_m[:count], self.bearing_rad[:count], self.meets[:count], self.crosses[:count])


def _fan(radius_m: Floats) -> _Singles:
    """Return the places (x, y, 1) of the circles, shape (3, k * BEARINGS)."""
    x_m = np.multiply.outer(radius_m, np.cos(BEARING_RAD)).ravel()
    y_m = np.multiply.outer(radius_m, np.sin(BEARING_RAD)).ravel()
    return np.stack([x_m, y_m, np.ones_like(x_m)]).astype(np.float32)


_RADII_FAN = _fan(RADII_M)
_UNIT_FAN = _fan(np.ones(1))


def ball_path(wall_m: Floats, ball_m: float, more_radii_m: Sequence[float]) -> BallPath:
    """Roll a ball of radius `ball_m` along the wall's points (2, n), rear axle at the origin, wall on the left.

    The circles are RADII_M, then `more_radii_m`. Single precision: 1e-6 of a few square metres.
    """
    radius_m = np.append(RADII_M, more_radii_m)
    fans = [_RADII_FAN]
    for more_m in more_radii_m:
        fan = _UNIT_FAN * np.float32(more_m)
        fan[2] = 1.0
        fans.append(fan)
    factors = np.empty((wall_m.shape[1], 3), np.float32)
    factors[:, :2] = -2.0 * wall_m.T
    factors[:, 2] = np.einsum("ij,ij->j", wall_m, wall_m)
    nearest = (factors @ np.concatenate(fans, axis=1)).min(axis=0)
    square = nearest.reshape(radius_m.size, BEARINGS) + (radius_m * radius_m)[:, None]
    below = square < ball_m * ball_m
    first = below.argmax(axis=1)
    circles = np.arange(radius_m.size)
    meets = below[circles, first]
    crosses = meets & (first > 0)
    # Between the last free place and the first one below D the distance is taken as linear.
    near_m = np.sqrt(np.maximum(square[circles, first], 0.0))
    free_m = np.sqrt(np.maximum(square[circles, np.maximum(first - 1, 0)], 0.0))
    back = np.where(crosses, (ball_m - near_m) / np.where(crosses, free_m - near_m, 1.0), 0.0)
    bearing_rad = BEARING_RAD[first] - back * BEARING_STEP_RAD
    if not meets.all():
        bearing_rad = np.where(meets, bearing_rad, BEARING_RAD[square.argmin(axis=1)])
    return BallPath(radius_m, bearing_rad, meets, crosses)


def bend_per_m(path: BallPath) -> float:
    """Return the curvature of the path [1/m] between 0.6 and 1.5 m ahead, left positive; 0 where it is not all seen.

    Difference of the headings of the first and the last of three chords over the way between their middles: a straight
    path gives 0 wherever the car stands.
    """
    if not path.meets[_BEND_CIRCLES].all():
        return 0.0
    x = (path.radius_m[_BEND_CIRCLES] * np.cos(path.bearing_rad[_BEND_CIRCLES])).tolist()
    y = (path.radius_m[_BEND_CIRCLES] * np.sin(path.bearing_rad[_BEND_CIRCLES])).tolist()
    turn_rad = math.atan2(y[3] - y[2], x[3] - x[2]) - math.atan2(y[1] - y[0], x[1] - x[0])
    way_m = (math.hypot(x[2] - x[0], y[2] - y[0]) + math.hypot(x[3] - x[1], y[3] - y[1])) / 2
    return math.remainder(turn_rad, math.tau) / max(way_m, 1e-3)
