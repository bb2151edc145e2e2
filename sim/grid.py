"""Walls as the solid cells of a map: exact ray casts to the cells' edges, exact distances to the car's outline.

Marching along a distance transform, the usual way, stops somewhere within a cell of the wall and reads about half a
cell (25 mm) too near or too far. Here every ray leaps from square to square: each free cell knows, for each of the
four quadrants of direction, the side of the largest free square that starts at it. The ray goes to the exact point
where it leaves that square, and ends exactly on the edge of the first solid cell.
"""

import math
from itertools import product

import numpy as np
import numpy.typing as npt

from sim.pose import Booleans, Floats, Footprint, Pose, into_frame

Cells = npt.NDArray[np.int64]

_FEW_BEAMS = 24
"""Below this many, one beam at a time costs less than the fixed price of a dozen numpy calls."""
_ALONG_GRID = 1e-12
"""Directions this close to a grid line lie along it; the inverse of less, or of -0.0, is the wrong infinity."""
_SIGNS = ((1, 1), (1, -1), (-1, 1), (-1, -1))
"""Quadrants of direction (sign of x, sign of y), in the order in which the leaps are stored."""


class GridGeometry:
    """A grid of solid and free cells.

    solid: shape (rows, columns), row 0 lowest in y; everything outside the grid is solid too.
    cell_m: edge of a cell.
    origin: world pose of the corner of cell (0, 0); its yaw turns the whole map.
    """

    def __init__(self, solid: Booleans, cell_m: float, origin: Pose) -> None:
        padded: Booleans = np.pad(np.asarray(solid, dtype=np.bool_), 1, constant_values=True)
        self.solid = padded
        self.cell_m = float(cell_m)
        self.origin = origin.ahead(-self.cell_m, -self.cell_m)
        self._leaps = np.stack([_free_squares(padded, sx, sy) for sx, sy in _SIGNS]).ravel()
        self._leap_of = self._leaps.data
        self._edge_xy_m = self._edge_cells_m()

    @property
    def bounds_m(self) -> tuple[float, float, float, float]:
        """Return (x_min, y_min, x_max, y_max) of everything."""
        outline = self.outline_m
        x, y = outline[:, [0, 2]], outline[:, [1, 3]]
        return float(x.min()), float(y.min()), float(x.max()), float(y.max())

    @property
    def outline_m(self) -> Floats:
        """Return the edges between free and solid cells, joined into segments (x0, y0, x1, y1), shape (k, 4)."""
        level = _runs(self.solid[:-1] != self.solid[1:])
        upright = _runs((self.solid[:, :-1] != self.solid[:, 1:]).T)
        ends = [
            np.column_stack([level[:, 1], level[:, 0] + 1, level[:, 2], level[:, 0] + 1]),
            np.column_stack([upright[:, 0] + 1, upright[:, 1], upright[:, 0] + 1, upright[:, 2]]),
        ]
        cells = np.vstack(ends) * self.cell_m
        x0, y0 = self._to_world(cells[:, 0], cells[:, 1])
        x1, y1 = self._to_world(cells[:, 2], cells[:, 3])
        return np.column_stack([x0, y0, x1, y1])

    def is_free(self, x_m: float, y_m: float) -> bool:
        """Whether a world point lies in a free cell."""
        cos, sin = math.cos(self.origin.yaw_rad), math.sin(self.origin.yaw_rad)
        dx, dy = x_m - self.origin.x_m, y_m - self.origin.y_m
        column, row = math.floor((cos * dx + sin * dy) / self.cell_m), math.floor((cos * dy - sin * dx) / self.cell_m)
        rows, columns = self.solid.shape
        return 0 <= row < rows and 0 <= column < columns and not self.solid[row, column]

    def cell_centre(self, row: int, column: int) -> tuple[float, float]:
        """Return the world position of the middle of a cell, counted in the padded grid `solid`."""
        at = self.origin.ahead((column + 0.5) * self.cell_m, (row + 0.5) * self.cell_m)
        return at.x_m, at.y_m

    def cast(self, x_m: float | Floats, y_m: float | Floats, bearing_rad: Floats) -> Floats:
        """Return the distance from each origin along each world bearing to the first solid cell; 0 from inside one.

        bearing_rad: shape (n,); x_m, y_m: one origin for all beams, or one for each, shape (n,).
        """
        ox, oy = np.broadcast_to(x_m, bearing_rad.shape), np.broadcast_to(y_m, bearing_rad.shape)
        along, across = into_frame(self.origin, ox, oy)
        heading = bearing_rad - self.origin.yaw_rad
        dx, dy = (np.where(np.abs(part) < _ALONG_GRID, 0.0, part) for part in (np.cos(heading), np.sin(heading)))
        return self._march(along / self.cell_m, across / self.cell_m, dx, dy) * self.cell_m

    def clearance(self, pose: Pose, footprint: Footprint) -> float:
        """Return the distance between the car's outline and the nearest solid cell, 0 in contact."""
        if not self.is_free(pose.x_m, pose.y_m):
            return 0.0
        x, y = self._edge_xy_m[:, 0], self._edge_xy_m[:, 1]
        far2 = (x - pose.x_m) ** 2 + (y - pose.y_m) ** 2
        near = far2 <= (math.sqrt(far2.min()) + footprint.reach_m + 2 * self.cell_m) ** 2
        return _cells_to_rectangle(x[near], y[near], self.cell_m / 2, self.origin.yaw_rad, pose, footprint)

    def mirrored(self) -> "GridGeometry":
        """Return the same map with y negated."""
        inner = self.solid[1:-1, 1:-1]
        far_corner = self.origin.ahead(self.cell_m, (inner.shape[0] + 1) * self.cell_m)
        return GridGeometry(inner[::-1], self.cell_m, far_corner.mirrored())

    def _march(self, px: Floats, py: Floats, dx: Floats, dy: Floats) -> Floats:
        """Leap from free square to free square; everything in cells. The last few beams go one at a time."""
        rows, columns = self.solid.shape
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
            leap = self._leaps[steps[0] + row * columns + column].astype(np.int64)
            going = leap > 0
            travelled[beam] = now  # final for those that have arrived, overwritten for the others
            if not going.all():
                beam, leap, column, row, now = beam[going], leap[going], column[going], row[going], now[going]
                lines, steps = lines[:, going], steps[:, going]
            now, column, row = _leap(lines, steps, leap, column, row)
        for index, number in enumerate(beam):
            line, step = lines[:, index].tolist(), steps[:, index].tolist()
            travelled[number] = self._march_one(line, step, int(column[index]), int(row[index]), float(now[index]))
        return travelled

    def _march_one(self, line: list[float], step: list[int], column: int, row: int, now: float) -> float:
        """Take one beam to its wall: `_leap` in plain numbers, which for a few beams is far quicker."""
        px, py, dx, dy, per_x, per_y = line
        plane, far_x, far_y, sign_x, sign_y = step
        columns = self.solid.shape[1]
        while leap := self._leap_of[plane + row * columns + column]:
            last_x, last_y = column + sign_x * (leap - 1), row + sign_y * (leap - 1)
            until_x, until_y = (last_x + far_x - px) * per_x, (last_y + far_y - py) * per_y
            if until_x < until_y:
                now, column = until_x, last_x + sign_x
                row = min(max(math.floor(py + now * dy), min(row, last_y)), max(row, last_y))
            else:
                now, row = until_y, last_y + sign_y
                column = min(max(math.floor(px + now * dx), min(column, last_x)), max(column, last_x))
        return now

    def _edge_cells_m(self) -> Floats:
        """World centres of the solid cells that touch a free one, shape (k, 2): the only ones a car can meet."""
        solid = self.solid
        beside_free = np.zeros_like(solid)
        for rows, columns in product((-1, 0, 1), repeat=2):
            beside_free |= ~np.roll(solid, (rows, columns), axis=(0, 1))
        row, column = np.nonzero(solid & beside_free)
        x, y = self._to_world(
            (column.astype(np.float64) + 0.5) * self.cell_m, (row.astype(np.float64) + 0.5) * self.cell_m
        )
        return np.column_stack([x, y])

    def _to_world(self, along_m: Floats, across_m: Floats) -> tuple[Floats, Floats]:
        cos, sin = math.cos(self.origin.yaw_rad), math.sin(self.origin.yaw_rad)
        return self.origin.x_m + cos * along_m - sin * across_m, self.origin.y_m + sin * along_m + cos * across_m


