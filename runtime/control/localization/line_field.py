"""The line of the nearest wall for each cell of a map, so that a beam's distance from its wall is one look-up.

A distance transform would tell how far a wall is, but neither on which side nor exactly, and its slope turns over at
the wall. A line tells it with its sign, exactly for straight walls, and does not end at the cell.
"""

from dataclasses import dataclass
from typing import Final

import numpy as np
import numpy.typing as npt

from wallride.runtime.control.localization.wall_points import MapCells, WallPoints, lines_through, points_of_cells
from wallride.runtime.control.perception.geometry import Booleans, Floats, Places

Numbers = npt.NDArray[np.int32]

REACH_M: Final = 0.6
"""Cells farther from any wall have no line."""
MARGIN_CELLS: Final = 2
NOWHERE_M: Final = 1e3
"""Distance of every point from the line of cells that have none."""
LARGEST_M2: Final = 40_000.0
"""Largest map: a Jetson needs 15 bytes for each of 400 cells to the square metre."""


@dataclass(frozen=True, slots=True, eq=False)
class LineField:
    """Lines of walls by cell. A map's point p is at cell floor((p - corner) / cell).

    near, far: (rows * columns,), number of the nearest wall's line, and of the nearest that faces the other way: thin
    walls are seen from both sides. normals: (k + 1,), unit normals toward the seen side; offsets_m: (k + 1,), so that
    the distance of p from a line is (p . normal) - offset, positive before the wall. The last line is that of no wall.
    free: (rows * columns,), whether the cell is known to be free.
    """

    corner_m: complex
    cell_m: float
    rows: int
    columns: int
    near: Numbers
    far: Numbers
    normals: Places
    offsets_m: Floats
    free: Booleans

    def cells_at(self, places_m: Places) -> npt.NDArray[np.int64]:
        """Return the cells of points (n,); of points off the map, a cell at its border, which has no line."""
        there = (places_m - self.corner_m) * (1.0 / self.cell_m)
        column = there.real.astype(np.int64)
        row = there.imag.astype(np.int64)
        np.minimum(np.maximum(column, 0, out=column), self.columns - 1, out=column)
        np.minimum(np.maximum(row, 0, out=row), self.rows - 1, out=row)
        row *= self.columns
        row += column
        return row

    def lines_at(self, places_m: Places, ahead: Places) -> Numbers:
        """Return the numbers of the lines of the walls that beams with those directions (n,) meet at points (n,)."""
        cells = self.cells_at(places_m)
        lines = self.near.take(cells)
        normals = self.normals.take(lines)
        behind = normals.real * ahead.real + normals.imag * ahead.imag > 0.0
        return np.where(behind, self.far.take(cells), lines)

    @property
    def nearness(self) -> npt.NDArray[np.float32]:
        """Return how near a cell's middle is to a wall, (rows * columns,), 1 on it: exp(-(distance / 0.2 m)^2)."""
        column, row = np.meshgrid(np.arange(self.columns) + 0.5, np.arange(self.rows) + 0.5)
        middles = (self.corner_m + self.cell_m * (column + 1j * row)).ravel()
        normals = self.normals[self.near]
        off_m = (normals.conj() * middles).real - self.offsets_m[self.near]
        near: npt.NDArray[np.float32] = np.exp(-((off_m / 0.2) ** 2)).astype(np.float32)
        return near


def field_of_cells(cells: MapCells) -> LineField:
    """Return the field of a map that has nothing but its cells."""
    return line_field(points_of_cells(cells), cells)


def line_field(points: WallPoints, cells: MapCells) -> LineField:
    """Return the field of walls. ValueError for a map without a wall, or too large a one."""
    if not points.places_m.size:
        raise ValueError("the map has no wall that borders on free cells: is `negate` in its .yaml file right?")
    grid = _Grid.around(points.places_m, cells.cell_m)  # first: it refuses what would take all memory
    lines = lines_through(points, cells.cell_m)
    near, _ = grid.filled(lines, np.arange(lines.places_m.size))
    normals = np.append(lines.normals, 0.0)
    far = grid.opposite(lines, near, normals)
    none = lines.places_m.size
    near[near < 0], far[far < 0] = none, none
    offsets_m = np.append((lines.normals.conj() * lines.places_m).real, NOWHERE_M)
    return LineField(
        grid.corner_m, cells.cell_m, grid.rows, grid.columns, near, far, normals, offsets_m, grid.free_of(cells)
    )


