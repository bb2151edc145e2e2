"""A simulated race: the world that a map was made of, its line, and how exactly the car drove it and knew its place."""

import argparse
import cmath
import math
import re
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Final, cast

import numpy as np

from wallride.runtime.control.line_following.race_line import CourseLine
from wallride.runtime.line_files import LINE_SUFFIX, read_line
from wallride.runtime.map_files import MapError, refusal_of
from wallride.runtime.settings.tree import SettingsError, load_settings
from wallride.sim.world.lap import Lap
from wallride.sim.world.place import World
from wallride.sim.world.pose import Floats, Pose, Side
from wallride.sim.world.worlds import is_map, is_there

DEFAULT_WORLD: Final = "loop"
PLACE: Final = re.compile(r"^# world: (\S.*?)(?: --side (left|right))?(?: --pose (.*?))?\s*$", re.MULTILINE)
"""What a map says of where its lap was driven, in the words of its recording."""
SPARE: Final = 1.1
"""The car's maximum speed over the line's highest: wheels that report too much are commanded more."""
MOVES_MPS: Final = 0.3
LEAST_POSES: Final = 10
"""Of fewer a rigid motion leaves no error to speak of, of one none at all."""


@dataclass(frozen=True, slots=True, eq=False)
class Race:
    """What is raced. origin: of the map in the world, None for the world's start. notice: what is odd about it, or "".

    is_lap: the origin is where the map's lap began; without it, where a map that is the world itself has it.
    side: of the wall in the world of the lap, None where the map does not tell.
    """

    line: CourseLine
    origin: Pose | None = None
    is_lap: bool = True
    notice: str = ""
    side: Side | None = None

    def origin_in(self, world: World) -> Pose:
        """Return the origin of the map in a world."""
        return self.origin or world.start

    def start_in(self, world: World) -> Pose:
        """Return where the car begins: where the lap did, turned round where the line goes the other way."""
        start = self.origin_in(world) if self.is_lap else world.start
        if self.line.is_against_lap:
            return replace(start, yaw_rad=math.remainder(start.yaw_rad + math.pi, math.tau))
        return start


def take_race(options: argparse.Namespace, config: Path | None = None, saved: Path | None = None) -> Race | None:
    """Set world and settings of a race by its map; what the command line says goes first. Raises: SettingsError."""
    if options.race is None:
        options.world = options.world or DEFAULT_WORLD
        return None
    named = [f"map.file={options.race.resolve()}", *options.assignments]
    settings = load_settings(config, named, saved)
    own_line, car = settings.map.line, settings.car
    try:
        line = read_line(Path(own_line).expanduser() if own_line else line_of_map(options.race), options.race, car)
        options.world, race = placed(line, options.race, options.world)
    except MapError as error:
        raise SettingsError(str(error)) from None
    fastest_mps = float(line.speed_mps.max())
    options.assignments = [
        "wall_follow.method=line",
        *(f"{name}={fastest_mps * SPARE:.3f}" for name in ("wall_follow.speed_mps", "car.max_speed_mps")),
        *named,
    ]  # fmt: skip
    return race


def line_of_map(file: Path) -> Path:
    """Return the line's file beside a map. Raises: MapError where there is none, or the map is not to be trusted."""
    if file.suffix == ".yaml" and not file.exists():
        raise MapError(f"--race {file}: there is no such file; a map is made of a recorded lap: wallride map -o {file}")
    if file.suffix != ".yaml" or not file.is_file():
        raise MapError(f"--race {file}: is no map's .yaml; make one of a recorded lap: wallride map")
    if refused := refusal_of(file):
        raise MapError(f"--race {file}: {refused}")
    beside = file.with_name(file.stem + LINE_SUFFIX)
    if not beside.is_file():
        raise MapError(f"--race {file}: no race line beside it; make one there: wallride line {file}")
    return beside


def world_words(world: str, side: Side, start: Pose | None) -> str:
    """Return what a recording says of where it was driven, from which its map has it. start: None for the world's."""
    pose = f" --pose {start.x_m:.6g},{start.y_m:.6g},{start.yaw_rad:.6g}" if start is not None else ""
    named = Path(world).resolve() if is_map(world) else world  # the map will be read in another folder
    return f"{named} --side {side}{pose}"


