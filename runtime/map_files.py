"""The files of a map: ROS's `.yaml` with its image, and beside it the walls as `wallride map` found them.

`NAME.walls.csv` holds a point for each cell and side of a wall with its normal, `x_m; y_m; nx; ny`: a cell of 5 cm
alone does not tell where in it the wall is. Lines of its heading, `# scale: 0.9712` and `# points: 1380`, tell the true
way over the one that the wheels reported, and how many points follow.
"""

import hashlib
import logging
import math
import re
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, Final

import numpy as np

from wallride.runtime.control.localization.line_field import LineField, field_of_cells, line_field
from wallride.runtime.control.localization.wall_points import MapCells, MapGrid, WallPoints
from wallride.runtime.control.perception.geometry import Booleans, Floats
from wallride.runtime.ros.yaml_file import YamlFileError, mappings, read_yaml

log = logging.getLogger("wallride.map")

SURELY_FREE_BELOW: Final = 0.1
"""Highest occupancy of a free cell; antialiased edges and the 205 of "unknown" (0.196) lie above it."""
CELL_M: Final = (0.001, 10.0)
"""Smallest and largest cell of a map that a car drives in."""
ORIGIN_M: Final = 1e7
"""Largest coordinate of a map's corner: UTM has such, and a double is exact to nanometres there."""
FIELD_CELL_M: Final = (0.02, 0.11)
"""Smallest and largest cell of a map on which a pose is found."""
WALLS_SUFFIX: Final = ".walls.csv"
"""Ending of the file with the walls, in place of .yaml."""
ABOUT: Final = "map by wallride of "
"""What a map of `wallride map` says of itself in its first line."""
WALLS_APART_M, WALLS_AGREE = 0.15, 0.75
"""Largest distance between walls and the image's cells, and the least share of each that lies so near the other."""
MAX_BYTES: Final = 64 << 20
MAX_WALL_POINTS: Final = 500_000
FINGERPRINT_DIGITS: Final = 12
SCALES: Final = (0.5, 2.0)
DRIVE_AGAIN: Final = "; drive the lap again"
"""Remedy at the end of the sentence on a refused map."""
LAP_START: Final = (0.0, 0.0, 0.0)
"""Pose at which the lap of a map of `wallride map` began."""


class MapError(ValueError):
    """A map on which no pose can be found; the text names the file, what is wrong and what to do."""


@dataclass(frozen=True, slots=True)
class MapSettings:
    """Content of a map's .yaml file. origin: x [m], y [m], yaw [rad] of the image's lower left corner.

    is_raw: the image holds percentages of occupancy (mode: raw), not shades.
    """

    image: Path
    cell_m: float
    origin: tuple[float, float, float]
    negate: bool
    free_thresh: float
    occupied_thresh: float = 0.65
    is_raw: bool = False


@dataclass(frozen=True, slots=True, eq=False)
class CarMap:
    """A map to find the pose on. scale: true way over reported way, 1.0 where the map does not tell.

    start: pose at which its lap began, x [m], y [m], yaw [rad]; None of a map of another program. grid: to be shown.
    """

    name: str
    field: LineField
    scale: float = 1.0
    start: tuple[float, float, float] | None = None
    grid: MapGrid | None = None


def read_settings(path: Path) -> MapSettings:
    """Read and check the .yaml file. Raises: FileNotFoundError, ValueError, YamlFileError."""
    if not path.is_file():
        raise FileNotFoundError(f"no map file {path.absolute()}; give the path of a map's .yaml file")
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
    is_near = all(abs(value) <= ORIGIN_M for value in (x_m, y_m)) and math.isfinite(yaw_rad)
    if not (CELL_M[0] <= cell_m <= CELL_M[1] and is_near):
        raise ValueError(
            f"{path}: resolution must be {CELL_M[0]:g} to {CELL_M[1]:g} m and origin within {ORIGIN_M:g} m, not"
            f" {cell_m} and {(x_m, y_m, yaw_rad)}"
        )
    if occupied_thresh < free_thresh:
        raise ValueError(f"{path}: occupied_thresh, {occupied_thresh:g}, is below free_thresh, {free_thresh:g}")
    is_raw = str(content.get("mode", "")).lower() == "raw"
    return MapSettings(image, cell_m, (x_m, y_m, yaw_rad), negate, free_thresh, occupied_thresh, is_raw)


