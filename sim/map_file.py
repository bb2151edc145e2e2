"""Maps in the format of ROS (map_server): a .yaml file beside a .pgm or .png image, row 0 at the top.

Only one region of a map is drivable: the largest connected one of cells that are surely free. All else is solid:
walls, unknown cells, what lies outside, rooms that cannot be reached. Published maps disagree about the colour of
"outside" (black, 205 grey, and in levine.png a 216 that passes for free under its own free_thresh), so a cell is
surely free only below an occupancy of 0.1, whatever looser free_thresh the file gives.
"""

import math
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from sim.grid import GridGeometry
from sim.pose import Booleans, Floats, Pose, Side, side_sign
from sim.world import START_DISTANCE_M, World

SURELY_FREE_BELOW = 0.1
"""Highest occupancy of a drivable cell; antialiased edges and the 205 of "unknown" (0.196) lie above it."""

_START_CANDIDATES = 300
_LOOK_AHEAD_M = 8.0


@dataclass(frozen=True, slots=True)
class MapSettings:
    """What a map's .yaml file says. origin: world pose of the image's lower left corner."""

    image: Path
    cell_m: float
    origin: Pose
    negate: bool
    free_thresh: float


def load_map(path: Path, *, side: Side = "left") -> World:
    """Return the world of a map file; the start is chosen by `choose_start`, with the followed wall on `side`.

    Raises:
        FileNotFoundError: the .yaml file or its image is not there.
        ValueError: something in them makes no sense; the message says what and where.
    """
    settings = read_settings(path)
    free = drivable(read_occupancy(settings), min(settings.free_thresh, SURELY_FREE_BELOW))
    if not free.any():
        raise ValueError(f"{settings.image}: no free cell in the map; is `negate` in {path} right?")
    rows, columns = np.flatnonzero(free.any(axis=1)), np.flatnonzero(free.any(axis=0))
    inner = free[rows[0] : rows[-1] + 1, columns[0] : columns[-1] + 1]
    corner = settings.origin.ahead(float(columns[0]) * settings.cell_m, float(rows[0]) * settings.cell_m)
    geometry = GridGeometry(~inner, settings.cell_m, corner)
    text = f"Map {path.name}: {inner.sum() * settings.cell_m**2:.0f} m2 drivable, cells of {settings.cell_m:.4g} m."
    return World(path.stem, geometry, choose_start(geometry, side), side, description=text)


def read_settings(path: Path) -> MapSettings:
    """Read and check the .yaml file."""
    from ruamel.yaml import YAML
    from ruamel.yaml.error import YAMLError

    if not path.is_file():
        raise FileNotFoundError(f"no map file {path}; give the path of a map's .yaml file")
    try:
        content: Any = YAML(typ="safe", pure=True).load(path)
        image, cell_m = path.parent / str(content["image"]), float(content["resolution"])
        x_m, y_m, yaw_rad = (float(value) for value in content["origin"])
        negate, free_thresh = bool(int(content.get("negate", 0))), float(content.get("free_thresh", 0.196))
    except (YAMLError, KeyError, TypeError, ValueError) as error:
        raise ValueError(
            f"{path}: not a map file ({error}); it needs image, resolution and origin: [x, y, yaw]"
        ) from error
    if not (math.isfinite(cell_m) and cell_m > 0 and all(map(math.isfinite, (x_m, y_m, yaw_rad)))):
        raise ValueError(
            f"{path}: resolution must be above 0 and origin finite, not {cell_m} and {(x_m, y_m, yaw_rad)}"
        )
    return MapSettings(image, cell_m, Pose(x_m, y_m, yaw_rad), negate, free_thresh)


def read_occupancy(settings: MapSettings) -> Floats:
    """Return the occupancy of each cell, 0 free to 1 occupied, shape (rows, columns), row 0 lowest in y."""
    from PIL import Image, UnidentifiedImageError

    if not settings.image.is_file():
        raise FileNotFoundError(f"the map's image {settings.image} is missing; `image` in the .yaml file names it")
    try:
        with Image.open(settings.image) as picture:
            flat = picture.convert("RGB") if picture.mode in {"P", "1", "RGBA", "LA", "CMYK"} else picture
            pixels = np.asarray(flat)
    except (UnidentifiedImageError, OSError) as error:
        raise ValueError(f"{settings.image}: not an image that can be read ({error})") from error
    full_scale = 255.0 if pixels.dtype == np.uint8 else 65535.0
    grey = pixels.astype(np.float64)[::-1] / full_scale
    grey = grey.mean(axis=2) if grey.ndim > 2 else grey
    return grey if settings.negate else 1.0 - grey


