"""One drive as a value, by the names of docs/sweeps.md. It can be pickled, is JSON, and has a stable key."""

import hashlib
import json
import math
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path
from typing import Any, TypeVar

from pydantic import BaseModel, ValidationError

from wallride.runtime.control.laws import LawStack, own_law_mistakes
from wallride.runtime.line_files import files_of_course, read_raced_course
from wallride.runtime.map_files import read_settings
from wallride.runtime.settings.tree import Settings, SettingsError, load_settings
from wallride.sim.car.vehicle_settings import VehicleSettings
from wallride.sim.lab.cell import Figures
from wallride.sim.lab.figures import common, errors
from wallride.sim.lab.laps import lap_times_s
from wallride.sim.lab.laws import assignments_of, check, own_law_files
from wallride.sim.scenario.obstacle_text import read_obstacle
from wallride.sim.scenario.scenario_file import MAX_START_TO_WALL_M
from wallride.sim.virtual.closed_loop import ROUGH_BEAMS, Case, SimulatedRun, drive
from wallride.sim.world.place import World
from wallride.sim.world.pose import Pose, Side
from wallride.sim.world.worlds import is_map, load_world

NAMES = (
    "world", "law", "side", "seed", "config", "duration_s", "way_m", "start.distance_m", "start.toward_deg",
    "latency_s", "obstacles", "standing_s",
)  # fmt: skip
"""Names of values that are neither conditions nor settings of the car."""
CONDITIONS = ("vehicle", "lidar")
DURATION_S, LATENCY_S = 30.0, 0.02
_KEY_DIGITS = 16
_M = TypeVar("_M", bound=BaseModel)


class LawError(Exception):
    """A law of one's own has failed; the text names file and line."""


class CellMistakeError(ValueError):
    """A value of a cell cannot be used. name: the value's."""

    def __init__(self, name: str, words: str) -> None:
        super().__init__(words)
        self.name = name


@dataclass(frozen=True, slots=True)
class DriveCell:
    """One drive; see the module. values: (name, value) in order of their names."""

    values: tuple[tuple[str, Any], ...]

    @classmethod
    def of(cls, values: Mapping[str, Any]) -> "DriveCell":
        """Return the cell of these values; lists become tuples."""
        return cls(tuple(sorted((name, _fixed(value)) for name, value in values.items())))

    def get(self, name: str, otherwise: Any = None) -> Any:  # noqa: ANN401 - any TOML value
        """Return a value, or another where the cell does not have it."""
        return next((value for known, value in self.values if known == name), otherwise)

    @property
    def text(self) -> str:
        """Return the cell as JSON, the same for the same cell on every machine."""
        return json.dumps(dict(self.values), sort_keys=True, separators=(",", ":"))

    @property
    def key(self) -> str:
        """Return the name of the cell in a table."""
        return digest(self.text)


@dataclass(frozen=True, slots=True, eq=False)
class DriveSetup:
    """What a cell stands for, checked: settings of the car, and the case without them."""

    settings: Settings
    case: Case
    with_safety: bool = True

    def digest(self) -> str:
        """Return a hash of all that decides the drive besides the cell and the code: defaults, own laws, maps."""
        law = f"{self.settings.wall_follow.method}+{self.settings.safety.method}"
        parts = [
            json.dumps(self.settings.model_dump(mode="json"), sort_keys=True),
            self.case.vehicle.model_dump_json(),
            self.case.lidar.model_dump_json(),
            *map(file_digest, own_law_files(law)),
        ]
        return digest("\n".join(parts))


def digest(text: str) -> str:
    """Return a short hash of a text."""
    return hashlib.sha256(text.encode()).hexdigest()[:_KEY_DIGITS]


@lru_cache(maxsize=64)
def file_digest(path: Path) -> str:
    """Return the hash of a file's content at its first reading."""
    return hashlib.sha256(path.read_bytes()).hexdigest()[:_KEY_DIGITS]


