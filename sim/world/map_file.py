"""Maps in the ROS format (map_server): a .yaml file beside a .pgm or .png image, row 0 at the top.

Only one region of a map is drivable: the largest connected one of cells that are surely free. All else is solid:
walls, unknown cells, what lies outside, rooms that cannot be reached. Published maps disagree about the colour of
"outside" (black, 205 grey, and in levine.png a 216 that counts as free under its own free_thresh), so a cell is
surely free only below an occupancy of 0.1, whatever looser free_thresh the file gives.
"""

from pathlib import Path

import numpy as np

from wallride.runtime.map_files import SURELY_FREE_BELOW, MapSettings, check_image, read_settings
from wallride.sim.world.grid import GridGeometry
from wallride.sim.world.map_start import choose_start
from wallride.sim.world.place import World
from wallride.sim.world.pose import Booleans, Floats, Pose, Side

PAPER_EDGES = 3
MAX_CELLS = 32_000_000
"""Largest map: 280 m square in cells of 5 cm; a small file may claim any size."""
RAW_FULL = 100.0
"""Value of an occupied cell in the mode "raw"; 0 is free, more than 100 unknown."""


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
    corner = Pose(*settings.origin).ahead(float(columns[0]) * settings.cell_m, float(rows[0]) * settings.cell_m)
    return GridGeometry(~inner, settings.cell_m, corner), float(inner.sum()) * settings.cell_m**2


def read_occupancy(settings: MapSettings) -> Floats:
    """Return the occupancy of each cell, 0 free to 1 occupied, shape (rows, columns), row 0 lowest in y."""
    from PIL import Image, UnidentifiedImageError

    check_image(settings)
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