def drivable(occupancy: Floats, free_below: float) -> Booleans:
    """Return the largest region of cells under `free_below` that hang together by their edges; same shape."""
    from scipy import ndimage

    regions, count = ndimage.label(occupancy < free_below)
    if count == 0:
        return np.zeros(occupancy.shape, dtype=np.bool_)
    sizes = np.bincount(regions.ravel())[1:]
    largest: Booleans = regions == 1 + int(np.argmax(sizes))
    return largest


def choose_start(geometry: GridGeometry, side: Side) -> Pose:
    """Choose a place about 1 m from a wall (as far as a narrower map allows), parallel to it, with a free way ahead.

    Of 300 cells spread over those at that distance, the one with the longest straight way ahead and behind wins
    (8 m are enough), less what the wall's distance changes within 1 m. The same map gives the same start
    on every machine: many places look alike to the last bit, so it is numpy's beams that choose, never compiled ones.
    """
    from scipy import ndimage

    away_m = ndimage.distance_transform_edt(~geometry.solid) * geometry.cell_m
    wanted_m = min(START_DISTANCE_M, float(away_m.max()) - geometry.cell_m)
    row, column = np.nonzero(np.abs(away_m - wanted_m) <= geometry.cell_m)
    spread = np.unique(np.linspace(0, len(row) - 1, _START_CANDIDATES).astype(np.int64))
    poses = [
        _along_the_wall(geometry, geometry.cell_centre(int(row[index]), int(column[index])), side) for index in spread
    ]
    return max(poses, key=lambda pose: _worth(geometry, pose, side))


def _along_the_wall(geometry: GridGeometry, at: tuple[float, float], side: Side) -> Pose:
    """The pose at a point that has the nearest wall square to one side."""
    bearings = np.linspace(-math.pi, math.pi, 180, endpoint=False)
    ranges_m = geometry.march(*at, bearings)
    points = np.column_stack([ranges_m * np.cos(bearings), ranges_m * np.sin(bearings)])
    aside = np.cos(bearings - bearings[np.argmin(ranges_m)]) > 0.5
    near = points[aside & (ranges_m <= 1.3 * ranges_m.min())]  # a patch about 1.6 times as long as it is far
    _, _, axes = np.linalg.svd(near - near.mean(axis=0))
    yaw_rad = math.atan2(axes[0, 1], axes[0, 0])
    centre = near.mean(axis=0)
    wall_is_left = -math.sin(yaw_rad) * centre[0] + math.cos(yaw_rad) * centre[1] > 0
    facing = yaw_rad if wall_is_left == (side == "left") else yaw_rad + math.pi
    return Pose(*at, math.remainder(facing, math.tau))


def _worth(geometry: GridGeometry, pose: Pose, side: Side) -> float:
    """Metres of free way, less a penalty for a wall that is not where it should be."""
    sides = pose.yaw_rad + side_sign(side) * np.radians(np.linspace(60.0, 120.0, 25))
    ways = pose.yaw_rad + np.radians([-4.0, 0.0, 4.0, 176.0, 180.0, 184.0])
    ranges_m = geometry.march(pose.x_m, pose.y_m, ways)
    ahead_m, behind_m = min(_LOOK_AHEAD_M, ranges_m[:3].min()), min(1.0, ranges_m[3:].min())
    places = [pose.ahead(forward_m) for forward_m in (-0.5, 0.0, 0.5, 1.0)]
    walls_m = [float(geometry.march(at.x_m, at.y_m, sides).min()) for at in places]
    return float(ahead_m + behind_m - 10.0 * (max(walls_m) - min(walls_m)) - 5.0 * abs(walls_m[1] - START_DISTANCE_M))
