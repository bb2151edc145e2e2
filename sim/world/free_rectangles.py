"""Ray casts through a grid of solid and free cells, from free rectangle to free rectangle; everything in cells.

Each free cell knows, for each of the four quadrants of direction, a large free rectangle of which it is the nearest
corner. A beam goes to the exact point where it leaves that rectangle, and ends exactly on the edge of the first solid
cell: four or five leaps on the maps of real buildings, whatever the distance.
"""

import math

import numpy as np
import numpy.typing as npt

from wallride.sim.world.pose import Booleans, Floats

Cells = npt.NDArray[np.int64]
Leaps = npt.NDArray[np.uint16]

_FEW_BEAMS = 24
"""Number of beams below which one beam at a time costs less than the fixed price of a dozen numpy calls."""
_SIGNS = ((1, 1), (1, -1), (-1, 1), (-1, -1))
"""Quadrants of direction (sign of x, sign of y), in the order in which the leaps are stored."""
_LONGEST = 255
_BYTE = 8


class FreeRectangles:
    """Leap table of a grid whose rim is solid.

    leaps: width + 256 height of each cell's rectangle, 0 in solid cells; a plane for each quadrant of direction, rows
    from the lowest y, planes one after the other.
    """

    def __init__(self, solid: Booleans) -> None:
        self.rows, self.columns = solid.shape
        planes = [_longest(_free_run(solid, sign_x), sign_y).ravel() for sign_x, sign_y in _SIGNS]
        self.leaps: Leaps = np.concatenate(planes)
        self._leap_of = self.leaps.data

    def march(self, px: Floats, py: Floats, dx: Floats, dy: Floats) -> Floats:
        """Return the distances from px, py along unit vectors dx, dy to the first solid cell; 0 from inside one.

        Directions may not be -0.0. All shape (n,). The last few beams go one at a time.
        """
        rows, columns = self.rows, self.columns
        travelled = np.zeros(px.shape)
        column, row = np.floor(px).astype(np.int64), np.floor(py).astype(np.int64)
        beam = np.flatnonzero((column >= 0) & (row >= 0) & (column < columns) & (row < rows))
        far_x, far_y = (dx >= 0).astype(np.int64), (dy >= 0).astype(np.int64)  # the edge of its own cell a beam meets
        plane = (3 - 2 * far_x - far_y) * (rows * columns)
        with np.errstate(divide="ignore"):
            lines = np.stack([px, py, dx, dy, 1.0 / dx, 1.0 / dy])[:, beam]
        steps = np.stack([plane, far_x, far_y, 2 * far_x - 1, 2 * far_y - 1])[:, beam]
        column, row, now = column[beam], row[beam], np.zeros(beam.shape)
        while beam.size > _FEW_BEAMS:
            leap = self.leaps[steps[0] + row * columns + column].astype(np.int64)
            going = leap > 0
            travelled[beam] = now  # final for beams that have arrived, overwritten for the others
            if not going.all():
                beam, leap, column, row, now = beam[going], leap[going], column[going], row[going], now[going]
                lines, steps = lines[:, going], steps[:, going]
            now, column, row = _leap(lines, steps, leap, column, row)
        for index, number in enumerate(beam):
            line, step = lines[:, index].tolist(), steps[:, index].tolist()
            travelled[number] = self._march_one(line, step, int(column[index]), int(row[index]), float(now[index]))
        return travelled

    def _march_one(self, line: list[float], step: list[int], column: int, row: int, now: float) -> float:
        """Cast one beam to its wall: `_leap` in plain numbers, which for a few beams is far quicker."""
        px, py, dx, dy, per_x, per_y = line
        plane, far_x, far_y, sign_x, sign_y = step
        columns = self.columns
        while leap := self._leap_of[plane + row * columns + column]:
            last_x, last_y = column + sign_x * ((leap & _LONGEST) - 1), row + sign_y * ((leap >> _BYTE) - 1)
            until_x, until_y = (last_x + far_x - px) * per_x, (last_y + far_y - py) * per_y
            if until_x < until_y:
                now, column = until_x, last_x + sign_x
                row = min(max(math.floor(py + now * dy), min(row, last_y)), max(row, last_y))
            else:
                now, row = until_y, last_y + sign_y
                column = min(max(math.floor(px + now * dx), min(column, last_x)), max(column, last_x))
        return now


def _leap(lines: Floats, steps: Cells, leap: Cells, column: Cells, row: Cells) -> tuple[Floats, Cells, Cells]:
    """Move beams to where they leave their rectangles; return their distance then, column and row.

    The axis that was crossed steps exactly; the other may not be rounded out of the rectangle it is in.
    """
    px, py, dx, dy, per_x, per_y = lines
    _, far_x, far_y, sign_x, sign_y = steps
    last_x, last_y = column + sign_x * ((leap & _LONGEST) - 1), row + sign_y * ((leap >> _BYTE) - 1)
    until_x, until_y = (last_x + far_x - px) * per_x, (last_y + far_y - py) * per_y
    by_x = until_x < until_y
    now = np.where(by_x, until_x, until_y)
    aside_x, aside_y = np.floor(px + now * dx).astype(np.int64), np.floor(py + now * dy).astype(np.int64)
    aside_x = np.minimum(np.maximum(aside_x, np.minimum(column, last_x)), np.maximum(column, last_x))
    aside_y = np.minimum(np.maximum(aside_y, np.minimum(row, last_y)), np.maximum(row, last_y))
    return now, np.where(by_x, last_x + sign_x, aside_x), np.where(by_x, aside_y, last_y + sign_y)


def _free_run(solid: Booleans, sign_x: int) -> Cells:
    """Return the number of consecutive free cells along the sign in a row, this one included; 255 at most."""
    columns = solid.shape[1]
    number = np.arange(columns)
    along = solid[:, ::-sign_x]  # so that the run of a cell comes before it
    last_solid = np.maximum.accumulate(np.where(along, number, -1), axis=1)
    run: Cells = np.minimum(number - last_solid, _LONGEST)[:, ::-sign_x]
    return run


def _longest(run: Cells, sign_y: int) -> Leaps:
    """Return width and height, as in `leaps`, of each cell's rectangle, grown from its run along the sign.

    Of those that are 1, 2, 3, 4, 6, 8, 12 ... cells high, each made of two lower ones, the one with the greatest
    harmonic mean of width and height: tried on eight maps against largest area and longest mean way through, it needs
    the fewest leaps.
    """
    best, best_worth = (run + (1 << _BYTE)) * (run > 0), run / (run + 1)
    height, width = 1, run
    while width.any() and 3 * height <= _LONGEST:
        double = np.minimum(width, _further(width, height, sign_y))
        triple = np.minimum(double, _further(width, 2 * height, sign_y))
        for high, wide in ((2 * height, double), (3 * height, triple)):
            worth = high * wide / (high + wide)
            better = worth > best_worth
            best_worth[better] = worth[better]
            best[better] = wide[better] + (high << _BYTE)
        height, width = 2 * height, double
    return best.astype(np.uint16)


def _further(width: Cells, by: int, sign_y: int) -> Cells:
    """Return the same of the cell this many rows on; 0 beyond the grid."""
    moved = np.zeros_like(width)
    if by < len(width):
        here, there = (slice(None, -by), slice(by, None)) if sign_y > 0 else (slice(by, None), slice(None, -by))
        moved[here] = width[there]
    return moved
