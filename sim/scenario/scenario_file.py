"""A scenario's file (docs/scenarios.md), made into a world with a car in it. Mistakes have file and line."""

import json
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Annotated, Any

import numpy as np
from pydantic import BaseModel, Field, ValidationError

from wallride.drivers.section import Section
from wallride.runtime.control.own_laws.law_class import is_own
from wallride.runtime.line_files import read_raced_course
from wallride.runtime.map_files import MapError
from wallride.runtime.settings.tree import Settings, SettingsError, load_settings
from wallride.sim.car.vehicle_settings import VehicleSettings
from wallride.sim.scenario.conditions import NO_PARTS, Conditions, ConditionsError, own_parts_fields
from wallride.sim.scenario.scenario_parts import (
    ScenarioExpectation,
    ScenarioFault,
    ScenarioObstacle,
    ScenarioStart,
    ScenarioWall,
)
from wallride.sim.scenario.simulated_car import find_config
from wallride.sim.scenario.toml_lines import FileMistakeError, TomlText, flat, read_toml
from wallride.sim.world.beams import LidarSettings
from wallride.sim.world.obstacles import Obstacle, ObstacleWorld
from wallride.sim.world.place import World
from wallride.sim.world.pose import Pose
from wallride.sim.world.segments import SegmentGeometry
from wallride.sim.world.worlds import is_map, load_world

EMPTY = "empty"
"""World without walls of its own."""
DURATION_S = 30.0
MAP_PATHS = frozenset({"map.file", "map.line"})
MAX_START_TO_WALL_M = 10.0
"""The UST-10LX's range: a car that starts farther from every wall sees nothing and stands for good."""


class ScenarioContent(Section):
    """Content of a file; see the module."""

    description: str = ""
    world: str = "loop"
    duration_s: Annotated[float, Field(gt=0, le=3600)] = DURATION_S
    seed: Annotated[int, Field(ge=0)] = 0
    own_parts: str = "none"
    start: ScenarioStart = ScenarioStart()
    settings: dict[str, Any] = Field(default_factory=dict)
    vehicle: dict[str, Any] = Field(default_factory=dict)
    lidar: dict[str, Any] = Field(default_factory=dict)
    wall: tuple[ScenarioWall, ...] = ()
    obstacle: tuple[ScenarioObstacle, ...] = ()
    fault: tuple[ScenarioFault, ...] = ()
    expect: tuple[ScenarioExpectation, ...] = ()


@dataclass(frozen=True, slots=True)
class Scenario:
    """A checked scenario. obstacles: one for each [[obstacle]]."""

    text: TomlText
    content: ScenarioContent
    assignments: tuple[str, ...]
    settings: Settings
    conditions: Conditions
    world: World
    start: Pose
    obstacles: tuple[Obstacle, ...]

    @property
    def name(self) -> str:
        """Return the name of its file."""
        return self.text.path.stem


def load_scenario(path: Path, config: Path | None = None, assignments: Sequence[str] = ()) -> Scenario:
    """Return a scenario; FileMistakeError names file and line of a mistake.

    config: settings file below the scenario's settings, None for the simulated car's. assignments: KEY=VALUE above.
    """
    text = read_toml(path)
    if not text.tree:
        raise text.mistake((), "declares nothing; docs/scenarios.md has a scenario to start from")
    try:
        content = ScenarioContent.model_validate(text.tree)
    except ValidationError as error:
        first = error.errors(include_url=False)[0]
        place = tuple(part for part in first["loc"] if part in _names_in(text.tree) or isinstance(part, int))
        raise text.mistake(place, _sentence(first)) from None
    text.search_beside()
    assignments = [*_said(path.absolute().parent, content), *assignments]
    settings = _settings(text, config, assignments, list(flat(content.settings)))
    chosen = settings.wall_follow.method, settings.safety.method, settings.lidar.driver, settings.motor.driver
    if any(map(is_own, chosen)):
        assignments = [f"process.laws_folder={json.dumps(str(path.absolute().parent))}", *assignments]
        settings = _settings(text, config, assignments, list(flat(content.settings)))
    _check_course(text, settings)
    world = _world(text, content, settings)
    _check_times(text, content)
    _check_laps(text, content, world)
    start = _start(text, content.start, world)
    obstacles = tuple(one.obstacle() for one in content.obstacle)
    _check_obstacles(text, obstacles, world, start)
    return Scenario(
        text,
        content,
        tuple(assignments),
        settings,
        _conditions(text, content),
        world,
        start,
        obstacles,
    )


