"""The path of a ball that is rolled along the wall, seen from the rear axle.

Around the rear axle lies a fan of places: on each circle 69 bearings from the free side (-85 deg) to the wall side
(+85 deg). On each circle the first place that is nearer to the wall than D is on the ball's path: no corner rule.
All distances at once are one matrix product: |c - q|^2 = |c|^2 + |q|^2 - 2 c.q.
"""

import math
from dataclasses import dataclass

import numpy as np

from runtime.control.geometry import Floats

BEARINGS = 69
WIDEST_RAD = math.radians(85)
BEARING_RAD = np.linspace(-WIDEST_RAD, WIDEST_RAD, BEARINGS)
BEARING_STEP_RAD = 2 * WIDEST_RAD / (BEARINGS - 1)
RADII_M = np.arange(1, 11) * 0.3
_COS, _SIN = np.cos(BEARING_RAD), np.sin(BEARING_RAD)


@dataclass(frozen=True, slots=True, eq=False)
class BallPath:
    """bearing_rad: (k,) of the ball on each circle. meets: (k,) whether the wall was within D anywhere on it."""

    radius_m: Floats
    bearing_rad: Floats
    meets: np.ndarray
    crosses: np.ndarray

    def first(self, count: int) -> "BallPath":
        """Return the part on the first circles."""
        return BallPath(self.radius_m[:count], self.bearing_rad[:count], self.meets[:count], self.crosses[:count])


def ball_path(wall_m: Floats, radius_m: Floats, ball_m: float) -> BallPath:
    """Roll a ball of radius `ball_m` along the wall's points (2, n), rear axle at the origin, wall on the left."""
    radius_m = np.asarray(radius_m, dtype=np.float64)
    factors = np.empty((wall_m.shape[1], 3))
    factors[:, :2] = wall_m.T
    factors[:, :2] *= -2.0
    factors[:, 2] = np.einsum("ij,ij->j", wall_m, wall_m)
    places = np.empty((3, radius_m.size, BEARINGS))
    np.multiply.outer(radius_m, _COS, out=places[0])
    np.multiply.outer(radius_m, _SIN, out=places[1])
    places[2] = 1.0
    square = (factors @ places.reshape(3, -1)).min(axis=0).reshape(radius_m.size, BEARINGS)
    square += (radius_m * radius_m)[:, None]
    below = square < ball_m * ball_m
    first = below.argmax(axis=1)
    rows = np.arange(radius_m.size)
    meets = below[rows, first]
    bearing = BEARING_RAD[first]
    # Between the last free place and the first one below D the distance is taken as linear.
    near = np.sqrt(np.maximum(square[rows, first], 0.0))
    free = np.sqrt(np.maximum(square[rows, np.maximum(first - 1, 0)], 0.0))
    inner = meets & (first > 0)
    share = np.where(inner, (near - ball_m) / np.where(inner, near - free, 1.0), 0.0)
    bearing = np.where(inner, bearing - np.abs(share) * BEARING_STEP_RAD, bearing)
    if not meets.all():
        bearing = np.where(meets, bearing, BEARING_RAD[square.argmin(axis=1)])
    return BallPath(radius_m, bearing, meets, inner)
