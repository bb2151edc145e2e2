"""`wallride import`: the ROS parameter files of a lab or a team, as our settings."""

import argparse
import sys
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

from wallride.failure import fail, needs
from wallride.parser import Commands
from wallride.runtime.host.terminal_text import say

if TYPE_CHECKING:
    from wallride.bringup.ros_mapping import Imported
    from wallride.runtime.ros.yaml_file import YamlFile

MAX_SPEED = "car.max_speed_mps"
MAP_KEYS = frozenset({"image", "resolution", "origin"})
"""Keys of the maps of ROS's map_server."""
KINDS = ("generic", "mit-racecar-v2", "f1tenth", "donkeycar", "racecar-neo", "mushr")


def add(commands: Commands) -> None:
    """Add the command and its options."""
    parser = commands.add_parser(
        "import",
        help="ROS parameter files (vesc.yaml, params.yaml, joy_teleop.yaml) as our settings",
        description="Reads ROS 1 and ROS 2 parameter files, prints our settings, and says on standard error what was"
        " not taken and why. Later files count before earlier ones.",
    )
    parser.set_defaults(run=run)
    parser.add_argument(
        "files", nargs="*", type=Path, metavar="FILE", help="YAML file; none with --car: the kind alone"
    )
    parser.add_argument("--car", choices=KINDS, help="begin with a kind of car: config/cars")
    parser.add_argument(
        "--output", type=Path, metavar="FILE.toml",
        help="write the settings there; an existing file keeps its comments and other settings",
    )  # fmt: skip


def run(options: argparse.Namespace) -> int:
    """Convert; exit code 2 with one line where a file or a value cannot be used."""
    from wallride.runtime.parameters.file import StoreError
    from wallride.runtime.settings.tree import SettingsError

    if not options.files and options.car is None:
        return fail("name a file, or a kind of car with --car")
    try:
        imported = _converted(options.files)
        text = _written(imported, options)
    except (SettingsError, StoreError, ImportFailure) as error:
        return fail(str(error))
    except OSError as error:
        return fail(f"{error.filename}: {error.strerror}")
    for why in dict.fromkeys(why for _, why in imported.left):
        names = ", ".join(name for name, its in imported.left if its == why)
        say(f"not taken  {names}: {why}", file=sys.stderr)
    for remark in imported.remarks:
        say(f"look at    {remark}", file=sys.stderr)
    if options.output is None:
        print(text, end="")
    else:
        print(f"{options.output}: {len(imported.settings)} settings taken; next: wallride check {options.output}")
    return 0


class ImportFailure(Exception):  # noqa: N818 - what happened, not a kind of error
    """A file that is no parameter file; the text names it."""


def _converted(files: list[Path]) -> "Imported":
    from wallride.bringup.ros_mapping import RosParameter, convert, parameters
    from wallride.runtime.ros.yaml_file import mappings

    found: list[RosParameter] = []
    notes: list[str] = []
    for file in files:
        content = _read(file)
        notes += (f"{file}, {note}" for note in content.notes)
        for tree in mappings(content):
            found += parameters(tree)
    imported = convert(found)
    imported.remarks[:0] = notes
    return imported


def _read(file: Path) -> "YamlFile":
    with needs("car", "parameter files need"):
        import ruamel.yaml  # noqa: F401 - its absence is told with its remedy
    from wallride.runtime.ros.yaml_file import YamlFileError, mappings, read_yaml

    try:
        content = read_yaml(file)
    except YamlFileError as error:
        raise ImportFailure(str(error)) from None
    if not any(mappings(content)):
        raise ImportFailure(f"{file}: holds no parameters")
    if any(tree.keys() >= MAP_KEYS for tree in mappings(content)):
        raise ImportFailure(f'{file}: is a map, not parameters: name it in the settings, map.file = "{file}"')
    return content


def _written(imported: "Imported", options: argparse.Namespace) -> str:
    """Return the text of the settings, checked as a whole; written to the output where one is named."""
    import tempfile
    import tomllib

    from wallride.runtime.parameters.file import replace
    from wallride.runtime.parameters.toml_text import set_value
    from wallride.runtime.settings.tree import SettingsError, load_settings
    from wallride.service.parts import shipped

    output: Path | None = options.output
    if output is not None and output.is_file() and options.car is not None:
        raise ImportFailure(f"{output}: is there already, and --car begins a new file; take another name")
    if output is not None and output.is_file():
        base = output.read_bytes().decode()
    elif options.car is not None:
        base = shipped(f"config/cars/{options.car}.toml").read_text(encoding="utf-8")
    else:
        base = ""
    text = base
    try:
        document = tomllib.loads(base)
        _keep_the_speed_limit(imported, document)
        _lengthen(imported, document)
        for key, value in imported.settings.items():
            text = set_value(text, tuple(key.split(".")), value)
    except (RecursionError, ValueError) as error:
        raise ImportFailure(f"{output}: is not TOML that can be edited: {error}") from None
    with tempfile.TemporaryDirectory() as folder:
        trial = Path(folder) / "imported.toml"
        trial.write_text(text, encoding="utf-8")
        try:
            load_settings(trial)
        except SettingsError as error:
            raise ImportFailure(str(error).replace(f"{trial}: ", "what was read: ")) from None
    if output is not None:
        replace(output, text.encode(), like=output.stat() if output.exists() else None)
    return text


def _lengthen(imported: "Imported", document: Mapping[str, Any]) -> None:
    """Take a longer car for a longer wheelbase: parameters of ROS do not have its ends."""
    from wallride.runtime.control.vehicle import CarSettings

    usual, wheelbase_m, car = CarSettings(), imported.settings.get("car.wheelbase_m"), document.get("car")
    has_front = "car.front_m" in imported.settings or (isinstance(car, Mapping) and "front_m" in car)
    if isinstance(wheelbase_m, float) and wheelbase_m > usual.front_m and not has_front:
        front_m = round(wheelbase_m + usual.front_m - usual.wheelbase_m, 3)
        imported.take("car.front_m", front_m, "as far beyond the front axle as usual: measure it")


def _keep_the_speed_limit(imported: "Imported", document: Mapping[str, Any]) -> None:
    """Take no limit that is above the present one: clamps of ERPM are often those of the motor, not of a car."""
    from wallride.runtime.control.vehicle import CarSettings

    speed_mps = imported.settings.get(MAX_SPEED)
    car = document.get("car")
    present_mps = car.get("max_speed_mps") if isinstance(car, Mapping) else None
    if not isinstance(present_mps, int | float):
        present_mps = CarSettings().max_speed_mps
    if isinstance(speed_mps, float) and speed_mps > present_mps:
        del imported.settings[MAX_SPEED]
        why = f"{speed_mps:.2f} m/s is faster than the car's own limit, {MAX_SPEED} = {present_mps:g}, which is kept"
        imported.left.append(("speed_max", f"{why}; set it yourself if the car is to be that fast"))
