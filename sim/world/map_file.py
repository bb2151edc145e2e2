"""Maps in the ROS format (map_server): a .yaml file beside a .pgm or .png image, row 0 at the top.

Only one region of a map is drivable: the largest connected one of cells that are surely free. All else is solid:
walls, unknown cells, what lies outside, rooms that cannot be reached. Published maps disagree about the colour of
"outside" (black, 205 grey, and in levine.png a 216 that counts as free under its own free_thresh), so a cell is
surely free only below an occupancy of 0.1, whatever looser free_thresh the file gives.
"""

import logging
import math
import re
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from wallride.runtime.ros.yaml_file import YamlFileError, mappings, read_yaml
from wallride.sim.world.grid import GridGeometry
from wallride.sim.world.map_start import choose_start
from wallride.sim.world.place import World
from wallride.sim.world.pose import Booleans, Floats, Pose, Side

log = logging.getLogger("wallride.map")

SURELY_FREE_BELOW = 0.1
"""Highest occupancy of a drivable cell; antialiased edges and the 205 of "unknown" (0.196) lie above it."""

PAPER_EDGES = 3
MAX_CELLS = 32_000_000
"""Largest map: 280 m square in cells of 5 cm; a small file may claim any size."""
CELL_M = (0.001, 10.0)
"""Smallest and largest cell of a map that a car drives in."""
RAW_FULL = 100.0
"""Value of an occupied cell in the mode "raw"; 0 is free, more than 100 unknown."""


@dataclass(frozen=True, slots=True)
class MapSettings:
    """Content of a map's .yaml file. origin: world pose of the image's lower left corner.

    is_raw: the image holds percentages of occupancy (mode: raw), not shades.
    """

    image: Path
    cell_m: float
    origin: Pose
    negate: bool
    free_thresh: float
    is_raw: bool = False


def load_map(path: Path, *, side: Side = "left") -> World:
    """Return the world of a map file; the start is chosen by `choose_start`, with the followed wall on `side`.

    Raises:
        FileNotFoundError: the .yaml file or its image is not there.
        ValueError: their content is invalid; the message names the fault and its place.
    """
    geometry, inner_m2 = read_geometry(path)
    text = f"Map {path.name}: {inner_m2:.0f} m2 drivable, cells of {geometry.cell_m:.4g} m."
    start, room_m = choose_start(geometry, side)
    return World(path.stem, geometry, start, side, description=text, room_m=room_m)


def read_geometry(path: Path) -> tuple[GridGeometry, float]:
    """Return the walls of a map file, and its drivable area [m2]; raises as `load_map` does."""
    settings = read_settings(path)
    free = drivable(read_occupancy(settings), min(settings.free_thresh, SURELY_FREE_BELOW))
    if not free.any():
        raise ValueError(f"{settings.image}: no free cell in the map; is `negate` in {path} right?")
    rows, columns = np.flatnonzero(free.any(axis=1)), np.flatnonzero(free.any(axis=0))
    inner = free[rows[0] : rows[-1] + 1, columns[0] : columns[-1] + 1]
    corner = settings.origin.ahead(float(columns[0]) * settings.cell_m, float(rows[0]) * settings.cell_m)
    return GridGeometry(~inner, settings.cell_m, corner), float(inner.sum()) * settings.cell_m**2


