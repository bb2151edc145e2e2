"""The wall as one straight line from one scan, or no line: RANSAC with fixed pairs of beams (Fischler & Bolles 1981).

The pairs are drawn once, with a fixed seed, so that the same scan gives the same line. Everything is for a wall on the
left; for the right-hand side hand in mirrored points (`side_view` in `followed_wall`).
Line: all points p with n . p = d, n = (-sin a, cos a); a is the line's heading, d > 0 its distance, both seen from the
origin of the points (here base_link, the rear axle).
"""

import math
from collections.abc import Iterator
from itertools import islice
from typing import Any

import numpy as np
import numpy.typing as npt

from wallride.drivers.accelerated import accelerated
from wallride.drivers.value import value
from wallride.runtime.control.perception.geometry import Floats

Booleans = npt.NDArray[np.bool_]
Indices = npt.NDArray[np.intp]

FROM_RAD = math.radians(20)
TO_RAD = math.radians(126)
APART_RAD = math.radians(0.75)
"""Minimum angle between the examined beams, where the sensor's own are nearer to each other."""
MIN_RANGE_M = 0.2
MAX_RANGE_M = 5.0
PAIRS = 64
PAIR_FROM_RAD, PAIR_TO_RAD = math.radians(4.5), math.radians(33)
"""Minimum and maximum angle between the two beams of a pair."""
GATES_M = (0.08, 0.08, 0.06)
"""Gates of the distance between a point and its line: in the vote, and in each of the refits."""
MAX_SLOPE_RAD = math.radians(60)
_MAX_SLOPE_COS = math.cos(MAX_SLOPE_RAD)
MIN_LINE_M = 0.1
VOTE_RANGE_M = 2.0
"""Maximum weight of a vote, which is its range: it compensates the density of the near beams."""
NEARER_WINS_PER_M = 0.25
WINS_WITH = 0.9
"""Share of all votes with which an expected line is taken without a vote: no other can have as many."""
MIN_INLIERS = 8
CLEAN_INLIERS = 45
"""A line on no more beams than this is no long straight wall, nothing to be learnt from: 34 degrees of them, 45 of a
sensor with 1 degree a beam."""
_STATE, _INCREMENT = 3383365900161324816698418978122629783, 72763549156770659863042999813056722643
_FACTOR = 0x2360ED051FC65DA44385DF649FCCF645
"""State of PCG64 (O'Neill 2014) as numpy seeds it with 20, and its factor."""


@value()
class WallLine:
    """A straight wall on the left.

    distance_m: from the rear axle along the normal. heading_rad: seen from the car. inliers: beams on it.
    """

    distance_m: float
    heading_rad: float
    inliers: int

    def seen_from(self, x_m: float, y_m: float, yaw_rad: float) -> "WallLine":
        """Return the same line seen from another place, which is given in the present frame."""
        nearer_m = math.cos(self.heading_rad) * y_m - math.sin(self.heading_rad) * x_m
        return WallLine(self.distance_m - nearer_m, self.heading_rad - yaw_rad, self.inliers)

    def offsets_m(self, x_m: Floats, y_m: Floats) -> Floats:
        """Return how far beyond the line each point is, negative on the car's side."""
        offsets: Floats = math.cos(self.heading_rad) * y_m - math.sin(self.heading_rad) * x_m - self.distance_m
        return offsets


class LineFinder:
    """Finds the wall line among beams of a fixed geometry.

    bearing_rad: (n,) of the beams in the order in which `find` will get their points, wall on the left.
    beams: indices of those that are asked. rear, front: the pairs, as places in `beams`.
    """

    def __init__(self, bearing_rad: Floats) -> None:
        step_rad = abs(float(bearing_rad[1] - bearing_rad[0])) if bearing_rad.size > 1 else APART_RAD
        every = max(1, round(APART_RAD / step_rad))
        self.beams = np.flatnonzero((bearing_rad >= FROM_RAD) & (bearing_rad <= TO_RAD))[::every]
        kept = self.beams.size
        pairs = np.zeros((0, 2), np.intp)
        nearest, farthest = (
            max(1, round(apart_rad / (every * step_rad))) for apart_rad in (PAIR_FROM_RAD, PAIR_TO_RAD)
        )
        if kept > farthest:
            apart, share = draw(nearest, farthest, PAIRS)
            first = (share * (kept - apart)).astype(np.intp)
            pairs = np.stack([first, first + apart], axis=1)
        # The beam that looks more to the front is the head of each pair's direction.
        towards_front = bearing_rad[self.beams[pairs[:, 0]]] < bearing_rad[self.beams[pairs[:, 1]]]
        self.front = np.where(towards_front, pairs[:, 0], pairs[:, 1])
        self.rear = np.where(towards_front, pairs[:, 1], pairs[:, 0])

    def find(
        self, x_m: Floats, y_m: Floats, range_m: Floats, usable: Booleans, expected: WallLine | None = None
    ) -> WallLine | None:
        """Return the wall's line, or None without a reliable one.

        All (n,), wall on the left; x_m, y_m in base_link, range_m from the lidar, `usable` a mask of beams to believe.
        expected: where the line should be by the last scan; if it has most of all votes there, no other line is tried.
        """
        found = fit_wall_line(x_m, y_m, range_m, usable, self, expected)
        return None if found is None else WallLine(*found)


