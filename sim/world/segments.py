"""Walls as straight segments and poles as circles: exact ray casts and exact distances to the car's outline.

Beams are cast in one of two ways that agree to rounding: the compiled `casting.c` where available, else all beams are
intersected with all walls at once.
"""

from functools import lru_cache

import numpy as np

from wallride.drivers.accelerated import accelerable
from wallride.sim.world import compiled
from wallride.sim.world.pose import Booleans, Floats, Footprint, Pose, into_frame

_NO_SEGMENTS = np.empty((0, 4))
_NO_CIRCLES = np.empty((0, 3))
_END_SLACK_M = 1e-9
"""Margin by which segments are lengthened for rays, so that none passes through a corner."""
EDGE_ON = 1e-9
"""Sine of the angle below which a wall, which has no thickness, is invisible: rounding would decide its position."""
_BLOCK = 6
"""Number of segments processed at once: more of them times 1081 beams exceed the processor's inner cache."""


class SegmentGeometry:
    """Segments (x0, y0, x1, y1), shape (n, 4), and circles (x, y, radius), shape (m, 3); world frame, metres."""

    def __init__(self, segments_m: Floats = _NO_SEGMENTS, circles_m: Floats = _NO_CIRCLES) -> None:
        self.segments_m = np.array(segments_m, dtype=np.float64).reshape(-1, 4)
        self.circles_m = np.array(circles_m, dtype=np.float64).reshape(-1, 3)
        px, py = self.segments_m[:, 0], self.segments_m[:, 1]
        ex, ey = self.segments_m[:, 2] - px, self.segments_m[:, 3] - py
        length = np.hypot(ex, ey)
        ex, ey = ex / np.maximum(length, 1e-12), ey / np.maximum(length, 1e-12)
        self._straight = np.column_stack([px, py, ex, ey, length / 2])
        self._by_c = compiled.by_c(cast_walls)
        self._compiled = self._straight.ravel(), self.circles_m.ravel()

    @property
    def outline_m(self) -> Floats:
        """Return segments (x0, y0, x1, y1), shape (k, 4), to draw; circles become polygons."""
        return np.vstack([self.segments_m, *(circle_outline(*circle) for circle in self.circles_m)])

    def cast(self, x_m: float | Floats, y_m: float | Floats, bearing_rad: Floats) -> Floats:
        """Return the distance from each origin along each world bearing to the first wall, inf where there is none.

        bearing_rad: shape (n,); x_m, y_m: one origin for all beams, or one for each, shape (n,).
        """
        if self._by_c is not None:
            return compiled.cast(self._by_c, self._compiled, x_m, y_m, bearing_rad)
        return cast_walls(self._straight, self.circles_m, x_m, y_m, bearing_rad)

    def clearance(self, pose: Pose, footprint: Footprint) -> float:
        """Return the distance between the car's outline and the nearest wall, 0 in contact, inf without walls."""
        nearest_m = np.inf
        if len(self.segments_m):
            x0, y0 = into_frame(pose, self.segments_m[:, 0], self.segments_m[:, 1])
            x1, y1 = into_frame(pose, self.segments_m[:, 2], self.segments_m[:, 3])
            nearest_m = float(_segments_to_rectangle(x0, y0, x1, y1, footprint).min())
        if len(self.circles_m):
            x, y = into_frame(pose, self.circles_m[:, 0], self.circles_m[:, 1])
            nearest_m = min(nearest_m, max(0.0, float((footprint.distance_to(x, y) - self.circles_m[:, 2]).min())))
        return nearest_m

    def mirrored(self) -> "SegmentGeometry":
        """Return the same walls with y negated."""
        return SegmentGeometry(self.segments_m * [1, -1, 1, -1], self.circles_m * [1, -1, 1])


def circle_outline(x_m: float, y_m: float, radius_m: float, *, corners: int = 16) -> Floats:
    """Return a polygon for a circle as segments, shape (corners, 4); for drawing only."""
    angle = np.linspace(0.0, 2 * np.pi, corners + 1)
    x, y = x_m + radius_m * np.cos(angle), y_m + radius_m * np.sin(angle)
    return np.column_stack([x[:-1], y[:-1], x[1:], y[1:]])


def chain(points: list[tuple[float, float]], *, closed: bool = False) -> Floats:
    """Return the segments that join points in order, shape (n, 4)."""
    corners = np.array([*points, points[0]] if closed else points, dtype=np.float64)
    return np.hstack([corners[:-1], corners[1:]])


def box(x_m: float, y_m: float, length_m: float, width_m: float, yaw_rad: float = 0.0) -> Floats:
    """Return the four sides of a rectangle with its centre at x, y and its length along yaw."""
    at = Pose(x_m, y_m, yaw_rad)
    corners = [at.ahead(i * length_m / 2, j * width_m / 2) for i, j in ((1, 1), (-1, 1), (-1, -1), (1, -1))]
    return chain([(corner.x_m, corner.y_m) for corner in corners], closed=True)