def settings_hash(cell: DriveCell, setup: DriveSetup) -> str:
    """Return the hash of a cell's conditions; of maps and a race line their files count."""
    world = str(cell.get("world", "loop"))
    files = (Path(world), read_settings(Path(world)).image) if is_map(world) else ()
    files = (*files, *files_of_course(setup.settings.map))
    return digest("\n".join([setup.digest(), *map(file_digest, files)]))


def setup_of(cell: DriveCell) -> DriveSetup:
    """Return the checked content of a cell; CellMistakeError names the value that is wrong."""
    settings = _settings(cell)
    side: Side = settings.wall_follow.side
    seed = cell.get("seed", 0)
    if isinstance(seed, bool) or not isinstance(seed, int) or seed < 0:
        raise CellMistakeError("seed", f"seed = {seed!r}: give a whole number from 0 on")
    with _about("map.file"):
        read_raced_course(settings.wall_follow, settings.map, settings.car)
    with _about("world"):
        world = _world(str(cell.get("world", "loop")), side, seed)
    with _about("obstacles"):
        obstacles = tuple(read_obstacle(str(text)) for text in _texts(cell.get("obstacles", ())))
    steering = {} if cell.get("vehicle.max_steering_rad") else {"max_steering_rad": settings.car.max_steering_rad}
    case = Case(
        world,
        start_of(cell, world),
        desired_m=settings.wall_follow.desired_distance_m,
        side=side,
        distance_m=_positive(cell, "way_m", math.inf),
        duration_s=_positive(cell, "duration_s", DURATION_S),
        standing_s=_positive(cell, "standing_s", math.inf),
        vehicle=_conditions(cell, "vehicle", VehicleSettings(**steering)),
        lidar=_conditions(cell, "lidar", ROUGH_BEAMS),
        car=settings.car,
        obstacles=obstacles,
        seed=seed,
        latency_s=_positive(cell, "latency_s", LATENCY_S),
    )
    return DriveSetup(settings, case, with_safety=not str(cell.get("law")).endswith("+none"))


def start_of(cell: DriveCell, world: World) -> Pose | None:
    """Return the start pose, None for the world's own; CellMistakeError for one in a wall."""
    distance_m, toward_deg = cell.get("start.distance_m"), cell.get("start.toward_deg", 0.0)
    if distance_m is None and not toward_deg:
        return None
    name = "start.distance_m" if distance_m is not None else "start.toward_deg"
    if not all(isinstance(value, int | float | None) for value in (distance_m, toward_deg)):
        raise CellMistakeError(name, "start.distance_m and start.toward_deg are numbers")
    pose = world.start_at(distance_m=distance_m, toward_wall_rad=math.radians(toward_deg))
    if not world.clearance(pose) <= MAX_START_TO_WALL_M:
        raise CellMistakeError(name, f"no wall is within {MAX_START_TO_WALL_M:g} m of the start")
    if world.collides(pose):
        at = "as usual" if distance_m is None else f"{distance_m:g} m from the followed wall"
        raise CellMistakeError(
            name, f"the car would start in a wall of {world.name}: {at}, turned {toward_deg:g} degrees towards it"
        )
    return pose


def _settings(cell: DriveCell) -> Settings:
    config = cell.get("config")
    for name in ("law", "config"):
        if not isinstance(cell.get(name, ""), str):
            raise CellMistakeError(name, f"{name} = {cell.get(name)!r}: write a text")
    for name, twice in (("law", "wall_follow.method"), ("law", "safety.method"), ("side", "wall_follow.side")):
        if None not in {cell.get(name), cell.get(twice)}:
            raise CellMistakeError(
                twice, f"{twice}: {name} = {cell.get(name)!r} says it already; leave one of them out"
            )
    with _about("law"):
        chosen = _law_assignments(cell.get("law"))
    assignments = _assignments(cell)
    try:
        return load_settings(Path(config) if config else None, [*chosen, *assignments], laws=True)
    except SettingsError as error:
        words = str(error).removeprefix("--set: ")
        raise CellMistakeError(_named_in(words, [name for name, _ in cell.values]), words) from None