def draw(least: int, most: int, count: int) -> tuple[Indices, Floats]:
    """Return whole numbers from least to most, (count,), then numbers from 0 to 1, (count,): always the same.

    Those of numpy's default_rng(20), bit for bit; but the car needs numpy.random for nothing else: 3 MiB.
    """
    words, size, whole = _words(), most - least + 1, [least] * count
    if size > 1:  # Lemire 2019: without bias by the few numbers that are left over
        halves = (half for word in words for half in (word & 0xFFFFFFFF, word >> 32))
        products = (half * size for half in halves)
        fair = (product for product in products if product & 0xFFFFFFFF >= 2**32 % size)
        whole = [least + (product >> 32) for product in islice(fair, count)]
    return np.array(whole, np.intp), np.array([(word >> 11) * 2.0**-53 for word in islice(words, count)])


def _words() -> Iterator[int]:
    state, mask = _STATE, 2**64 - 1
    while True:
        state = (state * _FACTOR + _INCREMENT) % 2**128
        mixed, turn = (state >> 64) ^ (state & mask), state >> 122
        yield (mixed >> turn | mixed << (64 - turn)) & mask


def _flat_fit(
    x_m: Floats, y_m: Floats, range_m: Floats, usable: Booleans, lines: LineFinder, expected: WallLine | None
) -> tuple[Any, ...]:
    wanted_m, wanted_rad = (math.nan, 0.0) if expected is None else (expected.distance_m, expected.heading_rad)
    return x_m, y_m, range_m, usable, lines.beams, lines.rear, lines.front, wanted_m, wanted_rad


@accelerated(flat=_flat_fit)
def fit_wall_line(
    x_m: Floats,
    y_m: Floats,
    range_m: Floats,
    usable: Booleans,
    lines: LineFinder,
    expected: WallLine | None,
) -> tuple[float, float, int] | None:
    """Return distance_m, heading_rad and inliers of the WallLine through some of the beams, or None; see `find`."""
    beams, rear, front = lines.beams, lines.rear, lines.front
    range_m = range_m[beams]
    valid = usable[beams] & (range_m > MIN_RANGE_M) & (range_m < MAX_RANGE_M)
    if np.count_nonzero(valid) < MIN_INLIERS or not front.size:
        return None
    points = np.empty((3, beams.size))
    points[0] = 1.0
    points[1] = np.where(valid, x_m[beams], 0.0)
    points[2] = np.where(valid, y_m[beams], 0.0)
    weight = np.where(valid, np.minimum(range_m, VOTE_RANGE_M), 0.0)
    if expected is not None and not math.isnan(expected.distance_m):
        members = valid & (np.abs(expected.offsets_m(points[1], points[2])) < GATES_M[0])
        if float(weight @ members) > WINS_WITH * float(weight.sum()):
            return _refined(points, valid, members, GATES_M[2:])
    planes = _planes(points, valid, rear, front)
    if not planes.size:
        return None
    offset_m = planes @ points
    near = np.abs(offset_m, out=offset_m) < GATES_M[0]
    votes = near.astype(np.float64) @ weight
    votes /= 1.0 - NEARER_WINS_PER_M * planes[:, 0]
    return _refined(points, valid, near[int(votes.argmax())] & valid, GATES_M[1:])


def _planes(points: Floats, valid: Booleans, rear: Indices, front: Indices) -> Floats:
    """Return (-d, -sin a, cos a) of each pair that could be a wall, shape (k, 3)."""
    behind = points[1:, rear]
    ahead, aside = points[1:, front] - behind
    length = np.hypot(ahead, aside)
    length += 1e-9
    cos, sin = ahead / length, aside / length
    distance = cos * behind[1] - sin * behind[0]
    good = valid[front] & valid[rear] & (cos > _MAX_SLOPE_COS) & (distance > MIN_LINE_M)
    planes = np.stack((-distance, -sin, cos), axis=1)
    kept: Floats = planes[good]
    return kept


def _refined(
    points: Floats, valid: Booleans, members: Booleans, gates_m: tuple[float, ...]
) -> tuple[float, float, int] | None:
    """Fit the members by total least squares, then for each gate once more the points within it."""
    plane = np.empty(3)
    transposed = points.T
    for gate_m in (*gates_m, None):
        (count, sx, sy), (_, sxx, sxy), (_, _, syy) = ((points * members) @ transposed).tolist()
        if count < MIN_INLIERS:
            return None
        mx, my = sx / count, sy / count
        heading_rad = 0.5 * math.atan2(2 * (sxy / count - mx * my), (sxx - syy) / count - mx * mx + my * my)
        cos, sin = math.cos(heading_rad), math.sin(heading_rad)
        distance_m = cos * my - sin * mx
        if gate_m is None:
            break
        plane[:] = -distance_m, -sin, cos
        members = valid & (np.abs(plane @ points) < gate_m)
    return (distance_m, heading_rad, round(count)) if distance_m >= 0 else None
