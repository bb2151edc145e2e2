"""Occupancy grid of the floor around the car: blocked, free and unknown cells.

Made for a standing car that looks for a way out, from this scan and the views kept on the way here (`behind`). A cell
is free when a beam went through it or the car itself was there; it is blocked when something returned from it, unless
this scan looks through it now; everything else is unknown, and unknown is never free.
"""

import cmath
import math
from collections.abc import Generator

import numpy as np
import numpy.typing as npt

from wallride.runtime.control.perception.geometry import Booleans, Floats, Places
from wallride.runtime.control.perception.obstacles.rear_memory import RememberedView
from wallride.runtime.control.safety.footprint import Outline

Whole = npt.NDArray[np.intp]

CELL_M = 0.04
REACH_M = 2.4
"""The map is a square with the rear axle in its middle, this far to each side."""
HALF_CELLS = round(REACH_M / CELL_M)
CELLS = 2 * HALF_CELLS + 1
MATCHED_YAWS_RAD = (0.0, 0.025, -0.025, 0.05, -0.05, 0.1, -0.1)
MATCHED_STEPS_M: Places = np.array(
    sorted((complex(-CELL_M * back, CELL_M * aside) for back in range(-2, 10) for aside in range(-2, 3)), key=abs)
)
"""Candidate offsets of a view, the nearest first; farther backwards, where a hard stop slides from."""
BETTER_BY, BETTER_POINTS = 1.05, 3
MATCHED_EVERY = 4
EDGE_CELLS = 2
"""Margin in cells by which known floor is extended: noise and the beams' spacing end it short of the obstacles."""
_ALONG_M = CELL_M * np.arange(-HALF_CELLS, HALF_CELLS + 1, dtype=np.float64)
CENTRES_M: Places = (_ALONG_M[None, :] + 1j * _ALONG_M[:, None]).ravel()
"""The cells' middles, row by row, in base_link."""


def cell_of(places_m: Places) -> Whole:
    """Return the flat index of the cell of each place, (k,), of those on the map only."""
    column = np.rint(places_m.real / CELL_M).astype(np.intp) + HALF_CELLS
    row = np.rint(places_m.imag / CELL_M).astype(np.intp) + HALF_CELLS
    inside = (column >= 0) & (column < CELLS) & (row >= 0) & (row < CELLS)
    cells: Whole = (row * CELLS + column)[inside]
    return cells


def blocked_floor(
    kept: list[RememberedView], bare: Outline
) -> Generator[None, None, tuple[Booleans, list[RememberedView]]]:
    """Return the cells that are not known to be free, (CELLS, CELLS), rows along y, and the views where they belong.

    Yields after each view.

    kept: views with their places in the odometry frame, the newest last; the map lies in its base_link. bare: the car.
    """
    newest = kept[-1]
    hit = np.zeros(CELLS * CELLS, np.bool_)
    hit[cell_of(_points_m(newest))] = True
    looked_through = _seen(CENTRES_M - newest.view.lidar_m, newest)
    known = looked_through | bare.holds(CENTRES_M)
    later, turn, from_m = newest, 1 + 0j, 0j
    laid = [newest]
    for one in reversed(kept[:-1]):
        # By odometry from the next later view, whose place on the map is known by now; then laid over all later ones.
        from_m += (one.place_m - later.place_m) * cmath.rect(1.0, -later.yaw_rad) * turn
        turn *= cmath.rect(1.0, one.yaw_rad - later.yaw_rad)
        later, points_m = one, _points_m(one)
        turn, from_m = _laid_over(points_m, turn, from_m, hit)
        place_m = newest.place_m + from_m * cmath.rect(1.0, newest.yaw_rad)
        laid.append(RememberedView(one.view, place_m, newest.yaw_rad + cmath.phase(turn)))
        there_m = (CENTRES_M - from_m) / turn
        known |= _seen(there_m - one.view.lidar_m, one)
        known |= bare.holds(there_m)
        old = cell_of(points_m * turn + from_m)
        hit[old[~looked_through[old]]] = True
        yield
    hit &= ~bare.holds(CENTRES_M)
    return hit.reshape(CELLS, CELLS) | ~grown(known.reshape(CELLS, CELLS), EDGE_CELLS), laid[::-1]


def _points_m(one: RememberedView) -> Places:
    """Return the returns of a view, (k,) in its base_link."""
    solid = one.view.solid
    points_m: Places = one.view.x_m[solid] + 1j * one.view.y_m[solid]
    return points_m


