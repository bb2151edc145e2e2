"""Messages of what a car races on, its map and its line: written once, before the drive.

Each fits a link's queue as a whole (`network.MAX_SAMPLE_BYTES`): over a slow link a longer message would be dropped
each time. So a large map has coarser cells, and a long line fewer points.
"""

import cmath
import math
from collections.abc import Mapping
from typing import Final

import numpy as np

from wallride.runtime.control.line_following.course import RaceCourse
from wallride.runtime.control.line_following.race_line import CourseLine
from wallride.runtime.control.localization.wall_points import MapGrid
from wallride.runtime.ros import messages
from wallride.runtime.wire import topics
from wallride.runtime.wire.network import MAX_SAMPLE_BYTES

HEADS_B: Final = 2048
"""Room for a message's head and for those of its pieces on the wire."""
MAX_CELLS: Final = MAX_SAMPLE_BYTES - HEADS_B
POSE_B: Final = 72
MAX_POSES: Final = (MAX_SAMPLE_BYTES - HEADS_B) // POSE_B
SLOWEST_MPS: Final = 0.01


def written(course: RaceCourse, stamp_ns: int) -> Mapping[str, bytes]:
    """Return the messages of `map` and `line`, of those that there are. stamp_ns: since 1970."""
    told: dict[str, bytes] = {}
    if course.grid is not None:
        grid = coarsened(course.grid)
        corner = grid.corner_m.real, grid.corner_m.imag, cmath.phase(grid.turn)
        told[topics.MAP] = messages.occupancy_grid(stamp_ns, grid.values, grid.cell_m, corner)
    if course.line is not None:
        told[topics.LINE] = messages.path(stamp_ns, timed(course.line))
    return told


def coarsened(grid: MapGrid, most: int = MAX_CELLS) -> MapGrid:
    """Return the known part of a map, of cells as many times larger as it takes for at most so many of them.

    A cell is a wall where one of those in it is, else free where one of those is.
    """
    rows, columns = (np.flatnonzero((grid.values >= 0).any(axis=axis)) for axis in (1, 0))
    if not rows.size:
        rows = columns = np.zeros(1, dtype=np.int64)
    known = grid.values[rows[0] : rows[-1] + 1, columns[0] : columns[-1] + 1]
    times = 1
    while math.prod(math.ceil(size / times) for size in known.shape) > most:
        times += 1
    filled = np.pad(known, [(0, -size % times) for size in known.shape], constant_values=-1)
    blocks = filled.reshape(filled.shape[0] // times, times, filled.shape[1] // times, times)
    corner_m = grid.corner_m + grid.turn * grid.cell_m * complex(int(columns[0]), int(rows[0]))
    return MapGrid(blocks.max(axis=(1, 3)), grid.cell_m * times, corner_m, grid.turn)


def timed(line: CourseLine, most: int = MAX_POSES) -> list[tuple[float, float, float, float]]:
    """Return time since the first point [s], x [m], y [m], yaw [rad] of a line's points at its own speeds.

    The first one again ends the lap.
    """
    steps_m = np.abs(np.roll(line.places_m, -1) - line.places_m)
    means_mps = 0.5 * (line.speed_mps + np.roll(line.speed_mps, -1))
    after_s = np.concatenate([[0.0], np.cumsum(steps_m / np.maximum(means_mps, SLOWEST_MPS))])
    count = line.places_m.size
    some = [*range(0, count, math.ceil(count / (most - 1))), count]
    return [
        (float(after_s[number]), place.real, place.imag, float(line.yaw_rad[number % count]))
        for number in some
        for place in [complex(line.places_m[number % count])]
    ]
