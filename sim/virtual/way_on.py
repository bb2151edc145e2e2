"""Reachability search over poses: whether a car of this outline and turning circle has a way on from its place.

Ground truth for the lab, with the whole world known; it does not run on a car. Poses (x, y, heading) lie on a
lattice; from each one the car goes a step forward or backward, straight on or as sharply as it can, and every pose on
the way must be free, margin included. The place within a lattice cell is kept (Dolgov et al. 2008, "hybrid A*"), so an
arc stays an arc. All poses that can be reached by the same number of steps are taken at once: a breadth-first flood.

A way on: the car gets at least `away_m` from where it stands, and comes there forward. That is on along the wall
beyond what blocks it, or back out and away; a car that has driven in can, as a rule, get out.
"""

import math
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from wallride.sim.world.pose import CAR, Booleans, Floats, Pose
from wallride.sim.world.segments import SegmentGeometry

Whole = npt.NDArray[np.int64]

CELL_M = 0.04
HEADINGS = 64
STEP_M = 0.12
"""Step length: longer than a cell is wide, and turns by more than a heading is wide: each step leaves its cell."""
TIGHTEST_PER_M = math.tan(0.34) / 0.33
MARGIN_M = 0.02
"""Margin that the car keeps on all sides; less where it stands nearer already."""
AWAY_M = 3.0
FORWARD_STEPS = 8
"""Number of consecutive forward steps, about a metre, that end the way: driven off, not backed into a corner."""
MAX_STEPS = 400

_CURVATURES_PER_M = (-TIGHTEST_PER_M, 0.0, TIGHTEST_PER_M)


@dataclass(frozen=True, slots=True)
class WayOn:
    """Result of the search. exists: whether there is a way. length_m: of the one with the fewest steps, NaN without."""

    exists: bool
    length_m: float


@dataclass(slots=True, eq=False)
class _Lattice:
    """Lattice. free: (HEADINGS, n, n), whether the car may be there. at: the pose in the middle of the lattice."""

    free: Booleans
    at: Pose

    def index(self, x_m: Floats, y_m: Floats, yaw_rad: Floats) -> Whole:
        """Return the flat index of poses (k,), -1 outside."""
        size = self.free.shape[1]
        column = np.rint((x_m - self.at.x_m) / CELL_M).astype(np.int64) + size // 2
        row = np.rint((y_m - self.at.y_m) / CELL_M).astype(np.int64) + size // 2
        heading = np.rint(yaw_rad * (HEADINGS / math.tau)).astype(np.int64) % HEADINGS
        inside = (column >= 0) & (column < size) & (row >= 0) & (row < size)
        return np.where(inside, (heading * size + row) * size + column, -1)


def way_on(geometry: SegmentGeometry, at: Pose, away_m: float = AWAY_M) -> WayOn:
    """Return whether a car that stands at a pose has a way on among these walls."""
    clearance_m = geometry.clearance(at, CAR)
    lattice = _lattice(geometry, at, away_m + 1.0, min(MARGIN_M, max(0.0, clearance_m - CELL_M)))
    free = lattice.free.reshape(-1)
    layers = FORWARD_STEPS + 1
    seen = np.zeros(free.size, np.uint8)
    """Longest forward run, plus one, with which a cell was reached: a longer one is expanded again."""
    x_m, y_m, yaw_rad = (np.array([value]) for value in (at.x_m, at.y_m, at.yaw_rad))
    run = np.zeros(1, np.int64)
    for step in range(1, MAX_STEPS + 1):
        x_m, y_m, yaw_rad, run = _moved(x_m, y_m, yaw_rad, run)
        index = lattice.index(x_m, y_m, yaw_rad)
        good = (index >= 0) & free[index] & (seen[index] <= run)
        index, x_m, y_m, yaw_rad, run = index[good], x_m[good], y_m[good], yaw_rad[good], run[good]
        order = np.argsort(-run, kind="stable")
        _, first = np.unique(index[order], return_index=True)
        kept = order[first]
        index, x_m, y_m, yaw_rad, run = index[kept], x_m[kept], y_m[kept], yaw_rad[kept], run[kept]
        seen[index] = run + 1
        if not index.size:
            break
        done = (run >= layers - 1) & (np.hypot(x_m - at.x_m, y_m - at.y_m) >= away_m)
        if done.any():
            return WayOn(exists=True, length_m=step * STEP_M)
    return WayOn(exists=False, length_m=math.nan)


