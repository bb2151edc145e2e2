"""Points on the walls of a map, with the sides they are seen from."""

from dataclasses import dataclass
from typing import Final

import numpy as np
import numpy.typing as npt

from wallride.runtime.control.perception.geometry import Booleans, Floats, Places

Indices = npt.NDArray[np.int64]

REACH_CELLS: Final = 3
"""A line goes through the points up to so many cells away."""
WIDTH_M: Final = 0.08
"""Standard deviation of the weights of these points by their distance."""
AGREES: Final = 0.5
"""Least cosine between two normals of one wall; across a corner there is none."""
ROUND_M2: Final = 0.0004
"""Variance across a line above which its points are no line: they keep their own normal."""
QUARTERS: Final = 4
ROUNDS: Final = 2


@dataclass(frozen=True, slots=True, eq=False)
class WallPoints:
    """Points of walls in the map's frame as complex numbers (n,), and unit normals toward where they are seen from."""

    places_m: Places
    normals: Places


@dataclass(frozen=True, slots=True, eq=False)
class MapCells:
    """Cells of a map, (rows, columns), row 0 lowest in y; what is neither is unknown.

    corner_m: map position of the corner of cell (0, 0); turn: unit vector of the cells' rows in the map's frame.
    """

    wall: Booleans
    free: Booleans
    cell_m: float
    corner_m: complex
    turn: complex = 1.0 + 0.0j


@dataclass(frozen=True, slots=True, eq=False)
class MapGrid:
    """The cells of a map as its file has them, for drawings: 0 free, 100 a wall, -1 unknown; else as `MapCells`."""

    values: npt.NDArray[np.int8]
    cell_m: float
    corner_m: complex
    turn: complex = 1.0 + 0.0j


def points_of_cells(cells: MapCells) -> WallPoints:
    """Return the middles of all edges between a wall's cell and a free one."""
    places, normals = [], []
    for rows, columns in ((0, 1), (0, -1), (1, 0), (-1, 0)):
        beside_free = np.zeros_like(cells.wall)
        beside_free[_part(-rows), _part(-columns)] = cells.free[_part(rows), _part(columns)]
        row, column = np.nonzero(cells.wall & beside_free)
        normal = complex(columns, rows)
        places.append(column + 0.5 + 1j * (row + 0.5) + 0.5 * normal)
        normals.append(np.full(row.size, normal))
    there: Places = cells.corner_m + cells.turn * cells.cell_m * np.concatenate(places)
    return WallPoints(there, np.concatenate(normals) * cells.turn)


def lines_through(points: WallPoints, cell_m: float) -> WallPoints:
    """Return one point for each cell of a wall and quarter of directions, on the line through its neighbours.

    The line through a point and its neighbours that face the same way takes out the noise of points and the steps of
    cells: in the first round those of one direction, in the second all, which then face the same way.
    """
    table, places, lines, count = _merged(points, cell_m)
    beside = list(_neighbours(table, *places))
    for _ in range(ROUNDS):
        lines = _fitted(lines, beside, count)
    return lines


def _fitted(points: WallPoints, beside: list[Indices], count: Floats) -> WallPoints:
    places, normals = points.places_m, points.normals
    weight, mean = np.zeros(places.size), np.zeros(places.size, np.complex128)
    square, faced = np.zeros(places.size), np.zeros(places.size, np.complex128)
    turned = np.zeros(places.size, np.complex128)
    for index in beside:
        there = np.maximum(index, 0)
        off = places[there] - places
        share = count[there] * np.exp(-0.5 * (off.real**2 + off.imag**2) / WIDTH_M**2)
        share[(index < 0) | ((normals[there] * normals.conj()).real < AGREES)] = 0.0
        weight += share
        mean += share * off
        square += share * (off.real**2 + off.imag**2)
        turned += share * off * off
        faced += share * normals[there]
    mean, square, turned = mean / weight, square / weight, turned / weight
    turned, square = turned - mean * mean, square - np.abs(mean) ** 2  # now about the middle
    across_m2 = np.maximum(0.0, (square - np.abs(turned)) / 2.0)
    normal = 1j * np.sqrt(turned)
    normal = np.where((normal * faced.conj()).real < 0.0, -normal, normal)
    straight = (across_m2 < ROUND_M2) & (across_m2 < 0.25 * (square - across_m2))
    normal = np.where(straight, normal, faced)
    normal = normal / np.maximum(np.abs(normal), 1e-12)
    off_m = (normal.conj() * mean).real
    return WallPoints(places + off_m * normal, normal)


def _merged(points: WallPoints, cell_m: float) -> tuple[Indices, tuple[Indices, Indices, Indices], WallPoints, Floats]:
    """Return a table (rows, columns, quarters) of means by cell and side, their places in it, the means, and counts."""
    quarters = np.floor(np.angle(points.normals * np.exp(0.25j * np.pi)) / (np.pi / 2)).astype(np.int64) % QUARTERS
    low = complex(points.places_m.real.min(), points.places_m.imag.min())
    columns, rows = (
        REACH_CELLS + np.floor(part / cell_m).astype(np.int64)
        for part in ((points.places_m - low).real, (points.places_m - low).imag)
    )
    shape = (int(rows.max()) + REACH_CELLS + 1, int(columns.max()) + REACH_CELLS + 1, QUARTERS)
    keys, index = np.unique(np.ravel_multi_index((rows, columns, quarters), shape), return_inverse=True)
    count = np.bincount(index)
    places, normals = (
        np.bincount(index, part.real) / count + 1j * np.bincount(index, part.imag) / count
        for part in (points.places_m, points.normals)
    )
    table = np.full(shape, -1, dtype=np.int64)
    table.ravel()[keys] = np.arange(keys.size)
    row, column, quarter = np.unravel_index(keys, shape)
    lengths = np.maximum(np.abs(normals), 1e-12)
    merged = WallPoints(places, np.asarray(normals / lengths, np.complex128))
    there = row.astype(np.int64), column.astype(np.int64), quarter.astype(np.int64)
    return table, there, merged, count.astype(np.float64)


def _neighbours(table: Indices, rows: Indices, columns: Indices, quarters: Indices) -> list[Indices]:
    """Return the points in the cells around each one that face about as it does, (n,) each, -1 for none."""
    reach = range(-REACH_CELLS, REACH_CELLS + 1)
    beside = [(row, column) for row in reach for column in reach if row**2 + column**2 <= (REACH_CELLS + 0.5) ** 2]
    return [
        table[rows + row, columns + column, (quarters + turn) % QUARTERS]
        for row, column in beside
        for turn in (-1, 0, 1)
    ]


def _part(shift: int) -> slice:
    return slice(max(0, shift), None if shift >= 0 else shift)
