"""`wallride line`: the race line of a map, with its lap time, as a file and a picture."""

import argparse
import json
import os
from collections.abc import Sequence
from pathlib import Path
from typing import Final

import numpy as np

from wallride.runtime.control.vehicle import CarSettings
from wallride.runtime.host.output_files import write_answer, write_files
from wallride.runtime.line_files import LINE_SUFFIX, map_of_line
from wallride.runtime.map_files import MapError, fingerprint, refusal_of
from wallride.runtime.settings.driven_car import driven_car
from wallride.runtime.settings.tree import load_settings
from wallride.sim.racing.free_space import FreeSpace
from wallride.sim.racing.line_file import save_picture, text_of
from wallride.sim.racing.raceline import NoLineError, RaceLine, race_line
from wallride.sim.racing.ring import driven_path, read_path, ring_of, ring_of_path
from wallride.sim.racing.speed_profile import Grip
from wallride.sim.world.place import World
from wallride.sim.world.worlds import is_map, is_there, load_world

NARROWER_M: Final = 0.03
"""A line may be this much nearer to a wall than asked before that is said: the points of its bounds are 3 cm apart."""
PICTURE: Final = ".png"
SPARE_M: Final = 0.05
"""Smallest distance between the car's side and a wall that counts as room for the car."""


def run(options: argparse.Namespace) -> int:
    """Write the line; ValueError, SettingsError and OSError for what the user can correct."""
    _check_map(options.map)
    if options.path is None and options.side is None and is_map(options.map):
        options.path = driven_path(Path(options.map))
    world = load_world(Path(options.map) if is_map(options.map) else options.map, side=options.side)
    car = driven_car(load_settings(options.config, options.assignments))
    if options.keep_m < (least_m := car.half_width_m + SPARE_M):
        raise NoLineError(f"--keep {options.keep_m:g} m is less than the car needs beside its middle: {least_m:.2f} m")
    _check_avoided(world, options.avoid)
    line = line_of(world, options, car)
    map_print = fingerprint(Path(options.map)) if is_map(options.map) else ""
    stem = Path(options.map).with_suffix("") if is_map(options.map) else Path(world.name.replace(":", "-"))
    own = stem.with_name(f"{stem.name}{LINE_SUFFIX}")
    target = options.output or _default_target(own, map_print)
    if target.suffix == PICTURE:
        raise ValueError(f"-o {target}: name a file, such as {own.name}; the picture goes beside it")
    picture = target.with_suffix(PICTURE)
    about = (
        f"race line by wallride: {world.name}, {_course(options, world)}, mu {options.mu:g}, at least"
        f" {options.keep_m:g} m from walls, at most {options.speed_mps:g} m/s"
    )
    title = f"{world.name}: {line.length_m:.1f} m, {line.lap_s:.2f} s"
    write_files({
        target: text_of(line, about, map_print, is_against_lap=_is_against_lap(line, options)),
        picture: lambda file: save_picture(file, world.outline_m, line, title),
    })  # fmt: skip
    write_answer(json.dumps(figures(line)) + "\n", options.json)
    if options.json != "-":
        for text in (*summary(line, options.keep_m, world.name), f"written: {target}, {picture}"):
            print(text)  # noqa: T201 - this is the command's answer
    return 0


def _check_map(name: str) -> None:
    """Refuse the image of a map, and a map that is not to be trusted. Raises: MapError."""
    why_not = "" if is_there(name) else "is no map's .yaml"
    if Path(name).is_file() and (why_not := refusal_of(Path(name)) if is_map(name) else why_not):
        raise MapError(f"{name}: {why_not}")


def _default_target(beside: Path, map_print: str) -> Path:
    """Return the file of a line where none was named: beside its map, or here where nothing can be written there.

    Raises: NoLineError where that is the line of another map.
    """
    if os.access(beside.parent, os.W_OK):
        return beside
    here = Path(beside.name)
    if here.is_file() and map_of_line(here) != map_print:
        raise NoLineError(
            f"{beside.parent} takes no file, and {here} here is the line of another map: name one with -o"
        )
    return here