def fingerprint(path: Path) -> str:
    """Return what tells the cells of a map from those of another. Raises: OSError, ValueError, YamlFileError."""
    settings = read_settings(path)
    check_image(settings)
    digest = hashlib.sha256(repr(replace(settings, image=None)).encode())  # type: ignore[arg-type]
    digest.update(settings.image.read_bytes())
    return digest.hexdigest()[:FINGERPRINT_DIGITS]


def check_image(settings: MapSettings) -> None:
    """Raise FileNotFoundError with what to do where a map's image is missing."""
    if not settings.image.is_file():
        raise FileNotFoundError(f"the map's image {settings.image} is missing; `image` in the .yaml file names it")


def read_pgm(settings: MapSettings) -> Floats:
    """Return the occupancy of each cell, 0 free to 1 occupied, row 0 lowest in y, of a binary PGM image alone.

    Raises: MapError, OSError.
    """
    check_image(settings)
    with settings.image.open("rb") as file:
        content = file.read(MAX_BYTES + 1)
    header = re.match(
        rb"P5\s+(?:#[^\n]*\n\s*)*(\d{1,6})\s+(?:#[^\n]*\n\s*)*(\d{1,6})\s+(?:#[^\n]*\n\s*)*255\s", content
    )
    if header is None:
        raise MapError(
            f"{settings.image}: not a PGM image of 8 bits, the only kind that the car reads; image programs convert it"
        )
    columns, rows = int(header[1]), int(header[2])
    if not 0 < columns * rows <= len(content) - header.end():
        raise MapError(f"{settings.image}: says {columns} x {rows} cells and holds {len(content) - header.end()}")
    shades = np.frombuffer(content, np.uint8, columns * rows, header.end()).reshape(rows, columns)[::-1]
    if settings.is_raw:
        return np.where(shades > 100, 1.0, shades / 100.0)
    grey = shades / 255.0
    return grey if settings.negate else 1.0 - grey


def refusal_of(file: Path) -> str:
    """Return why a map is not to be trusted, "" for a good one. Raises: MapError."""
    try:
        text = file.read_text(encoding="utf-8")
    except (OSError, UnicodeDecodeError) as error:
        raise MapError(f"{file}: cannot be read ({error})") from None
    refused = re.search(r"^# .*, (refused: .*)$", text, re.MULTILINE)
    return f"the map is {refused[1]}{DRIVE_AGAIN}" if refused else ""


def read_map(path: Path, occupancy: Callable[[MapSettings], Floats] = read_pgm) -> CarMap:
    """Return a map to find the pose on. occupancy: reads the image. Raises: MapError, with what to do."""
    try:
        settings = read_settings(path)
        occupied = occupancy(settings)
        cells, grid = cells_of(settings, occupied), grid_of(settings, occupied)
        beside = path.with_name(path.stem + WALLS_SUFFIX)
        if not beside.is_file():
            _check_foreign(path, beside)
            return CarMap(path.stem, field_of_cells(cells), grid=grid)
        points, scale = read_walls(beside)
        _check_walls(beside, points, cells)
        return CarMap(path.stem, line_field(points, cells), scale, LAP_START, grid)
    except MapError:
        raise
    except OSError as error:
        words = f"{error.filename or path}: {error.strerror}" if error.errno is not None else str(error)
        raise MapError(words) from error
    except ValueError as error:
        text = str(error)
        raise MapError(text if str(path.parent) in text else f"{path}: {text}") from error


def _check_foreign(path: Path, beside: Path) -> None:
    if path.read_text(encoding="utf-8").startswith(f"# {ABOUT}"):
        raise MapError(f"{beside} is missing, which belongs to this map of `wallride map`: copy it too")


def cells_of(settings: MapSettings, occupancy: Floats) -> MapCells:
    """Return which cells of an image are walls, and which surely free. MapError for too small or large cells."""
    if not FIELD_CELL_M[0] <= settings.cell_m <= FIELD_CELL_M[1]:
        raise MapError(
            f"{settings.image}: cells of {settings.cell_m:g} m; a pose is found on cells of {FIELD_CELL_M[0]:g} to"
            f" {FIELD_CELL_M[1]:g} m"
        )
    free = occupancy < min(settings.free_thresh, SURELY_FREE_BELOW)
    wall = occupancy > min(settings.occupied_thresh, 0.65)
    x_m, y_m, yaw_rad = settings.origin
    # The grey edge of a wall in a scaled drawing is of the wall.
    wall |= _beside(wall) & ~free
    return MapCells(wall, free, settings.cell_m, complex(x_m, y_m), complex(math.cos(yaw_rad), math.sin(yaw_rad)))