def read_settings(path: Path) -> MapSettings:
    """Read and check the .yaml file."""
    if not path.is_file():
        raise FileNotFoundError(f"no map file {path}; give the path of a map's .yaml file")
    try:
        content: Any = next(mappings(read_yaml(path)), {})
        image, cell_m = _image_of(path, str(content["image"])), float(content["resolution"])
        x_m, y_m, yaw_rad = (float(value) for value in content["origin"])
        negate, free_thresh = bool(int(content.get("negate", 0))), float(content.get("free_thresh", 0.196))
        occupied_thresh = float(content.get("occupied_thresh", 1.0))
    except YamlFileError:
        raise
    except (KeyError, TypeError, ValueError, OverflowError) as error:
        raise ValueError(
            f"{path}: not a map file; it needs an image, a resolution in m, and an origin of three numbers: [x, y, yaw]"
        ) from error
    if not (CELL_M[0] <= cell_m <= CELL_M[1] and all(map(math.isfinite, (x_m, y_m, yaw_rad)))):
        raise ValueError(
            f"{path}: resolution must be {CELL_M[0]:g} to {CELL_M[1]:g} m and origin finite, not {cell_m} and"
            f" {(x_m, y_m, yaw_rad)}"
        )
    if occupied_thresh < free_thresh:
        raise ValueError(f"{path}: occupied_thresh, {occupied_thresh:g}, is below free_thresh, {free_thresh:g}")
    is_raw = str(content.get("mode", "")).lower() == "raw"
    return MapSettings(image, cell_m, Pose(x_m, y_m, yaw_rad), negate, free_thresh, is_raw)


def _image_of(path: Path, name: str) -> Path:
    """Return the image that the .yaml file names, or, where another computer's path is meant, the one beside it."""
    image = path.parent / Path(name).expanduser()
    beside = path.parent / re.split(r"[/\\]", name)[-1]
    if image.is_file() or not beside.is_file():
        return image
    log.warning("%s: there is no image %s: the one beside it is taken, %s", path, name, beside.name)
    return beside


def read_occupancy(settings: MapSettings) -> Floats:
    """Return the occupancy of each cell, 0 free to 1 occupied, shape (rows, columns), row 0 lowest in y."""
    from PIL import Image, UnidentifiedImageError

    if not settings.image.is_file():
        raise FileNotFoundError(f"the map's image {settings.image} is missing; `image` in the .yaml file names it")
    try:
        with Image.open(settings.image) as picture:
            _check_size(*picture.size)
            flat = picture.convert("RGB") if picture.mode in {"P", "1", "RGBA", "LA", "CMYK"} else picture
            pixels = np.asarray(flat)
    except (UnidentifiedImageError, Image.DecompressionBombError, OSError, ValueError, SyntaxError) as error:
        raise ValueError(f"{settings.image}: not an image that can be read ({error})") from error
    shades: Floats = pixels.astype(np.float64)[::-1]
    shades = shades.mean(axis=2) if shades.ndim > 2 else shades
    if settings.is_raw:
        return np.where(shades > RAW_FULL, 1.0, shades / RAW_FULL)
    grey = shades / (255.0 if pixels.dtype == np.uint8 else 65535.0)
    return grey if settings.negate else 1.0 - grey


def _check_size(columns: int, rows: int) -> None:
    if columns * rows > MAX_CELLS:
        raise ValueError(f"{columns} x {rows} cells are more than {MAX_CELLS / 1e6:.0f} million")


def drivable(occupancy: Floats, free_below: float) -> Booleans:
    """Return the largest region of edge-connected cells under `free_below`; same shape.

    A region that reaches three or four edges of the image is the paper around the drawing, not a part of the building;
    it counts only where there is no other region.
    """
    from scipy import ndimage

    regions, count = ndimage.label(occupancy < free_below)
    if count == 0:
        return np.zeros(occupancy.shape, dtype=np.bool_)
    sizes = np.bincount(regions.ravel(), minlength=count + 1)[1:]
    edges = (regions[0], regions[-1], regions[:, 0], regions[:, -1])
    reached = sum(np.isin(np.arange(1, count + 1), edge).astype(np.int64) for edge in edges)
    inside = np.where(reached >= PAPER_EDGES, 0, sizes)
    largest: Booleans = regions == 1 + int(np.argmax(inside if inside.any() else sizes))
    return largest


def check_map(path: Path) -> None:
    """Validate a map's files without making a world of them; raises as `load_map` does."""
    read_occupancy(read_settings(path))
