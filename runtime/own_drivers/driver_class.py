"""A driver of the user by its name: "module:Class", or that of an entry point of an installed package.

Entry points are in the groups `wallride.lidars` and `wallride.motors`.
"""

import functools
import inspect
from collections.abc import Mapping
from dataclasses import dataclass
from importlib.metadata import entry_points
from pathlib import Path
from typing import Any, Final

from wallride.drivers.own import DriverSettings
from wallride.runtime.host import user_class
from wallride.runtime.host.user_class import file_of_class, import_class, line_of, model_of, takes
from wallride.runtime.host.user_module import UserCodeError, shown

_METHODS: Final[Mapping[str, Mapping[str, str]]] = {
    "lidar": {"run": "async def run(self, on_scan)"},
    "motor": {"run": "async def run(self)", "send": "def send(self, drive)"},
}
"""Methods of a driver of each section of the settings, as they are written."""


@dataclass(frozen=True, slots=True)
class DriverClass:
    """An imported driver. model: the class of its settings. file, line: of its class."""

    name: str
    made: type[Any]
    model: type[DriverSettings]
    file: Path
    line: int

    @property
    def place(self) -> str:
        """Return "FILE:LINE"."""
        return f"{shown(self.file)}:{self.line}"


_loaded: dict[tuple[str, str], DriverClass] = {}


@functools.cache
def installed(section: str) -> Mapping[str, str]:
    """Return "module:Class" of the drivers that installed packages bring, by their names."""
    return {point.name: point.value for point in entry_points(group=f"wallride.{section}s")}


def is_own(section: str, name: str) -> bool:
    """Tell whether a driver's name is meant for one from outside."""
    return ":" in name or name in installed(section)


def known_driver(section: str, name: str) -> DriverClass | None:
    """Return a driver that this process has imported; None for another. Nothing is imported."""
    return _loaded.get((section, name))


def loaded_drivers(section: str) -> tuple[str, ...]:
    """Return the names of the drivers that this process has imported for a section."""
    return tuple(name for kind, name in _loaded if kind == section)


def loaded_driver_files() -> tuple[Path, ...]:
    """Return the files of all drivers that this process has imported."""
    return tuple(sorted({driver.file for driver in _loaded.values()}))


def checked_name(section: str, name: str) -> str:
    """Return the name of a driver; UserCodeError where it has not the form of one."""
    if name in installed(section):
        return name
    return user_class.checked_name(name, f"my_{section}:Driver for class Driver in my_{section}.py")


def load_driver(section: str, name: str) -> DriverClass:
    """Return a driver, imported at the first call; UserCodeError says in one sentence what is wrong with it."""
    if (section, name) not in _loaded:
        checked_name(section, name)
        _loaded[section, name] = _checked(section, name, import_class(installed(section).get(name, name)))
    return _loaded[section, name]


def _checked(section: str, name: str, made: type[Any]) -> DriverClass:
    file = file_of_class(made, getattr(made, "run", None))
    here = f"{shown(file)}:{line_of(made)}: class {made.__name__}"
    for method, written in _METHODS[section].items():
        found = getattr(made, method, None)
        if not callable(found) or not takes(found, written.count(",") + 1):
            raise UserCodeError(f"{here} has no method {method}; write {written}")
        if inspect.iscoroutinefunction(found) != written.startswith("async"):
            raise UserCodeError(f"{here}: write {written}")
    if not takes(made, 2):
        raise UserCodeError(f"{here} must be made from (settings, clock); write __init__(self, settings, clock)")
    model = model_of(made, here, DriverSettings, "wallride.drivers.own.DriverSettings")
    return DriverClass(name, made, model, file, line_of(made))