def _laid_over(points_m: Places, turn: complex, from_m: complex, hit: Booleans) -> tuple[complex, complex]:
    """Return heading and place of a view on the map, corrected so that its points lie over those of later views.

    Locked wheels slide without being counted, and tyres slip in bends: odometry is good for a metre, not for the way to
    a box. Of the places near by, the one where most points meet (correlative scan matching, Olson 2009); the odometry's
    own where none is clearly better, as between bare walls.
    """
    worth = np.zeros((CELLS + 1, CELLS + 1), np.int64)  # the last row and column: beyond the map
    worth[:CELLS, :CELLS] += hit.reshape(CELLS, CELLS)
    worth[:CELLS, :CELLS] += grown(hit.reshape(CELLS, CELLS), 1)
    some_m = points_m[np.abs(points_m) < 2 * REACH_M][::MATCHED_EVERY] * turn
    own = best = 0
    found = turn, from_m
    for yaw_rad in MATCHED_YAWS_RAD:
        there_m = some_m * cmath.rect(1.0, yaw_rad) + (from_m + turn * MATCHED_STEPS_M)[:, None]
        column = np.rint(there_m.real / CELL_M).astype(np.intp) + HALF_CELLS
        row = np.rint(there_m.imag / CELL_M).astype(np.intp) + HALF_CELLS
        column[(column < 0) | (column > CELLS)] = CELLS
        row[(row < 0) | (row > CELLS)] = CELLS
        met = worth[row, column].sum(axis=1)
        step = int(met.argmax())
        if not yaw_rad:
            own = int(met[0])
        if met[step] > best:
            best = int(met[step])
            found = turn * cmath.rect(1.0, yaw_rad), from_m + turn * complex(MATCHED_STEPS_M[step])
    return found if best > BETTER_BY * own + BETTER_POINTS else (turn, from_m)


def _seen(from_lidar_m: Places, one: RememberedView) -> Booleans:
    """Return which places, (k,) in the lidar's frame of a view, its beams passed through."""
    scan = one.view.scan
    reach_m = _reach_m(one.view.ranges_m)
    beam = np.rint((np.angle(from_lidar_m) - scan.angle_min_rad) / scan.angle_step_rad).astype(np.intp)
    inside = (beam >= 0) & (beam < reach_m.size)
    seen: Booleans = inside & (np.abs(from_lidar_m) < reach_m[np.where(inside, beam, 0)] - CELL_M)
    return seen


def _reach_m(ranges_m: Floats) -> Floats:
    """Return the range proved free by each beam and its two neighbours, (n,); a missing echo proves nothing."""
    reach_m = np.nan_to_num(ranges_m, nan=0.0)
    padded = np.concatenate((reach_m[:1], reach_m, reach_m[-1:]))
    least: Floats = np.minimum(np.minimum(padded[:-2], padded[2:]), reach_m)
    return least


def grown(cells: Booleans, by: int) -> Booleans:
    """Return these cells dilated by `by` cells on each side."""
    wide = cells.copy()
    for _ in range(by):
        before = wide.copy()
        wide[1:] |= before[:-1]
        wide[:-1] |= before[1:]
        before = wide.copy()
        wide[:, 1:] |= before[:, :-1]
        wide[:, :-1] |= before[:, 1:]
    return wide


def border_of(blocked: Booleans) -> Whole:
    """Return rows and columns, (k, 2), of the blocked cells beside free ones: cells behind them are unreachable."""
    free = np.zeros((CELLS + 2, CELLS + 2), np.bool_)
    free[1:-1, 1:-1] = ~blocked
    beside = free[:-2, 1:-1] | free[2:, 1:-1] | free[1:-1, :-2] | free[1:-1, 2:]
    border: Whole = np.argwhere(blocked & beside)
    return border


def outline_cells(outline: Outline, yaw_rad: float, spare_m: float) -> Whole:
    """Return rows and columns from the middle, (k, 2), covered by the car at that heading, with a margin of spare_m."""
    reach = math.ceil((math.hypot(max(outline.front_m, outline.rear_m), outline.half_width_m) + spare_m) / CELL_M)
    row, column = np.mgrid[-reach : reach + 1, -reach : reach + 1]
    there_m = (column + 1j * row) * (CELL_M * np.exp(-1j * yaw_rad))
    wide = Outline(outline.front_m + spare_m, outline.rear_m + spare_m, outline.half_width_m + spare_m)
    covered = wide.holds(there_m)
    cells: Whole = np.column_stack([row[covered], column[covered]])
    return cells