def grid_of(settings: MapSettings, occupancy: Floats) -> MapGrid:
    """Return the cells of an image as ROS's map_server has them."""
    values = np.full(occupancy.shape, -1, dtype=np.int8)
    values[occupancy < settings.free_thresh] = 0
    values[occupancy > min(settings.occupied_thresh, 0.65)] = 100
    x_m, y_m, yaw_rad = settings.origin
    return MapGrid(values, settings.cell_m, complex(x_m, y_m), complex(math.cos(yaw_rad), math.sin(yaw_rad)))


def read_walls(path: Path) -> tuple[WallPoints, float]:
    """Return the walls of their file, and the scale of the wheels. Raises: MapError, OSError."""
    said, rows = {"scale": 1.0}, []
    with path.open(encoding="utf-8", errors="replace") as file:
        for number, line in enumerate(file, 1):
            if line.startswith("#"):
                if told := re.match(r"#\s*(scale|points):\s*([0-9.]{1,12})\s*$", line):
                    said[told[1]] = float(told[2])
                continue
            try:
                row = tuple(map(float, line.split(";")))
            except ValueError:
                row = ()
            if len(row) != 4 or not all(map(math.isfinite, row)) or not 0.5 < math.hypot(row[2], row[3]) < 1.5:
                raise MapError(f"{path}, line {number}: not x_m; y_m; nx; ny. Make the map again: wallride map")
            rows.append(row)
            if len(rows) > MAX_WALL_POINTS:
                raise MapError(f"{path}: more than {MAX_WALL_POINTS} points")
    scale = said["scale"]
    if len(rows) != said.get("points", len(rows)):
        raise MapError(f"{path}: it was cut, {len(rows)} of {said['points']:.0f} points are left. Copy it again")
    if not rows or not SCALES[0] <= scale <= SCALES[1]:
        raise MapError(f"{path}: {f'a scale of {scale:g}' if rows else 'no points'}. Make the map again: wallride map")
    table = np.array(rows)
    normals = table[:, 2] + 1j * table[:, 3]
    return WallPoints(table[:, 0] + 1j * table[:, 1], normals / np.abs(normals)), scale


def _check_walls(path: Path, points: WallPoints, cells: MapCells) -> None:
    """Refuse walls that do not lie on those of the image: of another lap, on whose frame the pose would be found."""
    there = (points.places_m - cells.corner_m) * cells.turn.conjugate() / cells.cell_m
    rows, columns = cells.wall.shape
    inside = (there.real >= 0.0) & (there.imag >= 0.0) & (there.real < columns) & (there.imag < rows)
    row, column = there.imag[inside].astype(np.intp), there.real[inside].astype(np.intp)
    told = np.zeros_like(cells.wall)
    told[row, column] = True
    drawn, edge = cells.wall, cells.wall & _beside(cells.free)
    for _ in range(math.ceil(WALLS_APART_M / cells.cell_m)):
        told, drawn = _beside(told), _beside(drawn)
    share = min(np.count_nonzero(drawn[row, column]) / there.size, np.mean(told[edge]) if edge.any() else 1.0)
    if share < WALLS_AGREE:
        raise MapError(
            f"{path}: these are not the walls of the image: {share:.0%} of either lie on the other's. Copy all files of"
            " the map, or make it again: wallride map"
        )


def walls_text(points: WallPoints, scale: float | None, about: str) -> str:
    """Return the text of the file with the walls."""
    told = [f"# points: {points.places_m.size}", *([] if scale is None else [f"# scale: {scale:.4f}"])]
    heading = [f"# {about}", *told, "# x_m; y_m; nx; ny"]
    rows = [
        f"{place.real:.4f}; {place.imag:.4f}; {normal.real:.4f}; {normal.imag:.4f}"
        for place, normal in zip(points.places_m.tolist(), points.normals.tolist(), strict=True)
    ]
    return "\n".join([*heading, *rows, ""])


def _image_of(path: Path, name: str) -> Path:
    """Return the image that the .yaml file names, or, where another computer's path is meant, the one beside it."""
    image = path.parent / Path(name).expanduser()
    beside = path.parent / re.split(r"[/\\]", name)[-1]
    if image.is_file() or not beside.is_file():
        return image
    log.warning("%s: there is no image %s: the one beside it is taken, %s", path, name, beside.name)
    return beside


def _beside(marks: Booleans) -> Booleans:
    """Return which cells lie beside a marked one, or are marked."""
    padded = np.pad(marks, 1)
    found = marks.copy()
    for row, column in ((0, 1), (2, 1), (1, 0), (1, 2)):
        found |= padded[row : row + marks.shape[0], column : column + marks.shape[1]]
    return found
