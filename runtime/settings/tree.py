"""The settings tree: frozen, closed, and checked before the wheels can turn.

It mirrors the TOML file section by section; drivers bring their own part. A wrong key is an error that names the
key, never a silent default. Layers, later ones winning: defaults here, the file, what was saved, `--set KEY=VALUE`.
"""

import difflib
import json
import tomllib
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from types import MappingProxyType
from typing import Annotated, Any, Literal

from pydantic import Field, ValidationError, field_validator, model_validator

from wallride.drivers.hokuyo.settings import HokuyoSettings
from wallride.drivers.pwm.settings import PwmSettings
from wallride.drivers.section import Section
from wallride.drivers.vesc.settings import VescSettings
from wallride.runtime.arbitration.command import LAB_ORDER, Source
from wallride.runtime.control.battery import BatterySettings
from wallride.runtime.control.method_settings import (
    METHODS,
    OWN_METHODS,
    TAGS,
    BallFollowSettings,
    ChosenSafety,
    ChosenWallFollow,
    SweptSafetySettings,
    kept_by_new_method,
)
from wallride.runtime.control.own_laws.law_class import OWN_TAG, known_law
from wallride.runtime.control.vehicle import NAME_RULE, CarSettings
from wallride.runtime.host.text_file import TextFileError, read_text
from wallride.runtime.own_drivers.driver_class import known_driver
from wallride.runtime.settings.devices import (
    DEFAULT_DRIVERS,
    DRIVER_TAGS,
    DRIVERS,
    OWN_DRIVERS,
    ChosenLidar,
    ChosenMotor,
    share_an_address,
)
from wallride.runtime.settings.imports import import_named, search_beside
from wallride.runtime.settings.operator import JoystickSettings, OperatorSettings, PlannerSettings
from wallride.runtime.settings.pose_map import PoseMapSettings
from wallride.runtime.settings.recording import RecordingSettings
from wallride.runtime.settings.session import ParameterSettings, SessionSettings
from wallride.runtime.settings.telemetry import Ros2Settings, TelemetryRates
from wallride.runtime.wire.rmw_zenoh import ROS2_PLANNER, RosGraph, node_name

_TAGS = TAGS | DRIVER_TAGS

GONE = frozenset({"process.prefetch"})
"""Settings that older files may hold, and that have no effect any more."""


class SettingsError(Exception):
    """The settings cannot be used; the text names each key or path and the remedy.

    wrong: the sections with a mistake; empty where it is of no single section, or nothing could be read.
    right: what the other sections say.
    """

    def __init__(self, text: str, wrong: Iterable[str] = (), tree: Mapping[str, Any] = MappingProxyType({})) -> None:
        super().__init__(text)
        self.wrong = frozenset(wrong)
        self.right = {name: values for name, values in tree.items() if name not in self.wrong}


class MuxSettings(Section):
    """Priority order of the sources, and rate of the output's renewal without new commands."""

    order: tuple[Source, ...] = LAB_ORDER
    """Priority order of the sources, most urgent first; the battery follows the e-stop."""
    tick_hz: Annotated[float, Field(ge=20, le=200)] = 50.0
    """Rate of the mux's decisions without new scans or commands."""

    @field_validator("order")
    @classmethod
    def _complete(cls, order: tuple[Source, ...]) -> tuple[Source, ...]:
        if sorted(order) != sorted(LAB_ORDER):
            raise ValueError(f"must name each of {', '.join(LAB_ORDER)} exactly once")
        if order[0] is not Source.ESTOP:
            raise ValueError("must begin with e-stop: nothing outranks an emergency stop")
        if order.index(Source.NAVIGATION) < max(order.index(Source.SAFETY), order.index(Source.PERMIT)):
            raise ValueError("must have safety and permit before navigation, or they would not bind it")
        if order.index(Source.PERMIT) < order.index(Source.TELEOP):
            raise ValueError("must have teleop before permit: while a human drives the permit is refused")
        return order


class TelemetrySettings(TelemetryRates, SessionSettings):
    """Topics sent over zenoh, and the endpoints."""

    enabled: bool = True
    """Use the network; false: no status, no teleop, no page."""


class LogSettings(Section):
    """Log messages on standard error."""

    level: Literal["DEBUG", "INFO", "WARNING", "ERROR"] = "INFO"
    """Minimum severity of a log message."""
    format: Literal["text", "json"] = "text"
    """Format of the log: lines of text, or JSON."""


