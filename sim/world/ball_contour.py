"""Path of a ball that rolls along the walls of a map, and the length of it that a car can follow.

The centre of a ball of radius w that touches a wall lies on the border of the cells that are at least w from the
nearest solid one. That border consists of closed curves: along a followed wall the path either returns to its
beginning, or needs a turn on the spot, at the end of a corridor that is too narrow for the car to turn in.

Frame: the grid's own, x along the columns, y along the rows. Sums and roots only, no sines and no compiled beams:
the same paths on every machine.
"""

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt

from wallride.sim.world.pose import Booleans, Floats, Side

Cells = npt.NDArray[np.int64]

ENDLESS_M = 200.0
"""Maximum way length [m]; longer ones count as equal: nearly a minute at 4 m/s."""
_STEP_M = 0.1
_SMOOTH_M = 0.5
"""Length [m] of the moving mean that smooths the border, which is a staircase."""
_TURN_M, _TURN_COS = 1.5, -0.75
"""A turn of 139 degrees or more within this length needs a radius below 0.62 m; a car has 0.93 m. The angle is none of
the multiples of 45 degrees that drawn maps are full of."""
_BEFORE_AND_AFTER_M = 2.0
"""Distance [m] before and after a turn: the same path in both directions is a niche, which can be cut off."""
_BACK_COS = -0.6
_MIN_RING_M = 5.86
"""Minimum length [m] of a closed path, the car's tightest circle: shorter ones cannot be driven round."""
_NEARBY_M, _SAME_WAY_COS = 0.5, 0.7
"""Maximum distance [m] and minimum cosine between the directions of two balls' paths that count as parallel
neighbours."""
RING_WITHIN_M = 1.5
"""Maximum distance of a place from the closed path that passes it."""
_RIGHT_TURN, _STRAIGHT_ON, _LEFT_TURN = -1, 0, 1


@dataclass(frozen=True, slots=True)
class Places:
    """Places along the ball's path, one per edge between a cell on its border and one beyond.

    cell: shape (n, 2), row and column of the cell. heading: shape (n, 2), the direction (x, y) in which a car drives
    there, a unit vector. way_m: shape (n,), how far it comes before the way turns too tightly, in 0.1 m; ENDLESS_M
    at most. end: shape (n,), the place where that is, as an index; -1 where it never is.
    """

    cell: Cells
    heading: Floats
    way_m: Floats
    end: Cells


def places(away_m: Floats, cell_m: float, ball_m: float, side: Side) -> Places:
    """Return the path of a ball of radius `ball_m` with the walls on one side.

    away_m: shape (rows, columns), each cell's distance from the nearest solid one; the grid's outermost cells are
    solid. At least one cell must have `ball_m` or more.
    """
    found, count = [], 0
    for middle, cell in _borders(away_m >= ball_m):
        way = slice(None, None, -1 if side == "left" else 1)
        heading, way_m, end = _driven(middle[way], cell_m)
        found.append((cell[way], heading, way_m, np.where(end < 0, -1, end + count)))
        count += len(cell)
    return Places(*(np.concatenate(parts) for parts in zip(*found, strict=True)))


def led_on(here: Places, nearer: Places, cell_m: float) -> Places:
    """Return the places with the ways of a car that moves nearer to the wall where its path ends, as laws do.

    nearer: the same walls' places for a smaller ball, on whose way the car is from the end of its own one on.
    """
    ends, which = np.unique(here.end, return_inverse=True)
    onward_m = np.array([_onward_m(here.cell[end], here.heading[end], nearer, cell_m) for end in ends])
    way_m = np.where(here.end < 0, here.way_m, here.way_m + onward_m[which])
    return replace(here, way_m=np.minimum(np.round(way_m, 1), ENDLESS_M))


def ring_along(away_m: Floats, cell_m: float, ball_m: float, side: Side, near_m: Floats) -> Floats | None:
    """Return the closed path, in the direction of driving, of a ball that passes `near_m`, shape (n, 2) [m].

    The first point is the nearest one. None where no path comes within RING_WITHIN_M, or where a car cannot drive it
    round: it ends in a turn on the spot.
    """
    best, best_m = None, RING_WITHIN_M
    for middle, _ in _borders(away_m >= ball_m):
        driven = middle[:: -1 if side == "left" else 1]
        far_m = _length(driven * cell_m - near_m)
        nearest = int(np.argmin(far_m))
        if far_m[nearest] < best_m and (_driven(driven, cell_m)[2] < 0).all():
            best, best_m = np.roll(driven, -nearest, axis=0) * cell_m, float(far_m[nearest])
    return best


def _onward_m(cell: Cells, heading: Floats, nearer: Places, cell_m: float) -> float:
    """Return the way from the nearest place in the same direction, 0 without one nearby."""
    far_m = _length(nearer.cell - cell) * cell_m
    far_m[nearer.heading @ heading < _SAME_WAY_COS] = np.inf
    nearest = int(np.argmin(far_m))
    return float(nearer.way_m[nearest]) if far_m[nearest] <= _NEARBY_M else 0.0


