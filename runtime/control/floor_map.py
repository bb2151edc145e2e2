"""What the car knows of the floor around it: where something stands, and where nobody ever looked.

Made for a standing car that looks for a way out, from this scan and the views kept on the way here (`behind`). A cell
is free when a beam went through it or the car itself was there; it is blocked when something returned from it, unless
this scan looks through it now; everything else is unknown, and unknown is never free.
"""

import math
from collections.abc import Iterator

import numpy as np

from runtime.control.behind import Kept
from runtime.control.footprint import Outline
from runtime.control.geometry import Booleans, Floats, Places

CELL_M = 0.04
REACH_M = 2.4
"""The map is a square with the rear axle in its middle, this far to each side."""
HALF_CELLS = round(REACH_M / CELL_M)
CELLS = 2 * HALF_CELLS + 1
EDGE_CELLS = 2
"""Known floor ends short of what returns, by noise and by the beams' spacing; so much is taken for known as well."""
_ALONG_M = CELL_M * np.arange(-HALF_CELLS, HALF_CELLS + 1, dtype=np.float64)
CENTRES_M: Places = (_ALONG_M[None, :] + 1j * _ALONG_M[:, None]).ravel()
"""The cells' middles, row by row, in base_link."""


def cell_of(places_m: Places) -> np.ndarray:
    """Return the flat index of the cell of each place, (k,), of those on the map only."""
    column = np.rint(places_m.real / CELL_M).astype(np.intp) + HALF_CELLS
    row = np.rint(places_m.imag / CELL_M).astype(np.intp) + HALF_CELLS
    inside = (column >= 0) & (column < CELLS) & (row >= 0) & (row < CELLS)
    cells: np.ndarray = (row * CELLS + column)[inside]
    return cells


def blocked_floor(kept: list[Kept], bare: Outline) -> Iterator[Booleans]:
    """Yield the cells that are not known to be free, (CELLS, CELLS) rows along y; better with every view, the last best.

    kept: views with their places in the odometry frame, the newest last; the map lies in its base_link. bare: the car.
    """
    newest = kept[-1]
    known = np.zeros(CELLS * CELLS, np.bool_)
    hit = np.zeros(CELLS * CELLS, np.bool_)
    for one in kept:
        turn = np.exp(1j * (newest.yaw_rad - one.yaw_rad))
        moved_m = (newest.place_m - one.place_m) * np.exp(-1j * one.yaw_rad)
        there_m = CENTRES_M * turn + moved_m
        looked_through = _seen(there_m - one.view.lidar_x_m, one)
        if one is newest:
            hit &= ~looked_through
        known |= looked_through
        known |= bare.holds(there_m)
        solid = one.view.solid
        points_m = one.view.x_m[solid] + 1j * one.view.y_m[solid]
        hit[cell_of((points_m - moved_m) / turn)] = True
        if one is not newest:
            yield known.reshape(CELLS, CELLS)
    hit &= ~bare.holds(CENTRES_M)
    yield hit.reshape(CELLS, CELLS) | ~_grown(known.reshape(CELLS, CELLS))


def _seen(from_lidar_m: Places, one: Kept) -> Booleans:
    """Return which places, (k,) in the lidar's frame of a view, its beams went through."""
    scan = one.view.scan
    reach_m = _reach_m(one.view.ranges_m)
    beam = np.rint((np.angle(from_lidar_m) - scan.angle_min_rad) / scan.angle_step_rad).astype(np.intp)
    inside = (beam >= 0) & (beam < reach_m.size)
    seen: Booleans = inside & (np.abs(from_lidar_m) < reach_m[np.where(inside, beam, 0)] - CELL_M)
    return seen


def _reach_m(ranges_m: Floats) -> Floats:
    """Return how far each beam and its two neighbours look, (n,); silence proves nothing."""
    reach_m = np.nan_to_num(ranges_m, nan=0.0)
    padded = np.concatenate((reach_m[:1], reach_m, reach_m[-1:]))
    least: Floats = np.minimum(np.minimum(padded[:-2], padded[2:]), reach_m)
    return least


def _grown(known: Booleans) -> Booleans:
    """Return known floor and EDGE_CELLS more on each side."""
    grown = known.copy()
    for _ in range(EDGE_CELLS):
        before = grown.copy()
        grown[1:] |= before[:-1]
        grown[:-1] |= before[1:]
        before = grown.copy()
        grown[:, 1:] |= before[:, :-1]
        grown[:, :-1] |= before[:, 1:]
    return grown


def border_of(blocked: Booleans) -> np.ndarray:
    """Return rows and columns, (k, 2), of the blocked cells beside free ones: what is behind them cannot be reached."""
    free = np.pad(~blocked, 1, constant_values=False)
    beside = free[:-2, 1:-1] | free[2:, 1:-1] | free[1:-1, :-2] | free[1:-1, 2:]
    return np.argwhere(blocked & beside)


def outline_cells(outline: Outline, yaw_rad: float, spare_m: float) -> np.ndarray:
    """Return rows and columns from the middle, (k, 2), that the car at that heading covers, with so much to spare."""
    reach = math.ceil((math.hypot(max(outline.front_m, outline.rear_m), outline.half_width_m) + spare_m) / CELL_M)
    row, column = np.mgrid[-reach : reach + 1, -reach : reach + 1]
    there_m = (column + 1j * row) * (CELL_M * np.exp(-1j * yaw_rad))
    wide = Outline(outline.front_m + spare_m, outline.rear_m + spare_m, outline.half_width_m + spare_m)
    covered = wide.holds(there_m)
    return np.column_stack([row[covered], column[covered]])
