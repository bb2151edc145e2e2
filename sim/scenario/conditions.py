"""Conditions of a simulated drive: floor, tyres, lidar and obstacles, as settings that can be named one by one.

A settings file has the sections [vehicle], [lidar] and [wiring] with the fields of `VehicleSettings`, `LidarSettings`
and `WiringErrors`, and a list `obstacles` of texts (`wallride.sim.scenario.obstacle_text`). Options of the command line
come on top.
"""

import difflib
import json
import tomllib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from pydantic import ValidationError, field_validator

from wallride.drivers.section import Section
from wallride.runtime.host.text_file import read_text
from wallride.runtime.settings.tree import read_value
from wallride.sim.car.vehicle_settings import VehicleSettings
from wallride.sim.car.wiring import NO_ERRORS, WiringErrors
from wallride.sim.scenario.obstacle_text import read_obstacle
from wallride.sim.world.beams import LidarSettings
from wallride.sim.world.obstacles import Obstacle
from wallride.sim.world.own_parts import OWN_PARTS

RIGHT_REAR = "right-rear"
"""Name of the only own parts without a profile: a rough part at 0.03 to 0.15 m in the last beams on the right."""
NO_PARTS = "none"
DIRT_RANGE_M = 0.05
NEAR = 0.55
"""Similarity from which a name is suggested: of mas and mass_kg it is 0.6."""
_DIRT_NUMBERS = (2, 3)


class ConditionsError(ValueError):
    """Invalid conditions; the text names the key and the remedy."""


class Conditions(Section):
    """Conditions at the start of a drive.

    wiring: errors of the car's settings. obstacles: texts as of `wallride.sim.scenario.obstacle_text`.
    """

    vehicle: VehicleSettings = VehicleSettings()
    lidar: LidarSettings = LidarSettings()
    wiring: WiringErrors = NO_ERRORS
    obstacles: tuple[str, ...] = ()

    @field_validator("obstacles")
    @classmethod
    def _readable(cls, texts: tuple[str, ...]) -> tuple[str, ...]:
        for text in texts:
            read_obstacle(text)
        return texts

    def changed(self) -> dict[str, Any]:
        """Return the differences from the defaults, as plain values; {} for an ordinary drive."""
        return self.model_dump(mode="json", exclude_defaults=True)

    def things(self) -> list[Obstacle]:
        """Return the obstacles."""
        return [read_obstacle(text) for text in self.obstacles]


@dataclass(frozen=True, slots=True)
class RequestedConditions:
    """Conditions from the command line. assignments: SECTION.KEY=VALUE. dirt: FROM,TO[,RANGE] in degrees."""

    file: Path | None = None
    assignments: Sequence[str] = ()
    friction: float | None = None
    noise_m: float | None = None
    dropouts: float | None = None
    trim_rad: float | None = None
    delay_s: float | None = None
    own_parts: str | None = None
    dirt: Sequence[str] = ()
    obstacles: Sequence[str] = field(default_factory=tuple)


def conditions_of(wishes: RequestedConditions) -> Conditions:
    """Return the conditions of a file, of options, or of neither; ConditionsError when any of them is unusable."""
    tree = _read(wishes.file) if wishes.file is not None else {}
    for assignment in wishes.assignments:
        _assign(tree, assignment)
    for key, value in _named(wishes).items():
        _put(tree, key, value)
    if wishes.own_parts is not None:
        for name, value in own_parts_fields(wishes.own_parts).items():
            _put(tree, f"lidar.{name}", value)
    if wishes.obstacles:
        tree["obstacles"] = [*tree.get("obstacles", ()), *wishes.obstacles]
    return checked_conditions(tree)


def checked_conditions(tree: Mapping[str, Any]) -> Conditions:
    """Return the conditions of a tree of sections; ConditionsError for the first value that is none."""
    try:
        return Conditions.model_validate(tree)
    except ValidationError as error:
        first = error.errors(include_url=False)[0]
        where = ".".join(str(part) for part in first["loc"])
        words = _no_such(where) if first["type"] == "extra_forbidden" else _plain(first["msg"])
        raise ConditionsError(f"{where} = {first['input']!r}: {words}") from None


def _no_such(key: str) -> str:
    """Return the sentence about an unknown key, with the nearest known one and all beside it."""
    section, dot, name = key.rpartition(".")
    model = Conditions.model_fields[section].annotation if section else Conditions
    known = list(getattr(model, "model_fields", ()))
    near = difflib.get_close_matches(name, known, 1, NEAR)
    meant = f"did you mean {section}{dot}{near[0]}? " if near else ""
    return f"there is no such condition; {meant}known here: {', '.join(known)}"