def placed(line: CourseLine, file: Path, named: str | None) -> tuple[str, Race]:
    """Return the world of a race, and the race with the map's place there. named: the world that was asked for.

    Raises: MapError where none was, and the map does not tell, or its world is not there.
    """
    name_it = f"name it first: wallride sim WORLD --race {file}"
    told = PLACE.search(_text(file))
    world, side, start = told.groups() if told is not None else ("", None, None)
    if named is not None and is_map(named) and Path(named).resolve() == file.resolve():
        return named, Race(line, Pose(0.0, 0.0, 0.0), is_lap=False)
    if named is not None and not _is_same(world, named):
        return named, Race(line, notice=f"{file.name} is the map of a lap in {world}, not in {named}" if world else "")
    if not world:
        raise MapError(f"--race {file}: it does not tell its world; {name_it}")
    places = (world, str(file.parent / world), str(file.parent / Path(world).name))
    chosen = named or next(filter(is_there, places), world)
    if named is None and (not is_there(chosen) or Path(chosen).resolve() == file.resolve()):
        raise MapError(f"--race {file}: the world that its lap was driven in, {world}, is not here; {name_it}")
    try:
        origin = Pose(*map(float, start.split(","))) if start else None
    except (TypeError, ValueError):
        raise MapError(f"--race {file}: its lap began at {start}, which is no pose X,Y,THETA; {name_it}") from None
    return chosen, Race(line, origin, side=cast("Side | None", side))


def _is_same(told: str, named: str) -> bool:
    """Return whether a world that was named is the one that a map tells, whose file may lie elsewhere now."""
    return told == named or (is_map(named) and Path(told).stem == Path(named).stem)


def _text(file: Path) -> str:
    try:
        return file.read_text(encoding="utf-8")
    except (OSError, UnicodeDecodeError) as error:
        raise MapError(f"--race {file}: cannot be read ({error})") from None


def sees_its_lap(world: World, pose: Pose) -> bool:
    """Return whether any part of a world's lap is in sight of a car: from outside of the course none is."""
    if world.lap is None:
        return True
    x_m, y_m = (world.lap.points_m - (pose.x_m, pose.y_m)).T
    free_m = world.cast(pose.x_m, pose.y_m, np.arctan2(y_m, x_m))
    return bool(np.any(free_m > np.hypot(x_m, y_m)))


def with_lap(world: World, race: Race) -> World:
    """Return the world with a race's line as its lap."""
    places = in_world(race.line, race.origin_in(world))
    return replace(world, lap=Lap(np.column_stack([places.real, places.imag])))


def in_world(line: CourseLine, start: Pose) -> np.ndarray:
    """Return the points of a line in the world, x + iy."""
    return complex(start.x_m, start.y_m) + cmath.exp(1j * start.yaw_rad) * line.places_m


def race_figures(
    track: Floats, poses: Floats, line: CourseLine, start: Pose, lap_times_s: Sequence[float]
) -> dict[str, float | None]:
    """Return how far from the line the last lap was, and how far the poses that the car found are from the truth.

    track: true time, x, y and speed, (n, 4). poses: time, x and y on the map, (m, 3). They are laid over the truth by
    one rigid motion: what remains is the error of the trajectory. start: where the map's lap began, in the world.
    """
    end_s = float(np.sum(lap_times_s))
    begin_s = end_s - (lap_times_s[-1] if lap_times_s else 0.0)
    last = (track[:, 0] >= begin_s) & (track[:, 0] < end_s) & (track[:, 3] > MOVES_MPS)
    places = (track[last, 1] + 1j * track[last, 2] - complex(start.x_m, start.y_m)) * cmath.exp(-1j * start.yaw_rad)
    aside_m = np.abs([line.nearest(complex(place)).aside_m for place in places])
    off_m = trajectory_errors_m(track, poses)
    return {
        "line_rms_m": _rms(aside_m), "line_largest_m": float(aside_m.max()) if aside_m.size else None,
        "trajectory_rms_m": _rms(off_m), "trajectory_largest_m": float(off_m.max()) if off_m.size else None,
    }  # fmt: skip


def trajectory_errors_m(track: Floats, poses: Floats) -> Floats:
    """Return the distance of each pose from the truth, after one rigid motion, (k,)."""
    if len(track) < 2:
        return np.zeros(0)
    times_s = track[:, 0]
    some = poses[(poses[:, 0] >= times_s[0]) & (poses[:, 0] <= times_s[-1])]
    if len(some) < LEAST_POSES:
        return np.zeros(0)
    true = np.interp(some[:, 0], times_s, track[:, 1]) + 1j * np.interp(some[:, 0], times_s, track[:, 2])
    places = some[:, 1] + 1j * some[:, 2]
    places, true = places - places.mean(), true - true.mean()
    turn = np.vdot(places, true)
    off_m: Floats = np.abs(places * turn / max(1e-12, abs(turn)) - true)
    return off_m


def _rms(values: Floats) -> float | None:
    return float(np.sqrt(np.mean(values**2))) if values.size else None