def line_of(world: World, options: argparse.Namespace, car: CarSettings) -> RaceLine:
    """Return the line of a world under the options of the command.

    Raises: NoRingError, NoLineError; OSError for the file of a path.
    """
    ring_m = ring_of(world) if options.path is None else ring_of_path(read_path(options.path), what=str(options.path))
    if options.reverse:
        ring_m = ring_m[::-1]
    grip = Grip(
        options.mu, options.lateral_share, options.brake_share, options.speed_mps, drive_mps2=car.max_acceleration_mps2
    )
    radius_m = car.wheelbase_m / float(np.tan(car.narrower_end_rad))
    line = race_line(ring_m, FreeSpace(world.outline_m, options.avoid), grip, keep_m=options.keep_m, radius_m=radius_m)
    nearest = int(np.argmin(line.away_m))
    if line.away_m[nearest] < car.half_width_m + SPARE_M:
        place = _place(line, nearest)
        raise NoLineError(
            f"there is no room for the car at {place}: {line.away_m[nearest]:.2f} m from its middle to the wall"
        )
    return line


def _is_against_lap(line: RaceLine, options: argparse.Namespace) -> bool:
    """Return whether a line goes round the other way than the lap beside its map, or than it would by itself."""
    lap = driven_path(Path(options.map)) if is_map(options.map) else None
    if lap is None:
        return bool(options.reverse)
    path_m = read_path(lap)
    steps_m, points_m = np.diff(path_m, axis=0), np.column_stack([line.x_m, line.y_m])
    nearest = np.argmin(np.hypot(*(path_m[:-1, None] - points_m).transpose(2, 0, 1)), axis=1)
    ahead_m = steps_m[:, 0] * np.cos(line.yaw_rad[nearest]) + steps_m[:, 1] * np.sin(line.yaw_rad[nearest])
    return float(ahead_m.sum()) < 0.0


def _check_avoided(world: World, avoided: Sequence[tuple[float, float, float]]) -> None:
    left_m, bottom_m, right_m, top_m = world.bounds_m
    for x_m, y_m, radius_m in avoided:
        if not (left_m - radius_m < x_m < right_m + radius_m and bottom_m - radius_m < y_m < top_m + radius_m):
            raise ValueError(
                f"--avoid {x_m:g},{y_m:g},{radius_m:g}: lies beside the map, whose walls lie at x {left_m:.1f} to"
                f" {right_m:.1f} m, y {bottom_m:.1f} to {top_m:.1f} m"
            )


def figures(line: RaceLine) -> dict[str, float]:
    """Return the figures of a line by name."""
    return {
        "length_m": round(line.length_m, 3),
        "lap_s": round(line.lap_s, 3),
        "nearest_wall_m": round(float(line.away_m.min()), 3),
        "tightest_turn_m": round(1.0 / float(np.abs(line.curvature_radpm).max()), 3),
        "slowest_mps": round(float(line.speed_mps.min()), 3),
        "fastest_mps": round(float(line.speed_mps.max()), 3),
    }


def summary(line: RaceLine, keep_m: float, name: str) -> Sequence[str]:
    """Return the figures in sentences."""
    found, nearest = figures(line), int(np.argmin(line.away_m))
    speeds = f"{found['slowest_mps']:.1f} to {found['fastest_mps']:.1f} m/s"
    wall = f"{found['nearest_wall_m']:.2f} m from the middle of the car, at {_place(line, nearest)}"
    lines = [
        f"{name}: a line of {found['length_m']:.1f} m, {found['lap_s']:.2f} s a lap in theory, {speeds}",
        f"tightest turn {found['tightest_turn_m']:.2f} m; nearest wall {wall}",
    ]
    if found["nearest_wall_m"] < keep_m - NARROWER_M:
        lines.append(f"that is nearer than the {keep_m:g} m asked for: the course has no more room there")
    return lines


def _place(line: RaceLine, index: int) -> str:
    return f"x {line.x_m[index]:.1f} m, y {line.y_m[index]:.1f} m"


def _course(options: argparse.Namespace, world: World) -> str:
    course = f"wall on the {world.side}" if options.path is None else f"along {options.path.name}"
    return f"{course}, reversed" if options.reverse else course
