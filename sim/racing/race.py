"""A simulated race: the world that a map was made of, its line, and how exactly the car drove it and knew its place."""

import argparse
import cmath
import re
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Final

import numpy as np

from wallride.runtime.control.line_following.race_line import CourseLine
from wallride.runtime.line_files import LINE_SUFFIX, read_line
from wallride.runtime.map_files import MapError, refusal_of
from wallride.runtime.settings.tree import SettingsError
from wallride.sim.world.lap import Lap
from wallride.sim.world.place import World
from wallride.sim.world.pose import Floats, Pose

DEFAULT_WORLD: Final = "loop"
START: Final = " --pose "
"""Between world and pose in what a recording says of where it was driven."""
SPARE: Final = 1.1
"""The car's maximum speed over the line's highest: wheels that report too much are commanded more."""
MOVES_MPS: Final = 0.3


def take_race(options: argparse.Namespace) -> None:
    """Set world and settings of a race by its map; what the command line says goes first. Raises: SettingsError."""
    if options.race is None:
        return
    try:
        line = read_line(line_of_map(options.race), options.race)
        if options.world == DEFAULT_WORLD:
            options.world, start = world_of_map(options.race)
            options.pose = options.pose or start
    except MapError as error:
        raise SettingsError(str(error)) from None
    fastest_mps = float(line.speed_mps.max())
    options.assignments = [
        "wall_follow.method=line", f"map.file={options.race.resolve()}",
        *(f"{name}={fastest_mps * SPARE:.3f}" for name in ("wall_follow.speed_mps", "car.max_speed_mps")),
        *options.assignments,
    ]  # fmt: skip


def line_of_map(file: Path) -> Path:
    """Return the line's file beside a map. Raises: MapError where there is none, or the map is not to be trusted."""
    if file.suffix != ".yaml" or not file.is_file():
        raise MapError(f"--race {file}: is no map's .yaml; make one of a recorded lap: wallride map")
    if refused := refusal_of(file):
        raise MapError(f"--race {file}: {refused}")
    beside = file.with_name(file.stem + LINE_SUFFIX)
    if not beside.is_file():
        raise MapError(f"--race {file}: no race line beside it; make one there: wallride line {file} -o {beside}")
    return beside


def world_of_map(file: Path) -> tuple[str, str | None]:
    """Return the simulated world that a map was made of, and the pose that its lap began at, None for the world's own.

    Raises: MapError where the map does not tell.
    """
    told = re.search(r"^# world: (\S.*)$", _text(file), re.MULTILINE)
    if told is None:
        raise MapError(f"--race {file}: it does not tell its world; name it first: wallride sim WORLD --race {file}")
    world, _, start = told[1].strip().partition(START)
    return world, start or None


def _text(file: Path) -> str:
    try:
        return file.read_text(encoding="utf-8")
    except (OSError, UnicodeDecodeError) as error:
        raise MapError(f"--race {file}: cannot be read ({error})") from None


def with_lap(world: World, file: Path, start: Pose) -> World:
    """Return the world with the line of a map as its lap. start: where the map's lap began, in the world."""
    places = in_world(read_line(line_of_map(file)), start)
    return replace(world, lap=Lap(np.column_stack([places.real, places.imag])))


def in_world(line: CourseLine, start: Pose) -> np.ndarray:
    """Return the points of a line in the world, x + iy."""
    return complex(start.x_m, start.y_m) + cmath.exp(1j * start.yaw_rad) * line.places_m


def race_figures(
    track: Floats, poses: Floats, file: Path, start: Pose, lap_times_s: Sequence[float]
) -> dict[str, float | None]:
    """Return how far from the line the last lap was, and how far the poses that the car found are from the truth.

    track: true time, x, y and speed, (n, 4). poses: time, x and y on the map, (m, 3). They are laid over the truth by
    one rigid motion: what remains is the error of the trajectory.
    """
    line = read_line(line_of_map(file))
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
    if not len(some):
        return np.zeros(0)
    true = np.interp(some[:, 0], times_s, track[:, 1]) + 1j * np.interp(some[:, 0], times_s, track[:, 2])
    places = some[:, 1] + 1j * some[:, 2]
    places, true = places - places.mean(), true - true.mean()
    turn = np.vdot(places, true)
    off_m: Floats = np.abs(places * turn / max(1e-12, abs(turn)) - true)
    return off_m


def _rms(values: Floats) -> float | None:
    return float(np.sqrt(np.mean(values**2))) if values.size else None