def _borders(inside: Booleans) -> Iterator[tuple[Floats, Cells]]:
    """Return each closed border of the cells inside, counter-clockwise: middles of its edges (n, 2), and their cells.

    Cells that share a corner only hang together: a ball's way may be one cell wide and oblique.
    """
    begin, heading, cell = _edges(inside)
    corners = inside.shape[1] + 1
    key = (begin[:, 1] * corners + begin[:, 0]) * 4 + heading
    order = np.argsort(key)
    ahead = np.array([[1, 0], [0, 1], [-1, 0], [0, -1]])[heading]
    end = begin + ahead
    follower = np.full(len(key), -1)
    for turn in (_RIGHT_TURN, _STRAIGHT_ON, _LEFT_TURN):
        wanted = (end[:, 1] * corners + end[:, 0]) * 4 + (heading + turn) % 4
        at = order[np.minimum(np.searchsorted(key, wanted, sorter=order), len(key) - 1)]
        follower = np.where((follower < 0) & (key[at] == wanted), at, follower)
    for ring in _rings(follower.tolist()):
        yield begin[ring] + ahead[ring] / 2, cell[ring]


def _edges(inside: Booleans) -> tuple[Cells, Cells, Cells]:
    """Return the edges of the inside: first corner (x, y), heading 0 to 3 from x on in quarter turns, cell inside."""
    begins, headings, cells = [], [], []
    beside = ((-1, 0, 0, 0), (0, 1, 1, 0), (1, 0, 1, 1), (0, -1, 0, 1))
    for heading, (rows_on, columns_on, corner_x, corner_y) in enumerate(beside):
        row, column = np.nonzero(inside & ~np.roll(inside, (-rows_on, -columns_on), axis=(0, 1)))
        begins.append(np.column_stack([column + corner_x, row + corner_y]))
        headings.append(np.full(len(row), heading))
        cells.append(np.column_stack([row, column]))
    return np.concatenate(begins), np.concatenate(headings), np.concatenate(cells)


def _rings(follower: list[int]) -> Iterator[list[int]]:
    """Return the cycles of a permutation."""
    seen = bytearray(len(follower))
    for first in range(len(follower)):
        ring, at = [], first
        while not seen[at]:
            seen[at] = 1
            ring.append(at)
            at = follower[at]
        if ring:
            yield ring


def _driven(middle: Floats, cell_m: float) -> tuple[Floats, Floats, Cells]:
    """Return heading, drivable way and its end at each edge of a closed border, in its order; see Places."""
    at_m = _smoothed(middle, max(1, round(_SMOOTH_M / cell_m / 2))) * cell_m
    steps_m = _length(np.roll(at_m, -1, axis=0) - at_m)
    along_m = np.concatenate([[0.0], np.cumsum(steps_m)])
    count = round(float(along_m[-1]) / _STEP_M)
    if count * _STEP_M < _MIN_RING_M:
        return np.tile([1.0, 0.0], (len(middle), 1)), np.zeros(len(middle)), np.arange(len(middle))
    even_m = along_m[-1] * np.arange(count + 1) / count
    x_m, y_m = (np.interp(even_m, along_m, np.append(part, part[0])) for part in at_m.T)
    chord_m = np.column_stack([np.diff(x_m), np.diff(y_m)])
    heading = chord_m / np.maximum(_length(chord_m), 1e-9)[:, None]
    ahead = _samples_ahead(_too_tight(heading))
    sample = np.minimum((along_m[:-1] / along_m[-1] * count).astype(np.int64), count - 1)
    end = np.searchsorted(along_m[:-1], even_m[(sample + ahead[sample] - 1) % count])
    step_m = float(along_m[-1]) / count
    way_m = np.minimum(np.round(ahead[sample] * step_m, 1), ENDLESS_M)
    endless = ahead[sample] < 0
    return heading[sample], np.where(endless, ENDLESS_M, way_m), np.where(endless, -1, end % len(middle))


def _smoothed(points: Floats, reach: int) -> Floats:
    """Return each point's mean with `reach` neighbours on either side, round the ring; shape (n, 2)."""
    around = np.take(points, np.arange(-reach - 1, len(points) + reach), axis=0, mode="wrap")
    sums = np.cumsum(around, axis=0)
    smooth: Floats = (sums[2 * reach + 1 :] - sums[: -2 * reach - 1]) / (2 * reach + 1)
    return smooth


def _too_tight(heading: Floats) -> Booleans:
    """Return where a ring of unit vectors, _STEP_M apart, reverses in too short a way; shape (n,)."""
    tight = np.zeros(len(heading), dtype=np.bool_)
    for steps in range(1, round(_TURN_M / _STEP_M) + 1):
        turned = np.sum(heading * np.roll(heading, -steps, axis=0), axis=1) < _TURN_COS
        tight |= np.roll(turned, steps // 2)
    far = round(_BEFORE_AND_AFTER_M / _STEP_M)
    back: Booleans = np.sum(np.roll(heading, far, axis=0) * np.roll(heading, -far, axis=0), axis=1) < _BACK_COS
    return tight & back


def _samples_ahead(tight: Booleans) -> Cells:
    """Return the number of samples of a ring from each to the next tight one, 0 there, -1 without one; shape (n,)."""
    marks, here = np.flatnonzero(tight), np.arange(len(tight))
    if not len(marks):
        return np.full(len(tight), -1)
    ahead: Cells = np.append(marks, marks[0] + len(tight))[np.searchsorted(marks, here)] - here
    return ahead


def _length(vectors: Floats | Cells) -> Floats:
    """Return the length of each, shape (n,)."""
    long: Floats = np.sqrt(vectors[:, 0] ** 2 + vectors[:, 1] ** 2)
    return long