@accelerable
def cast_walls(
    straight: Floats, circles_m: Floats, x_m: float | Floats, y_m: float | Floats, bearing_rad: Floats
) -> Floats:
    """Return the distances to the nearest wall or circle, see `SegmentGeometry.cast`; `casting.c` fills them in.

    straight: one end (x, y), unit direction (x, y), half the length, metres, shape (n, 5). circles_m: shape (m, 3).
    """
    dx, dy = np.cos(bearing_rad), np.sin(bearing_rad)
    ox, oy = np.broadcast_to(x_m, dx.shape), np.broadcast_to(y_m, dx.shape)
    nearest = _cast_straight(straight, ox, oy, dx, dy)
    if len(circles_m):
        np.minimum(nearest, _cast_circles(circles_m, ox, oy, dx, dy), out=nearest)
    return nearest


def _cast_straight(straight: Floats, ox: Floats, oy: Floats, dx: Floats, dy: Floats) -> Floats:
    """Meet all walls: ray o + t d meets the line p + s e at t = (p-o) x e / d x e and s = (p-o) x d / d x e.

    Three matrix products for some walls at a time.
    """
    px, py, ex, ey, half = straight.T
    along_ray = np.column_stack([px * ey - py * ex, -ey, ex])
    along_wall = np.column_stack([px, -py, -np.ones_like(px)])
    facings, halves_m = np.column_stack([ey, -ex]), half[:, None]
    aim = np.stack([dx, dy])
    offset = np.stack([dy, dx, ox * dy - oy * dx])
    place = np.stack([np.ones_like(ox), ox, oy])
    nearest = np.full(dx.shape, np.inf)
    with np.errstate(divide="ignore", invalid="ignore", over="ignore"):  # parallel: filtered out as edge-on below
        for first in range(0, len(straight), _BLOCK):
            some = slice(first, first + _BLOCK)
            half_m = halves_m[some]
            facing = 1.0 / (facings[some] @ aim)
            along = along_wall[some] @ offset
            along *= facing
            distance = along_ray[some] @ place
            distance *= facing
            along -= half_m
            met = np.abs(along, out=along) <= half_m + _END_SLACK_M
            met &= distance >= 0.0
            met &= np.abs(facing, out=facing) < 1.0 / EDGE_ON
            np.minimum(nearest, np.where(met, distance, np.inf).min(axis=0), out=nearest)
    return nearest


def _cast_circles(circles_m: Floats, ox: Floats, oy: Floats, dx: Floats, dy: Floats) -> Floats:
    to_x, to_y, radius = circles_m[:, :1] - ox, circles_m[:, 1:2] - oy, circles_m[:, 2:]
    along, aside = to_x * dx + to_y * dy, to_x * dy - to_y * dx
    circle, beam = np.nonzero((np.abs(aside) <= radius) & (along > 0))  # few: circles are poles and legs
    half_chord = np.sqrt(np.maximum(radius[circle, 0] ** 2 - aside[circle, beam] ** 2, 0.0))
    nearest: Floats = np.full(dx.shape, np.inf)
    np.minimum.at(nearest, beam, along[circle, beam] - half_chord)
    nearest[(to_x**2 + to_y**2 <= radius**2).any(axis=0)] = 0.0
    return nearest


def _segments_to_rectangle(x0: Floats, y0: Floats, x1: Floats, y1: Floats, footprint: Footprint) -> Floats:
    """Return the distance of segments in the car's frame to its outline, 0 where they touch; shape (n,).

    Two convex shapes that do not meet are nearest at a corner of one of them.
    """
    ends = footprint.distance_to(np.stack([x0, x1]), np.stack([y0, y1]))
    ex, ey = x1 - x0, y1 - y0
    length2 = np.maximum(ex**2 + ey**2, 1e-18)
    cx, cy = _corners(footprint)
    share = np.minimum(np.maximum(((cx - x0) * ex + (cy - y0) * ey) / length2, 0.0), 1.0)
    corners = np.hypot(x0 + share * ex - cx, y0 + share * ey - cy)
    nearest: Floats = np.minimum(ends.min(axis=0), corners.min(axis=0))
    if nearest.min() < footprint.reach_m:  # what crosses is nearer to a corner
        nearest[_crosses(np.stack([x0, y0]), np.stack([ex, ey]), footprint)] = 0.0
    return nearest


def _crosses(start: Floats, step: Floats, footprint: Footprint) -> Booleans:
    """Return whether each segment, start and start + step, shape (2, n), crosses the rectangle: the slab test."""
    low, high = _slabs(footprint)
    with np.errstate(divide="ignore", invalid="ignore", over="ignore"):  # a parallel side has no crossing
        a, b = (low - start) / step, (high - start) / step
    within = (step == 0.0) & (start >= low) & (start <= high)
    first = np.where(within, -np.inf, np.fmin(a, b))
    last = np.where(within, np.inf, np.fmax(a, b))
    crosses: Booleans = np.maximum(first.max(axis=0), 0.0) <= np.minimum(last.min(axis=0), 1.0)
    return crosses


@lru_cache(maxsize=16)
def _corners(footprint: Footprint) -> Floats:
    """Return x and y of the corners, shape (2, 4, 1)."""
    corners: Floats = np.ascontiguousarray(footprint.corners().T)[:, :, None]
    return corners


@lru_cache(maxsize=16)
def _slabs(footprint: Footprint) -> Floats:
    """Return lower and upper bound of x and of y, shape (2, 2, 1)."""
    half_m = footprint.half_width_m
    return np.array([[[footprint.rear_m], [-half_m]], [[footprint.front_m], [half_m]]])