class ProcessSettings(Section):
    """Use of the computer by the process."""

    state_folder: str = ""
    """Folder of the learnt own parts; empty: the service's state directory, or none."""

    laws_folder: str = ""
    """Folder of your own laws, looked into after the working directory, the settings file's, and `laws` beside it."""

    stay_awake: bool = True
    """Keep the processor out of deep idle states between scans: shorter latency, a little more power."""

    rehearse: bool = True
    """Answer each scan once more, to no wire, shortly before the next: shorter latency, more CPU."""


class Settings(Section):
    """All settings, as one frozen value."""

    car: CarSettings = CarSettings()
    lidar: ChosenLidar = HokuyoSettings()
    motor: ChosenMotor = VescSettings()
    wall_follow: ChosenWallFollow = BallFollowSettings()
    safety: ChosenSafety = SweptSafetySettings()
    battery: BatterySettings = BatterySettings()
    map: PoseMapSettings = PoseMapSettings()
    mux: MuxSettings = MuxSettings()
    operator: OperatorSettings = OperatorSettings()
    joystick: JoystickSettings = JoystickSettings()
    telemetry: TelemetrySettings = TelemetrySettings()
    ros2: Ros2Settings = Ros2Settings()
    planners: PlannerSettings = PlannerSettings()
    log: LogSettings = LogSettings()
    process: ProcessSettings = ProcessSettings()
    parameters: ParameterSettings = ParameterSettings()
    recording: RecordingSettings = RecordingSettings()

    def ros2_graph(self) -> RosGraph | None:
        """Return the ROS 2 domain and the car's node in it; None where the face is off."""
        ros2 = self.ros2
        return RosGraph(ros2.domain, ros2.distro, node_name(self.car.name)) if ros2.enabled else None

    def effective_order(self) -> tuple[Source, ...]:
        """Return the mux's order, with battery and motor, safety above the human by `safety.binds_teleop`."""
        order: list[Source] = [source for source in self.mux.order if source is not Source.SAFETY]
        position = self.mux.order.index(Source.SAFETY)
        if self.safety.binds_teleop:
            position = min(position, order.index(Source.TELEOP))
        order.insert(position, Source.SAFETY)
        order[1:1] = [Source.BATTERY, Source.MOTOR] if isinstance(self.motor, PwmSettings) else [Source.BATTERY]
        if self.planners.enabled:
            position = order.index(Source.NAVIGATION)
            order[position:position] = [Source.PLANNER, Source.PLANNER_HOLD]
        return tuple(order)

    @model_validator(mode="after")
    def _scans_need_a_session(self) -> "Settings":
        if self.lidar.driver == "topic" and not (self.ros2.enabled and self.telemetry.enabled):
            raise ValueError('lidar.driver = "topic" needs ros2.enabled = true and telemetry.enabled = true')
        return self

    @model_validator(mode="after")
    def _one_device_an_address(self) -> "Settings":
        if share_an_address(self.lidar, self.motor):
            raise ValueError("lidar.address and motor.address are the same: name the port of each device")
        return self

    @model_validator(mode="after")
    def _drive_needs_its_parts(self) -> "Settings":
        if self.ros2.drive and not (self.ros2.enabled and self.planners.enabled):
            raise ValueError("ros2.drive needs ros2.enabled = true and planners.enabled = true")
        return self

    def planner_names(self) -> tuple[str, ...]:
        """Return the planners that may register, most urgent first; ROS 2's is the last where it is not named."""
        names = self.planners.names if self.planners.enabled else ()
        return (*names, ROS2_PLANNER) if self.ros2.drive and ROS2_PLANNER not in names else names


def load_settings(
    path: Path | None, assignments: Sequence[str] = (), saved: Path | None = None, *, laws: bool = False,
    drivers: bool = False,
) -> Settings:  # fmt: skip
    """Build the tree from a file and `KEY=VALUE` texts; SettingsError when any part of it is unusable.

    saved: a second file on top of the first, where changes are saved; it need not exist yet. laws: import the own laws
        that the settings name, for what drives or judges; drivers: and the own drivers, for what opens devices;
        without these no code of the user runs.
    """
    tree: dict[str, Any] = read_tree(path) if path is not None else {}
    above = read_tree(saved) if saved is not None and saved.exists() else {}
    name = f"{path}" if path is not None else "the settings"
    layers = {f"{saved}": above}
    if laws or drivers:
        search_beside(path)
    return settings_from(layered(tree, above), assignments, laws=laws, drivers=drivers, name=name, layers=layers)


