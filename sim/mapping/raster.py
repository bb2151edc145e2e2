"""The grid of a map: which cells were seen through, and at which the beams end."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np

from wallride.runtime.control.localization.wall_points import MapCells
from wallride.sim.mapping.keyframes import Keyframe
from wallride.sim.world.pose import Booleans, Floats

CELL_M: Final = 0.05
BEFORE_M: Final = 0.03
"""A beam says nothing of the last piece before its end."""
WALL_SHARE: Final = 0.25
"""Least share of ends among the beams of a wall's cell: of people that walked by no trace remains."""
MIN_HITS: Final = 2
BEAM_RAD: Final = 0.008
"""Angle between the beams that are drawn, 10 cm at the farthest."""
DRIVEN_M: Final = 0.15
"""Half of the width of the way that the car itself has driven over: free, although a beam straight ahead without an
echo tells nothing of it."""
MARGIN_M: Final = 0.5
AT_ONCE: Final = 16


@dataclass(frozen=True, slots=True, eq=False)
class Raster:
    """Cells of CELL_M, row 0 lowest in y, all (rows, columns); what is neither is unknown.

    corner_m: x and y of the lower left corner.
    """

    corner_m: tuple[float, float]
    wall: Booleans
    free: Booleans


def rasterized(frames: Sequence[Keyframe], poses: Floats, step_rad: float) -> Raster:
    """Return the grid of keyframes with poses (n, 3) of the lidar. step_rad: between two beams."""
    ends = [_ends(frame, pose) for frame, pose in zip(frames, poses, strict=True)]
    low, high = _bounds(np.vstack([*ends, poses[:, :2]]))
    shape = tuple(int(size) for size in np.ceil((high - low) / CELL_M)[::-1])
    hits, misses = np.zeros(shape[0] * shape[1]), np.zeros(shape[0] * shape[1])
    every = max(1, round(BEAM_RAD / abs(step_rad)))
    for first in range(0, len(frames), AT_ONCE):
        part = slice(first, first + AT_ONCE)
        hits += _counted(np.vstack(ends[part]), low, shape)
        rays = [_along(pose[:2], one[::every]) for pose, one in zip(poses[part], ends[part], strict=True)]
        misses += every * _counted(np.vstack(rays), low, shape)
    misses += _counted(_driven_over(poses[:, :2]), low, shape)
    wall = (hits >= MIN_HITS) & (hits > WALL_SHARE * (hits + misses))
    free = (misses > 0) & ~wall
    return Raster((float(low[0]), float(low[1])), wall.reshape(shape), free.reshape(shape))


def cells_of_raster(raster: Raster) -> MapCells:
    """Return the grid as a map to find the pose on."""
    return MapCells(raster.wall, raster.free, CELL_M, complex(*raster.corner_m))


def _ends(frame: Keyframe, pose: Floats) -> Floats:
    """Return where the beams end on the map, (n, 2): on the line through a point and its neighbours, if any."""
    points_m = np.where(frame.surface.usable, frame.surface.points_m, frame.points_m)
    points_m = points_m[:, np.isfinite(points_m[0])]
    cos, sin = np.cos(pose[2]), np.sin(pose[2])
    return (np.array([[cos, -sin], [sin, cos]]) @ points_m).T + pose[:2]


def _driven_over(places_m: Floats) -> Floats:
    """Return points half a cell apart beside the way through places (n, 2), (k, 2)."""
    steps = np.diff(places_m, axis=0, append=places_m[-1:])
    shares = np.arange(0.0, 1.0, 0.1)
    way_m = (places_m[:, None] + shares[:, None] * steps[:, None]).reshape(-1, 2)
    aside = np.arange(-DRIVEN_M, DRIVEN_M + 1e-9, CELL_M / 2)
    across = np.stack(np.meshgrid(aside, aside), axis=-1).reshape(-1, 2)
    points: Floats = (way_m[:, None] + across[np.hypot(*across.T) <= DRIVEN_M]).reshape(-1, 2)
    return points


def _along(from_m: Floats, ends_m: Floats) -> Floats:
    """Return points on beams, a cell apart, from a place to shortly before their ends, (k, 2)."""
    ways = ends_m - from_m
    length_m = np.hypot(ways[:, 0], ways[:, 1])
    counts = np.maximum(0, np.floor((length_m - BEFORE_M) / CELL_M)).astype(np.int64)
    which = np.repeat(np.arange(len(ways)), counts)
    number = np.arange(len(which)) - np.repeat(np.cumsum(counts) - counts, counts)
    points: Floats = from_m + ways[which] * (number * CELL_M / length_m[which])[:, None]
    return points


def _bounds(points_m: Floats) -> tuple[Floats, Floats]:
    low = np.floor((points_m.min(axis=0) - MARGIN_M) / CELL_M) * CELL_M
    return low, points_m.max(axis=0) + MARGIN_M


def _counted(points_m: Floats, low: Floats, shape: tuple[int, ...]) -> Floats:
    cells = ((points_m - low) / CELL_M).astype(np.int64)
    counts = np.bincount(cells[:, 1] * shape[1] + cells[:, 0], minlength=shape[0] * shape[1])
    return counts.astype(np.float64)
