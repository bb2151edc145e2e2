"""Ray casts of an even fan from one origin in the order of bearings: each wall covers a run of neighbouring beams.

Instead of intersecting every beam with every wall, the two angles at which each wall begins and ends in the fan are
computed; after that only beams and walls that intersect are computed, about two walls per beam. Two walls that share a
corner get exactly the same number for it, so no beam can pass between them.
"""

import math

import numpy as np
import numpy.typing as npt

from wallride.sim.world.pose import Floats

Indices = npt.NDArray[np.int64]

EDGE_ON = 1e-9
"""Sine of the angle below which a wall, which has no thickness, is invisible: rounding would decide its position."""
_MAX_FAN_RAD = 3.2
"""Maximum angle that a straight wall fills; it is less than half the view, more is rounding of a wall seen edge-on."""

_SLACK_BEAMS = 1e-9
"""Margin by which walls are widened, so that a beam through a wall's end meets it."""
_MIN_BEAMS = 16
_EVEN_WITHIN_RAD = 1e-9
"""Maximum deviation from an even fan; such a beam still ends on a wall's line, at most this far beyond its end."""


class FanCast:
    """Walls (x0, y0, x1, y1), shape (n, 4).

    one_sided: each wall is seen only from where its first end is on the right and its second on the left; the other
    side is the inside of something.
    """

    def __init__(self, walls_m: Floats, *, one_sided: bool = False) -> None:
        self._ends_m = np.ascontiguousarray(walls_m.T)
        self._one_sided = one_sided
        ex, ey = walls_m[:, 2] - walls_m[:, 0], walls_m[:, 3] - walls_m[:, 1]
        length = np.maximum(np.hypot(ex, ey), 1e-12)
        self._ex, self._ey = ex / length, ey / length

    def cast(self, x_m: float, y_m: float, bearing_rad: Floats) -> Floats:
        """Return the distance to the first wall along each bearing, shape (n,); inf where there is none.

        From an origin on a wall, within rounding, the wall stops only the beams on one side, into its solid.
        bearing_rad: what `is_fan` accepts.
        """
        ranges_m = np.full(bearing_rad.shape, np.inf)
        wall, first, count = self._runs(x_m, y_m, bearing_rad)
        end = np.cumsum(count)
        if not end.size or not end[-1]:
            return ranges_m
        beam = np.arange(end[-1]) + np.repeat(first - (end - count), count)
        x0, y0 = self._ends_m[0][wall] - x_m, self._ends_m[1][wall] - y_m
        ex, ey = self._ex[wall], self._ey[wall]
        away_m = np.repeat(x0 * ey - y0 * ex, count)
        facing = np.cos(bearing_rad)[beam] * np.repeat(ey, count) - np.sin(bearing_rad)[beam] * np.repeat(ex, count)
        with np.errstate(divide="ignore", invalid="ignore"):
            distance_m = np.where(np.abs(facing) > EDGE_ON, away_m / facing, np.inf)
        np.minimum.at(ranges_m, beam, distance_m)
        np.maximum(ranges_m, 0.0, out=ranges_m)
        return ranges_m

    def _runs(self, x_m: float, y_m: float, bearing_rad: Floats) -> tuple[Indices, Indices, Indices]:
        """Return the walls that meet beams, first beam and count of each; a wall across the fan's seam comes twice."""
        x0, y0, x1, y1 = self._ends_m
        x0, y0, x1, y1 = x0 - x_m, y0 - y_m, x1 - x_m, y1 - y_m
        turns_left = x0 * y1 >= x1 * y0
        wall = np.arange(len(x0))
        if self._one_sided:
            wall = np.flatnonzero(turns_left)
            x0, y0, x1, y1 = x0[wall], y0[wall], x1[wall], y1[wall]
        begin, until = ((np.arctan2(y, x) - bearing_rad[0]) % math.tau for x, y in ((x0, y0), (x1, y1)))
        if not self._one_sided:
            begin, until = np.where(turns_left, begin, until), np.where(turns_left, until, begin)
        sure = (until - begin) % math.tau < _MAX_FAN_RAD
        per_rad = (bearing_rad.size - 1) / (bearing_rad[-1] - bearing_rad[0])
        first = np.maximum(np.ceil(begin * per_rad - _SLACK_BEAMS), 0.0).astype(np.int64)
        last = np.minimum(np.floor(until * per_rad + _SLACK_BEAMS) + 1.0, bearing_rad.size).astype(np.int64)
        over = np.flatnonzero(sure & (until < begin))
        count = np.where(sure, np.maximum(last - first, 0), 0)
        count[over] = np.maximum(bearing_rad.size - first[over], 0)
        first, count = np.concatenate([first, np.zeros_like(over)]), np.concatenate([count, last[over]])
        wall = np.concatenate([wall, wall[over]])
        meets = np.flatnonzero(count)
        return wall[meets], first[meets], count[meets]


def is_fan(bearing_rad: Floats) -> bool:
    """Return whether bearings grow evenly from beam to beam, over less than a full turn."""
    if bearing_rad.size < _MIN_BEAMS:
        return False
    steps = bearing_rad[1:] - bearing_rad[:-1]
    least, most = float(steps.min()), float(steps.max())
    return least > 0.0 and most - least < _EVEN_WITHIN_RAD and float(bearing_rad[-1] - bearing_rad[0]) < math.tau