def settings_from(
    tree: Mapping[str, Any], assignments: Sequence[str] = (), *, laws: bool, name: str, drivers: bool = False,
    layers: Mapping[str, Mapping[str, Any]] = MappingProxyType({}),
) -> Settings:  # fmt: skip
    """Build the tree from a file's content; the rest as `load_settings`.

    name: of the file in errors. layers: by name, what is already in the tree and is to blame before the file.
    """
    said: dict[str, Any] = {}
    for assignment in assignments:
        _assign(said, assignment)
    tree = layered(tree, said)
    mistakes: list[Any] = import_named(tree, laws=laws, drivers=drivers)
    settings = None
    try:
        settings = Settings.model_validate(tree)
    except ValidationError as error:
        mistakes += error.errors()
    if settings is not None and not mistakes:
        return settings
    sources = (("--set", said), *layers.items())
    found: dict[str, dict[str, None]] = {}
    for item in mistakes:
        where = next((at for at, layer in sources if item["loc"] and _holds(layer, item["loc"])), name)
        said_there = found.setdefault(where, {})  # once: the import and the type check a law's name alike
        said_there[_sentence(item, tree)] = None
    text = "; ".join(f"{where}: {'; '.join(lines)}" for where, lines in found.items())
    raise SettingsError(text, (str(item["loc"][0]) for item in mistakes if item["loc"]), tree)


def in_file(place: Sequence[str | int]) -> list[str | int]:
    """Return the place of an error as a file has it: without the tag that says which law or driver was read."""
    chosen = place[:1] and place[0] in {*METHODS, *DRIVERS}
    return [part for at, part in enumerate(place) if not (chosen and at == 1 and part in _TAGS)]


def _holds(layer: Mapping[str, Any], place: Sequence[str | int]) -> bool:
    """Whether a layer says the value at a place of the tree, which may hold the tag of a method."""
    value: Any = layer
    for part in in_file(place):
        if not isinstance(value, dict):
            return True  # the layer gives the whole of what the place is in: a list, or a wrong value
        if part not in value:
            return False
        value = value[part]
    return True


def layered(below: Mapping[str, Any], above: Mapping[str, Any]) -> dict[str, Any]:
    """Return the merge of two trees. A law selected above keeps from below only what means the same in every law."""
    tree = dict(below)
    for name, value in above.items():
        under = tree.get(name)
        if not isinstance(value, dict) or not isinstance(under, dict):
            tree[name] = value
            continue
        before = _method(name, under) if name in METHODS else None
        if name in METHODS and value.get("method", before) != before:
            kept = kept_by_new_method(name, before, value["method"])
            under = {key: one for key, one in under.items() if key in kept}
        if name in DRIVERS and value.get("driver", under.get("driver")) != under.get("driver", DEFAULT_DRIVERS[name]):
            under = {}  # address and mounting are those of the other device
        tree[name] = layered(under, value)
    return tree


def _method(section: str, values: Mapping[str, Any]) -> object:
    return values.get("method", getattr(Settings(), section).method)


def read_tree(path: Path) -> dict[str, Any]:
    """Return a file's content, not yet checked; SettingsError when it cannot be read."""
    try:
        return tomllib.loads(read_text(path))
    except FileNotFoundError:
        raise SettingsError(f"{path}: no such file; see config/car.toml for one to start from") from None
    except IsADirectoryError:
        raise SettingsError(f"{path}: is a directory; name the .toml file in it") from None
    except OSError as error:
        raise SettingsError(f"{path}: cannot be read ({error.strerror}); check its owner and mode") from None
    except TextFileError as error:
        raise SettingsError(f"{path}: is not a settings file: {error}") from None
    except tomllib.TOMLDecodeError as error:
        raise SettingsError(f"{path}: is not valid TOML: {error}") from None
    except (RecursionError, ValueError) as error:  # thousands of brackets, or of digits
        raise SettingsError(f"{path}: is not a settings file: {_too_much(error)}") from None


def _too_much(error: Exception) -> str:
    return "its brackets are nested too deeply" if isinstance(error, RecursionError) else "a number is too long"


def _assign(tree: dict[str, Any], assignment: str) -> None:
    key, equals, text = assignment.partition("=")
    names = key.strip().split(".")
    if not equals or not all(names):
        raise SettingsError(f"--set {assignment}: write SECTION.KEY=VALUE, for example wall_follow.side=right")
    for name in names[:-1]:
        branch = tree.setdefault(name, {})
        if not isinstance(branch, dict):
            raise SettingsError(f"--set {assignment}: {name} is a value, not a section")
        tree = branch
    tree[names[-1]] = read_value(text.strip())