def _leap(lines: Floats, steps: Cells, leap: Cells, column: Cells, row: Cells) -> tuple[Floats, Cells, Cells]:
    """Move beams to where they leave a square of `leap` cells; return how far they are then, column and row.

    The axis that was crossed steps exactly; the other may not be rounded out of the square it is in.
    """
    px, py, dx, dy, per_x, per_y = lines
    _, far_x, far_y, sign_x, sign_y = steps
    last_x, last_y = column + sign_x * (leap - 1), row + sign_y * (leap - 1)
    until_x, until_y = (last_x + far_x - px) * per_x, (last_y + far_y - py) * per_y
    by_x = until_x < until_y
    now = np.where(by_x, until_x, until_y)
    aside_x, aside_y = np.floor(px + now * dx).astype(np.int64), np.floor(py + now * dy).astype(np.int64)
    aside_x = np.minimum(np.maximum(aside_x, np.minimum(column, last_x)), np.maximum(column, last_x))
    aside_y = np.minimum(np.maximum(aside_y, np.minimum(row, last_y)), np.maximum(row, last_y))
    return now, np.where(by_x, last_x + sign_x, aside_x), np.where(by_x, aside_y, last_y + sign_y)


def _free_squares(solid: Booleans, sign_x: int, sign_y: int) -> npt.NDArray[np.int16]:
    """Side of the largest free square whose nearest corner cell is this one and that extends along the signs.

    side(i, j) = 1 + min of the three neighbours ahead. Within a row that is a running minimum of value + column.
    """
    view = solid[::-sign_y, ::-sign_x]  # work towards row 0, column 0, whichever way the square extends
    rows, columns = view.shape
    number = np.arange(columns)
    side = np.zeros((rows, columns), dtype=np.int16)
    before = np.zeros(columns, dtype=np.int64)
    for row in range(1, rows):
        above = np.minimum(before[1:], before[:-1]) + 1
        best = np.concatenate([[0], above])
        best[view[row]] = 0
        before = np.minimum.accumulate(best - number) + number
        side[row] = before
    return np.ascontiguousarray(side[::-sign_y, ::-sign_x])