def _names_in(tree: object) -> set[str]:
    if isinstance(tree, Mapping):
        return {str(key) for key in tree} | {name for value in tree.values() for name in _names_in(value)}
    return {name for value in tree for name in _names_in(value)} if isinstance(tree, list) else set()


def _sentence(error: Mapping[str, Any]) -> str:
    key = ".".join(str(part) for part in error["loc"] if not isinstance(part, int) and "[" not in str(part))
    message = str(error["msg"]).removeprefix("Value error, ")
    if error["type"] == "extra_forbidden":
        return f"{key} is unknown here; there are {', '.join(_known_at(error['loc']))}"
    if error["type"] == "missing":
        return f"{key} has too few numbers" if isinstance(error["loc"][-1], int) else f"{key} is missing"
    if error["type"] in {"tuple_type", "list_type"}:
        tables = isinstance(error["input"], Mapping) and len(error["loc"]) == 1
        return f"{key}: write [[{key}]], for there can be several" if tables else f"{key}: write a list in [ ]"
    if error["type"] == "value_error":
        return f"{key}: {message}"
    return f"{key} = {error['input']!r}: {message[:1].lower()}{message[1:]}"


def _known_at(loc: Sequence[str | int]) -> list[str]:
    """Return the keys of the table in which an unknown one was found."""
    tables: dict[str, type[BaseModel]] = {
        "start": ScenarioStart, "wall": ScenarioWall, "obstacle": ScenarioObstacle, "fault": ScenarioFault,
        "expect": ScenarioExpectation,
    }  # fmt: skip
    return _keys_of(tables.get(str(loc[0]), ScenarioContent) if len(loc) > 1 else ScenarioContent)


def _keys_of(table: type[BaseModel]) -> list[str]:
    return list(table.model_fields)


def _said(folder: Path, content: ScenarioContent) -> list[str]:
    """Return the settings as KEY=VALUE texts; a map's path is seen from the scenario's folder, as the world's is."""
    said = flat(content.settings)
    for name in MAP_PATHS.intersection(said):
        said[name] = str(folder / Path(str(said[name])).expanduser()) if said[name] else ""
    return [f"{name}={json.dumps(value)}" for name, value in said.items()]


def _check_course(text: TomlText, settings: Settings) -> None:
    try:
        read_raced_course(settings.wall_follow, settings.map, settings.car)
    except MapError as error:
        raise text.mistake(("settings", "map", "file"), str(error)) from None


def _settings(text: TomlText, config: Path | None, assignments: Sequence[str], names: Sequence[str]) -> Settings:
    try:
        return load_settings(config or find_config(), assignments, laws=True)
    except ConditionsError as error:
        raise FileMistakeError(str(error)) from None
    except SettingsError as error:
        words = str(error).removeprefix("--set: ")
        named = max((name for name in names if name in words), key=len, default="")
        raise text.mistake(("settings", *named.split(".")), words) from None


def _conditions(text: TomlText, content: ScenarioContent) -> Conditions:
    if content.own_parts != NO_PARTS and "own_parts" in content.lidar:
        raise text.mistake(("lidar", "own_parts"), "own_parts is given twice; keep the one at the top of the file")
    try:
        parts = own_parts_fields(content.own_parts)
    except ConditionsError as error:
        raise text.mistake(("own_parts",), str(error).removeprefix("--own-parts ")) from None
    try:
        return Conditions.model_validate({"vehicle": content.vehicle, "lidar": {**parts, **content.lidar}})
    except ValidationError as error:
        first = error.errors(include_url=False)[0]
        models: dict[str, type[BaseModel]] = {"vehicle": VehicleSettings, "lidar": LidarSettings}
        unknown = first["type"] == "extra_forbidden"
        known = ", ".join(_keys_of(models[str(first["loc"][0])]))
        key = ".".join(map(str, first["loc"]))
        words = f"{key} is unknown here; there are {known}" if unknown else _sentence(first)
        raise text.mistake(tuple(first["loc"]), words) from None


