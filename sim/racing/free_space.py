"""How far a line may move to either side: the room between what is not known to be free."""

from collections.abc import Sequence
from typing import Final

import numpy as np
from scipy.spatial import cKDTree

from wallride.sim.world.pose import Floats

WALL_STEP_M: Final = 0.02
MARCH_M: Final = 0.03
OUT_STEPS: Final = 40
FARTHEST_M: Final = 3.0
"""Largest sideways move of one round."""


class FreeSpace:
    """Distances from walls and from places to keep away from.

    outline_m: segments x0, y0, x1, y1, shape (k, 4), of all that is solid or unknown.
    avoided_m: circles x, y, radius that count as solid.
    """

    def __init__(self, outline_m: Floats, avoided_m: Sequence[tuple[float, float, float]] = ()) -> None:
        self._walls = cKDTree(_points_along(outline_m))
        self._avoided_m = np.array(avoided_m, dtype=np.float64).reshape(-1, 3)

    def away_m(self, points_m: Floats) -> Floats:
        """Return the distance from each point, shape (n, 2), to the nearest wall or avoided place, shape (n,)."""
        found: Floats = np.asarray(self._walls.query(points_m)[0])
        for x_m, y_m, radius_m in self._avoided_m:
            found = np.minimum(found, np.hypot(points_m[:, 0] - x_m, points_m[:, 1] - y_m) - radius_m)
        return found

    def beside_m(self, points_m: Floats, normals: Floats, keep_m: float) -> tuple[Floats, Floats]:
        """Return from where to where each point may move along its unit normal, (lowest, highest), each shape (n,).

        All of that way is `keep_m` from walls. A point that is nearer has to move, lowest and highest of one sign, and
        where nothing on its normal is that far from walls, to where it is farthest.
        """
        away_m = self.away_m(points_m)
        low_m = -self._free_m(points_m, -normals, keep_m)
        high_m = self._free_m(points_m, normals, keep_m)
        for at in np.flatnonzero(away_m < keep_m):
            low_m[at], high_m[at] = self._way_out_m(points_m[at], normals[at], keep_m)
        return low_m, high_m

    def _free_m(self, points_m: Floats, directions: Floats, keep_m: float) -> Floats:
        """Leap by the distance to the nearest wall less what is to be kept: nothing in between can be nearer."""
        gone_m = np.zeros(len(points_m))
        going = np.arange(len(points_m))
        while len(going):
            slack_m = self.away_m(points_m[going] + gone_m[going, None] * directions[going]) - keep_m
            gone_m[going] += np.maximum(slack_m, 0.0)
            going = going[(slack_m > MARCH_M) & (gone_m[going] < FARTHEST_M)]
        return np.minimum(gone_m, FARTHEST_M)

    def _way_out_m(self, point_m: Floats, normal: Floats, keep_m: float) -> tuple[float, float]:
        """Return the nearest stretch of a normal that is far enough from walls, without crossing one on the way."""
        offsets_m = MARCH_M * np.arange(-OUT_STEPS, OUT_STEPS + 1)
        away_m = self.away_m(point_m + offsets_m[:, None] * normal)
        walls = np.flatnonzero(away_m < MARCH_M)
        reachable = slice(max([0, *walls[walls < OUT_STEPS]]), min([len(offsets_m), *walls[walls > OUT_STEPS]]))
        offsets_m, away_m = offsets_m[reachable], away_m[reachable]
        if away_m.max() < keep_m:
            farthest_m = float(offsets_m[int(np.argmax(away_m))])
            return farthest_m, farthest_m
        good = np.flatnonzero(away_m >= keep_m)
        nearest = good[int(np.argmin(np.abs(offsets_m[good])))]
        way = 1 if offsets_m[nearest] > 0.0 else -1
        share = (keep_m - away_m[nearest - way]) / max(1e-9, away_m[nearest] - away_m[nearest - way])
        near_m = float(offsets_m[nearest - way] + way * share * MARCH_M)
        last = nearest
        while 0 <= last + way < len(away_m) and away_m[last + way] >= keep_m:
            last += way
        return min(near_m, float(offsets_m[last])), max(near_m, float(offsets_m[last]))


def _points_along(outline_m: Floats) -> Floats:
    """Return points on segments, WALL_STEP_M apart at most, shape (n, 2)."""
    begin, end = outline_m[:, :2], outline_m[:, 2:]
    counts = 1 + np.ceil(np.hypot(*(end - begin).T) / WALL_STEP_M).astype(np.int64)
    which = np.repeat(np.arange(len(outline_m)), counts)
    number = np.arange(len(which)) - np.repeat(np.cumsum(counts) - counts, counts)
    share = number / np.maximum(1, np.repeat(counts, counts) - 1)
    points: Floats = begin[which] + share[:, None] * (end - begin)[which]
    return points