def _moved(x_m: Floats, y_m: Floats, yaw_rad: Floats, run: Whole) -> tuple[Floats, Floats, Floats, Whole]:
    """Return all poses one step on: forward and backward, on three curvatures."""
    moved = []
    for way_m in (STEP_M, -STEP_M):
        for curvature in _CURVATURES_PER_M:
            turn_rad = way_m * curvature
            chord_m = way_m * np.sinc(turn_rad / math.tau)
            middle_rad = yaw_rad + turn_rad / 2
            on = np.minimum(run + 1, FORWARD_STEPS) if way_m > 0 else np.zeros_like(run)
            moved.append(
                (x_m + chord_m * np.cos(middle_rad), y_m + chord_m * np.sin(middle_rad), yaw_rad + turn_rad, on)
            )
    x, y, yaw, runs = (np.concatenate(parts) for parts in zip(*moved, strict=True))
    return x, y, yaw, runs


def _lattice(geometry: SegmentGeometry, at: Pose, reach_m: float, margin_m: float) -> _Lattice:
    """Return the car's free poses for every heading: outside the walls' cells grown by the car's outline."""
    half = math.ceil(reach_m / CELL_M)
    size = 2 * half + 1
    walls = _wall_cells(geometry, at, half)
    grid = np.zeros((size, size))
    grid[walls[:, 1] + half, walls[:, 0] + half] = 1.0
    padded = size + 2 * math.ceil((CAR.reach_m + margin_m) / CELL_M) + 2
    spectrum = np.fft.rfft2(grid, (padded, padded))
    free = np.empty((HEADINGS, size, size), np.bool_)
    for heading in range(HEADINGS):
        outline = _outline_cells(heading * math.tau / HEADINGS, margin_m)
        kernel = np.zeros((padded, padded))
        kernel[-outline[:, 1] % padded, -outline[:, 0] % padded] = 1.0
        free[heading] = np.fft.irfft2(spectrum * np.fft.rfft2(kernel), (padded, padded))[:size, :size] < 0.5
    return _Lattice(free, at)


def _wall_cells(geometry: SegmentGeometry, at: Pose, half: int) -> Whole:
    """Return the cells, (k, 2) columns and rows from the middle, that walls pass through."""
    outline = geometry.outline_m
    cells = []
    for x0, y0, x1, y1 in outline:
        steps = max(2, math.ceil(math.hypot(x1 - x0, y1 - y0) / (CELL_M / 2)) + 1)
        cells.append(np.column_stack([np.linspace(x0, x1, steps) - at.x_m, np.linspace(y0, y1, steps) - at.y_m]))
    found = np.unique(np.rint(np.concatenate(cells) / CELL_M).astype(np.int64), axis=0)
    inside: Whole = found[(np.abs(found) <= half).all(axis=1)]
    return inside


def _outline_cells(yaw_rad: float, margin_m: float) -> Whole:
    """Return the cells, (k, 2) columns and rows, whose middle the car at that heading covers, margin included."""
    half = math.ceil((CAR.reach_m + margin_m) / CELL_M) + 1
    columns, rows = np.meshgrid(np.arange(-half, half + 1), np.arange(-half, half + 1))
    x_m, y_m = columns * CELL_M, rows * CELL_M
    ahead_m = math.cos(yaw_rad) * x_m + math.sin(yaw_rad) * y_m
    aside_m = math.cos(yaw_rad) * y_m - math.sin(yaw_rad) * x_m
    covered = CAR.distance_to(ahead_m, aside_m) <= margin_m
    return np.column_stack([columns[covered], rows[covered]])