def read_value(text: str) -> object:
    """Read a value as TOML would, or as bare text: `right` and `"right"` are the same."""
    try:
        return tomllib.loads(f"value = {text}")["value"]
    except (RecursionError, ValueError):
        return text


def _sentence(error: Mapping[str, Any], tree: Mapping[str, Any]) -> str:
    """Format one pydantic error: key, problem, remedy."""
    path = in_file(error["loc"])
    key = ".".join(str(part) for part in path)
    if key in GONE:
        return f"{key} is not a setting any more; delete it"
    if error["type"] == "extra_forbidden":
        known = _known_keys(error["loc"][:-1], tree)
        near = difflib.get_close_matches(str(path[-1]), known, 1)
        meant = f"did you mean {'.'.join([*map(str, path[:-1]), near[0]])}? " if near else ""
        others = _methods_with(str(path[0]), str(path[-1])) if len(path) > 1 else []
        if others and not meant:
            own = not path[1:-1] and path[0] in DRIVERS and OWN_TAG in error["loc"]
            remedy = f"delete it, or write it below [{path[0]}.own]" if own else "delete it"
            return f"{key} is a setting of {' and '.join(others)}; {remedy}. Known here: {', '.join(known)}"
        return f"{key} is not a setting; {meant}known here: {', '.join(known)}"
    if error["type"] == "union_tag_invalid":
        choice = "driver" if key in DRIVERS else "method"
        return f"{key}.{choice} = '{error['ctx']['tag']}': input should be {error['ctx']['expected_tags']}"
    if error["type"] in {"model_type", "model_attributes_type"}:
        return f"{key} = {error['input']!r}: is a section; write [{key}] and its keys below, or {key}.KEY=VALUE"
    if key == "car.name" and error["type"] == "string_pattern_mismatch":
        return f"{key} = {error['input']!r}: must be {NAME_RULE}, for example car1"
    message = str(error["msg"]).removeprefix("Value error, ")
    if not path:  # of several sections
        return message
    if isinstance(error["input"], dict):  # of several of its settings
        return f"[{key}]: {message}"
    return f"{key} = {error['input']!r}: {message[:1].lower()}{message[1:]}"


def _methods_with(section: str, key: str) -> list[str]:
    """Return the built-in methods, or the drivers, of a section that have a key."""
    choices = (("method", METHODS), ("driver", DRIVERS))
    return [
        str(model.model_fields[choice].default)
        for choice, models in choices
        for model in models.get(section, ())
        if key in model.model_fields
    ]


def _known_keys(path: Sequence[str | int], tree: Mapping[str, Any]) -> list[str]:
    """Return the keys of the section in which an unknown one was found; `path` may hold the tag of a method."""
    section: Any = Settings
    if path[1:3] == (OWN_TAG, "own"):
        name = str(path[0])
        user = known_driver(name, tree[name]["driver"]) if name in DRIVERS else known_law(name, tree[name]["method"])
        return list(user.model.model_fields) if user is not None else []
    for part in path:
        if part == OWN_TAG:
            section = {**OWN_METHODS, **OWN_DRIVERS}[str(path[0])]
        elif part in _TAGS:
            choice = "driver" if part in DRIVER_TAGS else "method"
            section = next(model for model in section if model.model_fields[choice].default == part)
        else:
            section = METHODS.get(str(part)) or DRIVERS.get(str(part)) or section.model_fields[part].annotation
    return list(section.model_fields)


def to_toml(settings: Settings) -> str:
    """Return the effective settings as a TOML file that can be loaded again."""
    lines: list[str] = []
    for section, values in settings.model_dump(mode="json").items():
        lines += _table(section, values)
    return "\n".join(lines)


def _table(name: str, values: Mapping[str, Any]) -> list[str]:
    """Return one section and the ones below it; the method, which decides what the other keys are, comes first."""
    plain = {key: value for key, value in values.items() if not isinstance(value, dict)}
    keys = sorted(plain, key=lambda key: key not in {"method", "driver"})
    # A JSON string, number, boolean or list of them is also a TOML one.
    lines = [f"[{name}]", *(f"{key} = {json.dumps(plain[key])}" for key in keys), ""]
    for key, value in values.items():
        if isinstance(value, dict):
            lines += _table(f"{name}.{key}", value)
    return lines
