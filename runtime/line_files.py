"""The file of a race line, as `wallride line` writes it, and the course that a car's settings name."""

import math
import re
from pathlib import Path
from typing import Final, Literal

import numpy as np

from wallride.runtime.control.line_following.course import RaceCourse
from wallride.runtime.control.line_following.race_line import CourseLine
from wallride.runtime.control.localization.localizer import Localizer
from wallride.runtime.control.method_settings import WallFollowSettings
from wallride.runtime.control.vehicle import CarSettings
from wallride.runtime.map_files import CarMap, MapError, fingerprint, read_map
from wallride.runtime.settings.pose_map import PoseMapSettings

LINE_SUFFIX: Final = ".line.csv"
"""Ending of a map's line beside it, in place of .yaml."""
COLUMNS: Final = 8
MAX_POINTS: Final = 100_000
LEAST_POINTS: Final = 10
STEP_M: Final = (0.005, 0.5)
"""Least and largest distance of two points."""
MAX_MPS: Final = 50.0
AGAIN: Final = "Make it again: wallride line"


def read_line(path: Path, map_file: Path | None = None) -> CourseLine:
    """Return the line of a file of `wallride line`. Raises: MapError, with what to do.

    map_file: the map that it is driven on; a line that names another one is refused.
    """
    rows = []
    try:
        with path.open(encoding="utf-8", errors="replace") as file:
            for number, text in enumerate(file, 1):
                if text.startswith("#"):
                    if map_file is not None and (named := re.search(r", map ([0-9a-f]+)$", text.strip())):
                        _check_map(path, named[1], map_file)
                    continue
                rows.append(_row(path, number, text))
                if len(rows) > MAX_POINTS:
                    raise MapError(f"{path}: more than {MAX_POINTS} points")
    except OSError as error:
        raise MapError(f"{path}: {error.strerror or error}; make it: wallride line") from error
    if len(rows) < LEAST_POINTS:
        raise MapError(f"{path}: {len(rows)} points are no line. {AGAIN}")
    table = np.array(rows)
    places = table[:, 1] + 1j * table[:, 2]
    steps_m = np.abs(np.roll(places, -1) - places)
    if not (steps_m.min() >= STEP_M[0] and steps_m.max() <= STEP_M[1]):
        place = int(np.argmax(steps_m)) if steps_m.max() > STEP_M[1] else int(np.argmin(steps_m))
        raise MapError(
            f"{path}: points are {STEP_M[0]:g} to {STEP_M[1]:g} m apart and the last joins the first; after s"
            f" {table[place, 0]:g} m it is {steps_m[place]:.3g} m. {AGAIN}"
        )
    along_m = np.concatenate([[0.0], np.cumsum(steps_m)[:-1]])
    return CourseLine(places, along_m, table[:, 3], table[:, 4], table[:, 5], float(steps_m.sum()))


def _check_map(path: Path, named: str, map_file: Path) -> None:
    try:
        known = fingerprint(map_file)
    except (OSError, ValueError) as error:
        raise MapError(str(error)) from error
    if named != known:
        raise MapError(
            f"{path}: the line of another map than {map_file}, which was changed or made anew since."
            f" Make it again: wallride line {map_file} -o {path}"
        )


def _row(path: Path, number: int, text: str) -> tuple[float, ...]:
    try:
        row = tuple(map(float, text.split(";")))
    except ValueError:
        row = ()
    if len(row) != COLUMNS or not all(map(math.isfinite, row)) or not 0.0 <= row[5] <= MAX_MPS:
        raise MapError(
            f"{path}, line {number}: not s_m; x_m; y_m; yaw_rad; kappa_radpm; vx_mps; ax_mps2; away_m. {AGAIN}"
        )
    return row


def why_no_line(follow: WallFollowSettings, map_: PoseMapSettings) -> str:
    """Return why a car that is to follow a map's line has none, "" where it has one, or follows a wall."""
    if follow.method != "line" or map_.line:
        return ""
    if not map_.file:
        return 'wall_follow.method = "line" follows the race line of a map, and map.file names none'
    path = Path(map_.file).expanduser()
    beside = path.with_name(path.stem + LINE_SUFFIX)
    if not path.is_file() or beside.is_file():  # a map that is not there is told where it is read
        return ""
    return f'wall_follow.method = "line": there is no {beside} beside the map; make it: wallride line {path}'


def read_course(settings: PoseMapSettings, car: CarSettings) -> RaceCourse | None:
    """Return the course that settings name, None for no map. Raises: MapError, with what to do."""
    if not settings.file:
        return None
    path = Path(settings.file).expanduser()
    beside = path.with_name(path.stem + LINE_SUFFIX)
    known = read_map(path)
    named = Path(settings.line).expanduser() if settings.line else beside if beside.is_file() else None
    return course_of(known, settings.start, car, read_line(named, path) if named is not None else None)


def course_of(
    known: CarMap, start: Literal["lap", "anywhere"], car: CarSettings, line: CourseLine | None = None
) -> RaceCourse:
    """Return the course of a map that was read."""
    localizer = Localizer(known.field, car, known.start if start == "lap" else None, known.scale)
    return RaceCourse(known.name, known.field, localizer, line, known.grid)