def named_conditions(wishes: RequestedConditions) -> tuple[str, ...]:
    """Return what a file and options name, checked, as SECTION.KEY=VALUE texts with JSON values, for `put_on_top`.

    ConditionsError when any of it is unusable; obstacles are, because they belong to one drive.
    """
    named = conditions_of(wishes).model_dump(mode="json", exclude_unset=True)
    if named.pop("obstacles", None):
        raise ConditionsError("obstacles: are for one drive (wallride sim); the lab's courses have their own")
    return tuple(
        f"{section}.{key}={json.dumps(value)}"
        for section, some in sorted(named.items())
        for key, value in sorted(some.items())
    )


def named_value(conditions: Sequence[str], key: str) -> Any:  # noqa: ANN401 - any JSON value
    """Return the value of a key in what `named_conditions` returned, None where it is not named."""
    found = (text.partition("=")[2] for text in conditions if text.partition("=")[0] == key)
    return next(map(json.loads, found), None)


def named_once(conditions: Sequence[str], key: str, option: str, given: Any) -> Any:  # noqa: ANN401 - of an option
    """Return what an option gives or the conditions name, None for neither; ConditionsError for both."""
    named = named_value(conditions, key)
    if given is not None and named is not None:
        raise ConditionsError(f"{option} {given}: the conditions have {key} = {named} already; leave one of them out")
    return given if named is None else named


def put_on_top(
    conditions: Sequence[str], vehicle: VehicleSettings, lidar: LidarSettings
) -> tuple[VehicleSettings, LidarSettings]:
    """Return a car and a lidar with the named conditions in place of their own."""
    tree: dict[str, Any] = {"vehicle": vehicle.model_dump(), "lidar": lidar.model_dump()}
    for text in conditions:
        key, _, value = text.partition("=")
        _put(tree, key, json.loads(value))
    made = Conditions.model_validate(tree)
    return made.vehicle, made.lidar


def own_parts_kinds() -> tuple[str, ...]:
    """Return the names of the kinds of own parts of this simulator."""
    return (*OWN_PARTS, RIGHT_REAR)


def own_parts_fields(kind: str) -> dict[str, Any]:
    """Return the lidar's fields for one kind of own parts; ConditionsError when there is no such kind."""
    if kind not in own_parts_kinds():
        raise ConditionsError(f"--own-parts {kind}: write one of {', '.join(own_parts_kinds())}")
    rough = kind == RIGHT_REAR
    return {"self_returns": rough, "own_parts": NO_PARTS if rough else kind}


def own_parts_of(lidar: LidarSettings) -> str:
    """Return the kind of own parts that a lidar sees."""
    return RIGHT_REAR if lidar.self_returns else lidar.own_parts


def read_dirt(text: str) -> tuple[float, float, float]:
    """Return a dirty sector (from_deg, to_deg, range_m) from FROM,TO[,RANGE]; ConditionsError for other texts."""
    try:
        numbers = [float(part) for part in text.split(",")]
    except ValueError:
        numbers = []
    if len(numbers) not in _DIRT_NUMBERS or not numbers[0] < numbers[1]:
        raise ConditionsError(f"--dirt {text}: write FROM,TO or FROM,TO,RANGE [deg, deg, m], for example --dirt -10,5")
    return numbers[0], numbers[1], numbers[2] if len(numbers) > 2 else DIRT_RANGE_M


def _named(wishes: RequestedConditions) -> dict[str, Any]:
    """Return the settings behind the short options, as far as they were given."""
    values = {
        "vehicle.grip_mu": wishes.friction,
        "lidar.noise_std_m": wishes.noise_m,
        "lidar.dropout_share": wishes.dropouts,
        "vehicle.trim_rad": wishes.trim_rad,
        "vehicle.steering_delay_s": wishes.delay_s,
        "vehicle.drive_delay_s": wishes.delay_s,
        "lidar.dirty_sectors": [read_dirt(text) for text in wishes.dirt] or None,
    }
    return {key: value for key, value in values.items() if value is not None}


def _read(path: Path) -> dict[str, Any]:
    try:
        return tomllib.loads(read_text(path))
    except OSError as error:
        raise ConditionsError(f"--conditions {path}: cannot be read ({error.strerror})") from None
    except (RecursionError, ValueError) as error:
        raise ConditionsError(f"--conditions {path}: is not valid TOML: {error}") from None


def _assign(tree: dict[str, Any], assignment: str) -> None:
    key, equals, text = assignment.partition("=")
    if not equals or key.count(".") != 1:
        raise ConditionsError(f"--condition {assignment}: write vehicle.KEY=VALUE, lidar.KEY=VALUE or wiring.KEY=VALUE")
    _put(tree, key.strip(), read_value(text))


def _put(tree: dict[str, Any], key: str, value: Any) -> None:  # noqa: ANN401 - checked when the tree is validated
    section, _, name = key.partition(".")
    fields = tree.setdefault(section, {})
    if not isinstance(fields, Mapping):
        raise ConditionsError(f"{section} = {fields!r}: is a section; write [{section}] and its keys below")
    tree[section] = {**fields, name: value}


def _plain(message: str) -> str:
    message = message.removeprefix("Value error, ")
    return f"{message[:1].lower()}{message[1:]}"
