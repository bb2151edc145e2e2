"""The file of a race line, as `wallride line` writes it, and the course that a car's settings name."""

import math
import re
from itertools import islice
from pathlib import Path
from typing import Final, Literal

import numpy as np

from wallride.runtime.control.line_following.course import RaceCourse
from wallride.runtime.control.line_following.race_line import CourseLine
from wallride.runtime.control.localization.localizer import Localizer
from wallride.runtime.control.localization.wall_points import MapGrid
from wallride.runtime.control.method_settings import WallFollowSettings
from wallride.runtime.control.perception.geometry import Floats
from wallride.runtime.control.safety.promised_way import MOTOR_BRAKE_MPS2
from wallride.runtime.control.vehicle import CarSettings
from wallride.runtime.map_files import WALLS_SUFFIX, CarMap, MapError, fingerprint, read_map, read_settings
from wallride.runtime.settings.pose_map import PoseMapSettings

LINE_SUFFIX: Final = ".line.csv"
"""Ending of a map's line beside it, in place of .yaml."""
COLUMNS: Final = 8
MAX_POINTS: Final = 100_000
LEAST_POINTS: Final = 10
STEP_M: Final = (0.005, 0.5)
"""Least and largest distance of two points."""
SPEEDS_MPS: Final = (0.3, 50.0)
"""Least and largest speed of a point: a car does not come past one that is slower."""
HEADING_RAD, TURN_RAD = 0.3, 0.2
"""Largest angle between a heading and the way to the next point, and between the turn that curvatures say over TURN_M
and that of the headings: both of `wallride line` differ by less than 0.01."""
TURN_M: Final = 1.0
STEERABLE: Final = 0.99
"""Least share of the car's smallest radius that a line may turn on: what is written of it was rounded."""
MOST_SOLID: Final = 0.02
"""Largest share of points that are on no free cell of the map."""
AGAINST_LAP: Final = ", against the lap"
"""In the heading of a line that goes round the other way than the lap that its map was made of."""
OF_MAP: Final = re.compile(r", map ([0-9a-f]+)$")
"""In its heading, too: what tells the cells of its map."""
AGAIN: Final = "Make it again: wallride line"


def read_line(path: Path, map_file: Path | None = None, car: CarSettings | None = None) -> CourseLine:
    """Return the line of a file of `wallride line`. Raises: MapError, with what to do.

    map_file: the map that it is driven on; a line that names another one is refused. car: so is one that it cannot
    steer, or that is too near a wall for it.
    """
    rows, is_against_lap = [], False
    try:
        with path.open(encoding="utf-8", errors="replace") as file:
            for number, text in enumerate(file, 1):
                if text.startswith("#"):
                    is_against_lap |= AGAINST_LAP in text
                    if map_file is not None and (named := OF_MAP.search(text.strip())):
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
    speed_mps = _braked_mps(table[:, 5], steps_m)
    line = CourseLine(places, along_m, table[:, 3], table[:, 4], speed_mps, float(steps_m.sum()), is_against_lap)
    if why_not := _contradiction(line, steps_m):
        raise MapError(f"{path}: {why_not}. {AGAIN}")
    if car is not None and (why_not := _too_tight(line, table[:, 7], car)):
        raise MapError(f"{path}: {why_not}. {AGAIN} {map_file or 'MAP.yaml'}")
    return line


def _braked_mps(speed_mps: Floats, steps_m: Floats) -> Floats:
    """Return the speeds (n,) of a line, lowered where no motor brakes for the next ones, as in a drawn line."""
    fallen_m2ps2 = 2.0 * MOTOR_BRAKE_MPS2 * np.cumsum(np.tile(steps_m, 2))
    square = np.tile(speed_mps, 2)[1:] ** 2 + fallen_m2ps2[:-1]
    least = np.minimum.accumulate(square[::-1])[::-1]
    most_mps = np.sqrt(least[: speed_mps.size] - fallen_m2ps2[: speed_mps.size] + 2.0 * MOTOR_BRAKE_MPS2 * steps_m)
    return np.where(most_mps < speed_mps, most_mps, speed_mps)


def _contradiction(line: CourseLine, steps_m: Floats) -> str:
    """Return where heading or curvature are not those of the points, as with other axes or units; "" where they are."""
    turns = np.exp(1j * (np.roll(line.yaw_rad, -1) - line.yaw_rad))
    ways = np.exp(1j * line.yaw_rad) * np.sqrt(turns)
    off_rad = np.angle((np.roll(line.places_m, -1) - line.places_m) / ways)
    place = int(np.argmax(np.abs(off_rad) > HEADING_RAD))
    if abs(off_rad[place]) > HEADING_RAD:
        return (
            f"after s {line.along_m[place]:g} m yaw_rad is {math.degrees(-off_rad[place]):.0f} degrees off the way to"
            " the next point; it counts from the x axis, counter-clockwise"
        )
    bends_rad = steps_m * (line.curvature_radpm + np.roll(line.curvature_radpm, -1)) / 2
    apart_rad = np.cumsum(np.tile(np.angle(turns) - bends_rad, 2))
    count = min(steps_m.size, max(1, round(TURN_M / float(steps_m.mean()))))
    over_rad = np.abs(apart_rad[count : count + steps_m.size] - apart_rad[: steps_m.size])
    place = int(np.argmax(over_rad > TURN_RAD))
    if over_rad[place] > TURN_RAD:
        return f"after s {line.along_m[place]:g} m kappa_radpm is not the turn of yaw_rad; it is positive to the left"
    return ""