def _runs(marks: Booleans) -> Cells:
    """Return (row, first, end) of every run of True along the rows, shape (k, 3)."""
    steps = np.diff(np.pad(marks.astype(np.int8), ((0, 0), (1, 1))), axis=1)
    row, first = np.nonzero(steps == 1)
    end = np.nonzero(steps == -1)[1]
    return np.column_stack([row, first, end])


def _cells_to_rectangle(
    x_m: Floats, y_m: Floats, half_m: float, cell_yaw_rad: float, pose: Pose, footprint: Footprint
) -> float:
    """Smallest distance between square cells and the car's outline: at a corner of one or the other, or 0."""
    nearest = np.inf
    for i, j in product((-1, 1), repeat=2):
        corner = Pose(0.0, 0.0, cell_yaw_rad).ahead(i * half_m, j * half_m)
        nearest = min(
            nearest, float(footprint.distance_to(*into_frame(pose, x_m + corner.x_m, y_m + corner.y_m)).min())
        )
    for forward, left in footprint.corners():
        at = pose.ahead(forward, left)
        along, across = into_frame(Pose(at.x_m, at.y_m, cell_yaw_rad), x_m, y_m)
        outside_x, outside_y = np.maximum(np.abs(along) - half_m, 0.0), np.maximum(np.abs(across) - half_m, 0.0)
        nearest = min(nearest, float(np.hypot(outside_x, outside_y).min()))
    return nearest
