"""Walls as the solid cells of a map: exact ray casts to the cells' edges, exact distances to the car's outline.

Marching along a distance transform, the usual way, stops somewhere within a cell of the wall and reads about half a
cell (25 mm) too near or too far. Here every beam ends exactly on the edge of the first solid cell, in one of two ways
that agree to rounding: the compiled `casting.c` where available, else `FreeRectangles`.
"""

import math
from itertools import product

import numpy as np
import numpy.typing as npt

from wallride.drivers.accelerated import accelerable
from wallride.sim.world import compiled
from wallride.sim.world.free_rectangles import FreeRectangles
from wallride.sim.world.pose import Booleans, Floats, Footprint, Pose, into_frame

Cells = npt.NDArray[np.int64]

_ALONG_GRID = 1e-12
"""Directions this close to a grid line count as along it; the inverse of less, or of -0.0, is the wrong infinity."""
_MAX_COMPILED = 2**31
"""Maximum number of cells of the compiled cast, which counts in 32 bits."""


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
        self._rectangles = FreeRectangles(padded)
        self._edge_xy_m = self._edge_cells_m()
        self._by_c = compiled.by_c(cast_cells) if self._rectangles.leaps.size < _MAX_COMPILED else None
        self._compiled = compiled.cells(self._rectangles, self.origin, self.cell_m)

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
        """Return whether a world point lies in a free cell."""
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
        if self._by_c is not None:
            return compiled.cast(self._by_c, self._compiled, x_m, y_m, bearing_rad)
        return self.march(x_m, y_m, bearing_rad)

    def march(self, x_m: float | Floats, y_m: float | Floats, bearing_rad: Floats) -> Floats:
        """Return the same as `cast`, always by `FreeRectangles`: the same bits on every machine."""
        return cast_cells(self._rectangles, self.origin, self.cell_m, x_m, y_m, bearing_rad)

    def clearance(self, pose: Pose, footprint: Footprint) -> float:
        """Return the distance between the car's outline and the nearest solid cell, 0 in contact."""
        if not self.is_free(pose.x_m, pose.y_m):
            return 0.0
        x, y = self._edge_xy_m
        far2 = (x - pose.x_m) ** 2 + (y - pose.y_m) ** 2
        near = far2 <= (math.sqrt(far2.min()) + footprint.reach_m + 2 * self.cell_m) ** 2
        return _cells_to_rectangle(x[near], y[near], self.cell_m / 2, self.origin.yaw_rad, pose, footprint)

    def mirrored(self) -> "GridGeometry":
        """Return the same map with y negated."""
        inner = self.solid[1:-1, 1:-1]
        far_corner = self.origin.ahead(self.cell_m, (inner.shape[0] + 1) * self.cell_m)
        return GridGeometry(inner[::-1], self.cell_m, far_corner.mirrored())

    def _edge_cells_m(self) -> Floats:
        """Return the world centres of the solid cells beside a free one, shape (2, k): all that a car can touch."""
        solid = self.solid
        beside_free = np.zeros_like(solid)
        for rows, columns in product((-1, 0, 1), repeat=2):
            beside_free |= ~np.roll(solid, (rows, columns), axis=(0, 1))
        row, column = np.nonzero(solid & beside_free)
        x, y = self._to_world(
            (column.astype(np.float64) + 0.5) * self.cell_m, (row.astype(np.float64) + 0.5) * self.cell_m
        )
        return np.stack([x, y])

    def _to_world(self, along_m: Floats, across_m: Floats) -> tuple[Floats, Floats]:
        cos, sin = math.cos(self.origin.yaw_rad), math.sin(self.origin.yaw_rad)
        return self.origin.x_m + cos * along_m - sin * across_m, self.origin.y_m + sin * along_m + cos * across_m


@accelerable
def cast_cells(
    rectangles: FreeRectangles,
    origin: Pose,
    cell_m: float,
    x_m: float | Floats,
    y_m: float | Floats,
    bearing_rad: Floats,
) -> Floats:
    """Return the distances to the first solid cell, see `GridGeometry.cast`; `casting.c` fills them in."""
    ox, oy = np.broadcast_to(x_m, bearing_rad.shape), np.broadcast_to(y_m, bearing_rad.shape)
    along, across = into_frame(origin, ox, oy)
    heading = bearing_rad - origin.yaw_rad
    dx, dy = (np.where(np.abs(part) < _ALONG_GRID, 0.0, part) for part in (np.cos(heading), np.sin(heading)))
    return rectangles.march(along / cell_m, across / cell_m, dx, dy) * cell_m


def _runs(marks: Booleans) -> Cells:
    """Return (row, first, end) of every run of True along the rows, shape (k, 3)."""
    steps = np.diff(np.pad(marks.astype(np.int8), ((0, 0), (1, 1))), axis=1)
    row, first = np.nonzero(steps == 1)
    end = np.nonzero(steps == -1)[1]
    return np.column_stack([row, first, end])


def _cells_to_rectangle(
    x_m: Floats, y_m: Floats, half_m: float, cell_yaw_rad: float, pose: Pose, footprint: Footprint
) -> float:
    """Return the minimum distance of square cells to the car's outline: at a corner of one or the other, or 0."""
    cell_corners = [Pose(0.0, 0.0, cell_yaw_rad).ahead(i * half_m, j * half_m) for i, j in product((-1, 1), repeat=2)]
    x = np.stack([x_m + corner.x_m for corner in cell_corners])
    y = np.stack([y_m + corner.y_m for corner in cell_corners])
    by_cells = footprint.distance_to(*into_frame(pose, x, y)).min()
    car_corners = [pose.ahead(forward, left) for forward, left in footprint.corners()]
    cos, sin = math.cos(cell_yaw_rad), math.sin(cell_yaw_rad)
    dx, dy = np.stack([x_m - at.x_m for at in car_corners]), np.stack([y_m - at.y_m for at in car_corners])
    outside_x = np.maximum(np.abs(cos * dx + sin * dy) - half_m, 0.0)
    outside_y = np.maximum(np.abs(cos * dy - sin * dx) - half_m, 0.0)
    return float(min(by_cells, np.hypot(outside_x, outside_y).min()))