def _world(text: TomlText, content: ScenarioContent, settings: Settings) -> World:
    side, walls = settings.wall_follow.side, [wall.segments_m() for wall in content.wall]
    if content.world == EMPTY:
        if not walls or content.start.at is None:
            raise text.mistake(("world",), "an empty world needs [[wall]] and [start] at = [x, y, heading]")
        return World(EMPTY, SegmentGeometry(np.vstack(walls)), Pose(*content.start.at), side)
    name = content.world
    if is_map(name) and not Path(name).is_absolute():
        name = str(text.path.parent / name)
    try:
        world = load_world(name, side=side, seed=content.seed)
    except (ValueError, OSError) as error:
        raise text.mistake(("world",), str(error)) from None
    if not walls:
        return world
    if not isinstance(world.geometry, SegmentGeometry):
        raise text.mistake(("wall", 0), "a map takes no further walls; put a box there as an [[obstacle]]")
    segments = np.vstack([world.geometry.segments_m, *walls])
    return replace(world, geometry=SegmentGeometry(segments, world.geometry.circles_m))


def _start(text: TomlText, start: ScenarioStart, world: World) -> Pose:
    place = ("start", "at") if start.at is not None else ("start", "distance_m")
    pose = (
        Pose(*start.at)
        if start.at is not None
        else world.start_at(distance_m=start.distance_m, toward_wall_rad=math.radians(start.toward_deg))
    )
    if world.collides(pose):
        raise text.mistake(place, f"the car would start in a wall of {world.name}; start somewhere free")
    if not world.clearance(pose) <= MAX_START_TO_WALL_M:
        left_m, bottom_m, right_m, top_m = world.bounds_m
        raise text.mistake(
            place,
            f"no wall is within {MAX_START_TO_WALL_M:.0f} m of the start; the walls of {world.name} lie at"
            f" x {left_m:.1f} to {right_m:.1f} m, y {bottom_m:.1f} to {top_m:.1f} m",
        )
    return pose


def _check_times(text: TomlText, content: ScenarioContent) -> None:
    """Check that everything happens before the end of the drive."""
    moments = [
        *((("obstacle", index), one.after_s) for index, one in enumerate(content.obstacle)),
        *((("fault", index), one.after_s) for index, one in enumerate(content.fault)),
        *((("expect", index), one.after_s) for index, one in enumerate(content.expect)),
    ]
    for place, after_s in moments:
        if after_s is not None and after_s >= content.duration_s:
            words = f"after_s = {after_s:g}: the drive ends at {content.duration_s:g} s"
            raise text.mistake((*place, "after_s"), words)
    for index, one in enumerate(content.expect):
        within_s = one.stands_within_s or one.drives_within_s or 0.0
        for name, ends_s in (("until_s", one.until_s or 0.0), (one.condition, one.after_s + within_s)):
            if ends_s > content.duration_s:
                words = f"{name}: that is {ends_s:g} s, and the drive ends at {content.duration_s:g} s"
                raise text.mistake(("expect", index, name), words)


def _check_laps(text: TomlText, content: ScenarioContent, world: World) -> None:
    """Check that laps are expected only where there are some."""
    for index, one in enumerate(content.expect):
        if one.condition in {"laps_at_least", "lap_below_s"} and world.lap is None:
            raise text.mistake(("expect", index, one.condition), f"{one.condition}: {world.name} has no lap")


def _check_obstacles(text: TomlText, obstacles: Sequence[Obstacle], world: World, start: Pose) -> None:
    """Check that no obstacle stands in the car at the start."""
    for index, one in enumerate(obstacles):
        scene = ObstacleWorld(world, (one,))
        scene.update(0.0, start, 0.0)
        if scene.collides(start):
            raise text.mistake(("obstacle", index), "it touches the car at the start; move one of them")