@dataclass(frozen=True, slots=True)
class _Grid:
    corner_m: complex
    cell_m: float
    rows: int
    columns: int

    @staticmethod
    def around(places_m: Places, cell_m: float) -> "_Grid":
        margin_m = REACH_M + MARGIN_CELLS * cell_m
        low = complex(places_m.real.min() - margin_m, places_m.imag.min() - margin_m)
        size = complex(places_m.real.max() + margin_m, places_m.imag.max() + margin_m) - low
        if size.real * size.imag > LARGEST_M2:
            raise ValueError(
                f"the map is {size.real:.0f} x {size.imag:.0f} m: more than {LARGEST_M2:.0f} m2 is too large"
            )
        return _Grid(low, cell_m, int(np.ceil(size.imag / cell_m)), int(np.ceil(size.real / cell_m)))

    def filled(self, lines: WallPoints, numbers: npt.NDArray[np.int64]) -> tuple[Numbers, npt.NDArray[np.float32]]:
        """Return for each cell the number of the nearest of some points, -1 without one, and its distance."""
        there = (lines.places_m[numbers] - self.corner_m) / self.cell_m
        nearest = np.full(self.rows * self.columns, -1, dtype=np.int32)
        best = np.full(self.rows * self.columns, np.inf, dtype=np.float32)
        column, row = there.real.astype(np.int64), there.imag.astype(np.int64)
        for right, up in _offsets(int(REACH_M / self.cell_m)):
            cell = (row + up) * self.columns + column + right
            off = column + right + 0.5 + 1j * (row + up + 0.5) - there
            distance = np.abs(off).astype(np.float32)
            nearer = np.flatnonzero(distance < best[cell])
            order = nearer[np.argsort(-distance[nearer], kind="stable")]  # of two points in a cell the nearer one stays
            best[cell[order]], nearest[cell[order]] = distance[order], numbers[order]
        return nearest, best

    def opposite(self, lines: WallPoints, near: Numbers, normals: Places) -> Numbers:
        """Return for each cell the nearest line that faces away from its nearest one, -1 without one."""
        far = np.full(near.size, -1, dtype=np.int32)
        away = np.full(near.size, np.inf, dtype=np.float32)
        for turn in np.exp(1j * np.pi * np.arange(4) / 2):
            facing = np.flatnonzero((lines.normals * turn.conjugate()).real > np.cos(np.pi / 4) - 1e-9)
            if not facing.size:
                continue
            number, distance = self.filled(lines, facing)
            better = (number >= 0) & (distance < away) & ((normals[number] * normals[near].conj()).real < -0.1)
            far[better], away[better] = number[better], distance[better]
        return far

    def free_of(self, cells: MapCells) -> Booleans:
        """Return which cells of the grid a map says are free."""
        column, row = np.meshgrid(np.arange(self.columns) + 0.5, np.arange(self.rows) + 0.5)
        middles = (self.corner_m + self.cell_m * (column + 1j * row)).ravel()
        there = (middles - cells.corner_m) * np.conj(cells.turn) / cells.cell_m
        column, row = np.floor(there.real).astype(np.int64), np.floor(there.imag).astype(np.int64)
        rows, columns = cells.free.shape
        inside = (column >= 0) & (row >= 0) & (column < columns) & (row < rows)
        free = np.zeros(middles.size, dtype=np.bool_)
        free[inside] = cells.free[row[inside], column[inside]]
        return free


def _offsets(reach: int) -> list[tuple[int, int]]:
    """Return the cells within a reach of one, the nearest first."""
    span = range(-reach, reach + 1)
    inside = [(x, y) for x in span for y in span if x * x + y * y <= reach * reach]
    return sorted(inside, key=lambda off: off[0] ** 2 + off[1] ** 2)