def _too_tight(line: CourseLine, away_m: Floats, car: CarSettings) -> str:
    """Return where a car cannot drive a line, "" where it can. away_m: of each point from the nearest wall, (n,)."""
    needed_m = car.wheelbase_m / math.tan(car.narrower_end_rad)
    place = int(np.argmax(np.abs(line.curvature_radpm)))
    radius_m = 1.0 / max(float(abs(line.curvature_radpm[place])), 1e-9)
    if radius_m < needed_m * STEERABLE:
        return f"after s {line.along_m[place]:.1f} m it turns on {radius_m:.2f} m, and this car needs {needed_m:.2f} m"
    place = int(np.argmin(away_m))
    if away_m[place] < car.half_width_m:
        return (
            f"after s {line.along_m[place]:.1f} m it is {away_m[place]:.2f} m from a wall, and half of this car is"
            f" {car.half_width_m:.2f} m wide"
        )
    return ""


def map_of_line(path: Path) -> str:
    """Return the fingerprint of the map that a line was made for, "" where it tells none. Raises: OSError."""
    with path.open(encoding="utf-8", errors="replace") as file:
        heading = [line.strip() for line in islice(file, 3)]
    return next((named[1] for text in heading if text.startswith("#") and (named := OF_MAP.search(text))), "")


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
    if len(row) != COLUMNS or not all(map(math.isfinite, row)):
        raise MapError(
            f"{path}, line {number}: not s_m; x_m; y_m; yaw_rad; kappa_radpm; vx_mps; ax_mps2; away_m. {AGAIN}"
        )
    if not SPEEDS_MPS[0] <= row[5] <= SPEEDS_MPS[1]:
        least, most = SPEEDS_MPS
        raise MapError(f"{path}, line {number}: vx_mps has to be {least:g} to {most:g}, not {row[5]:g}. {AGAIN}")
    return row


def _beside(path: Path) -> Path:
    return path.with_name(path.stem + LINE_SUFFIX)


def why_no_line(follow: WallFollowSettings, map_: PoseMapSettings) -> str:
    """Return why a car that is to follow a map's line has none, "" where it has one, or follows a wall."""
    if follow.method != "line" or (map_.line and map_.file):
        return ""
    if not map_.file:
        return 'wall_follow.method = "line" follows the race line of a map, and map.file names none'
    path = Path(map_.file).expanduser()
    beside = _beside(path)
    try:
        if not path.is_file() or beside.is_file():
            return ""
    except OSError:  # another user's folder
        return ""  # a map that is not there, or not to be read, is told where it is read
    return f'wall_follow.method = "line": there is no {beside} beside the map; make it: wallride line {path}'


def read_course(settings: PoseMapSettings, car: CarSettings) -> RaceCourse | None:
    """Return the course that settings name, None for no map. Raises: MapError, with what to do."""
    if not settings.file:
        return None
    path = Path(settings.file).expanduser()
    beside = _beside(path)
    known = read_map(path)
    named = Path(settings.line).expanduser() if settings.line else beside if beside.is_file() else None
    line = read_line(named, path, car) if named is not None else None
    if line is not None and known.grid is not None and (why_not := _through_walls(line, known.grid)):
        raise MapError(f"{named}: {why_not} of {path}. {AGAIN}")
    return course_of(known, settings.start, car, line)


def read_raced_course(follow: WallFollowSettings, map_: PoseMapSettings, car: CarSettings) -> RaceCourse | None:
    """Return the course of a car that follows a line, None where it follows a wall. Raises: MapError, also for none."""
    if why := why_no_line(follow, map_):
        raise MapError(why)
    return read_course(map_, car) if follow.method == "line" else None


def files_of_course(settings: PoseMapSettings) -> list[Path]:
    """Return the files that `read_course` reads, none for no map. Raises: MapError."""
    if not settings.file:
        return []
    path = Path(settings.file).expanduser()
    line = Path(settings.line).expanduser() if settings.line else _beside(path)
    files = (path, read_settings(path).image, path.with_name(path.stem + WALLS_SUFFIX), line)
    return [file for file in files if file.is_file()]


def check_course(file: Path) -> None:
    """Read a map with its walls and line, as a car that starts does. Raises: MapError, with what to do."""
    steers_anything = CarSettings(max_steering_rad=1.1)  # what it cannot steer is the car's to say
    read_course(PoseMapSettings(file=str(file)), steers_anything)


def _through_walls(line: CourseLine, grid: MapGrid) -> str:
    """Return where a line leads over cells of a map that are not free, "" where it does not."""
    there = (line.places_m - grid.corner_m) * grid.turn.conjugate() / grid.cell_m
    rows, columns = grid.values.shape
    inside = (there.real >= 0.0) & (there.imag >= 0.0) & (there.real < columns) & (there.imag < rows)
    solid = ~inside
    solid[inside] = grid.values[there.imag[inside].astype(np.intp), there.real[inside].astype(np.intp)] != 0
    if np.mean(solid) <= MOST_SOLID:
        return ""
    first = line.places_m[int(np.argmax(solid))]
    return f"the line leads through what is not free, at x {first.real:.1f} m, y {first.imag:.1f} m,"


def course_of(
    known: CarMap, start: Literal["lap", "anywhere"], car: CarSettings, line: CourseLine | None = None
) -> RaceCourse:
    """Return the course of a map that was read."""
    localizer = Localizer(known.field, car, known.start if start == "lap" else None, known.scale)
    if line is not None and line.is_against_lap:
        localizer.either_way_round()
    return RaceCourse(known.name, known.field, localizer, line, known.grid)