def _named_in(words: str, names: Sequence[str]) -> str:
    """Return the longest of the names that a sentence has, "law" without one."""
    return max((name for name in names if name in words), key=len, default="law")


@contextmanager
def _about(name: str) -> Iterator[None]:
    """Turn the errors of a step into mistakes of a value."""
    try:
        yield
    except (TypeError, ValueError, OSError) as error:
        raise CellMistakeError(name, str(error)) from None


def drive_setup(setup: DriveSetup) -> SimulatedRun:
    """Drive it in virtual time; LawError where an own law fails."""
    settings = setup.settings
    wall_follow, safety, car = settings.wall_follow, settings.safety, settings.car
    if mistakes := own_law_mistakes(wall_follow, safety, car):
        raise LawError("; ".join(mistakes))
    laws = LawStack(wall_follow, safety, car, course=read_raced_course(wall_follow, settings.map, car))
    driven = drive(setup.case, laws.follower, laws.judge if setup.with_safety else None)
    if laws.own_law_fault:
        raise LawError(laws.own_law_fault)
    return driven


def measure(cell: DriveCell) -> Figures:
    """Drive a cell and return its figures: the work of `submit`."""
    driven = drive_setup(setup_of(cell))
    times_s = lap_times_s(driven)
    return {
        **common(driven),
        **errors(driven),
        "laps": len(times_s),
        "best_lap_s": min(times_s[1:] or times_s, default=None),
    }


def _texts(value: Any) -> tuple[Any, ...]:  # noqa: ANN401 - whatever stood in the file
    if not isinstance(value, tuple):
        raise TypeError(f'obstacles = {value!r}: write a list of texts, for example ["box ahead=1 after=3"]')
    return value


def _law_assignments(law: str | None) -> list[str]:
    if law is None:
        return []
    if check(law).startswith("prototype+"):
        raise ValueError("law prototype has no settings; write ball, report or MODULE:CLASS")
    return assignments_of(law)


def _assignments(cell: DriveCell) -> list[str]:
    side = [f"wall_follow.side={cell.get('side')}"] if cell.get("side") else []
    return side + [
        f"{name}={json.dumps(value)}"
        for name, value in cell.values
        if name not in NAMES and name.partition(".")[0] not in CONDITIONS
    ]


def _conditions(cell: DriveCell, section: str, below: _M) -> _M:
    """Return the conditions of a section on top of others."""
    fields = {name.partition(".")[2]: value for name, value in cell.values if name.partition(".")[0] == section}
    try:
        return type(below).model_validate({**below.model_dump(), **fields})
    except ValidationError as error:
        first = error.errors(include_url=False)[0]
        known = ", ".join(type(below).model_fields)
        told = first["msg"].removeprefix("Value error, ")
        words = f"is unknown; there are {known}" if first["type"] == "extra_forbidden" else told
        name = f"{section}.{first['loc'][0] if first['loc'] else ''}"
        raise CellMistakeError(name, f"{name} = {first['input']!r}: {words}") from None


def _positive(cell: DriveCell, name: str, otherwise: float) -> float:
    value = cell.get(name, otherwise)
    if isinstance(value, bool) or not isinstance(value, int | float) or not value > 0:
        raise CellMistakeError(name, f"{name} = {value!r}: give a number above 0")
    return float(value)


@lru_cache(maxsize=16)
def _loaded_world(name: str, side: Side, seed: int) -> World:
    return load_world(name, side=side, seed=seed)


def _world(name: str, side: Side, seed: int) -> World:
    """Return a world; one whose seed does not matter is made once per process."""
    return _loaded_world(name, side, seed if name == "cluttered" else 0)


def _fixed(value: Any) -> Any:  # noqa: ANN401 - any TOML value
    return tuple(map(_fixed, value)) if isinstance(value, list | tuple) else value
