"""A law of the user by its name "module:Class": found, imported once, and checked before anything moves."""

import inspect
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from wallride.runtime.control.own_laws.api import LawSettings
from wallride.runtime.host import user_class
from wallride.runtime.host.user_class import NAME, OWN_TAG, file_of_class, import_class, line_of, model_of, takes
from wallride.runtime.host.user_module import UserCodeError, files_of, shown

__all__ = [
    "ANSWERS", "NAME", "OWN_TAG", "LawClass", "checked_name", "is_own", "known_law", "load_law", "loaded",
    "loaded_files", "register",
]  # fmt: skip
ANSWERS: Mapping[str, str] = {"wall_follow": "follow", "safety": "limit"}
"""Method that a law of each section of the settings has."""


@dataclass(frozen=True, slots=True)
class LawClass:
    """An imported law. answer: name of its method. model: the class of its settings. file, line: of the method.

    files: that one and those of the user's modules that it imports.
    """

    name: str
    made: type[Any]
    answer: str
    model: type[LawSettings]
    file: Path
    line: int
    files: tuple[Path, ...]

    @property
    def place(self) -> str:
        """Return "FILE:LINE" of its method."""
        return f"{shown(self.file)}:{self.line}"


_loaded: dict[tuple[str, str], LawClass] = {}


def is_own(method: str) -> bool:
    """Tell whether a method's name is meant for a class of the user."""
    return ":" in method


def loaded(section: str) -> tuple[str, ...]:
    """Return the names of the own laws that this process has imported for a section."""
    return tuple(name for kind, name in _loaded if kind == section)


def loaded_files() -> tuple[Path, ...]:
    """Return the files of all own laws that this process has imported, and of the user's modules that they import."""
    return tuple(sorted({file for law in _loaded.values() for file in law.files}))


def known_law(section: str, name: str) -> LawClass | None:
    """Return an own law that this process has imported; None for another. Nothing is imported."""
    return _loaded.get((section, name))


def checked_name(name: str) -> str:
    """Return the name of an own law; UserCodeError where it has not the form of one."""
    return user_class.checked_name(name, "my_laws:Follower for class Follower in my_laws.py")


def load_law(section: str, name: str) -> LawClass:
    """Return an own law, imported at the first call; UserCodeError says in one sentence what is wrong with it."""
    if (section, name) not in _loaded:
        register(section, name, import_class(checked_name(name)))
    return _loaded[section, name]


def register(section: str, name: str, made: type[Any]) -> LawClass:
    """Check a class and know it by a name from now on; UserCodeError as `load_law`."""
    answer = ANSWERS[section]
    method = getattr(made, answer, None)
    file = file_of_class(made, method)
    here = f"{shown(file)}:{line_of(made)}: class {made.__name__}"
    if not callable(method):
        raise UserCodeError(f"{here} has no method {answer}(self, scan, state)")
    if inspect.iscoroutinefunction(method):
        raise UserCodeError(f"{here}: {answer} must be a plain method, without async")
    if not takes(method, 3):
        raise UserCodeError(f"{here}: {answer} must take (self, scan, state)")
    if not takes(made, 2):
        raise UserCodeError(f"{here} must be made from (settings, car); write __init__(self, settings, car)")
    model = model_of(made, here, LawSettings, "wallride.laws.LawSettings")
    law = LawClass(name, made, answer, model, file, line_of(method), files_of(name.partition(":")[0], file))
    _loaded[section, name] = law
    return law
