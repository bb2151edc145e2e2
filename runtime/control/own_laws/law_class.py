"""A law of the user by its name "module:Class": found, imported once, and checked before anything moves."""

import difflib
import inspect
import re
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from types import ModuleType
from typing import Any

from pydantic import ValidationError

from wallride.runtime.control.own_laws.api import LawSettings
from wallride.runtime.host.user_module import UserCodeError, file_of, import_module, shown

OWN_TAG = "module:Class"
"""Form of the name, and its place in the lists of methods."""
NAME = re.compile(r"[^\W\d]\w*(\.[^\W\d]\w*)*:[^\W\d]\w*")
ANSWERS: Mapping[str, str] = {"wall_follow": "follow", "safety": "limit"}
"""Method that a law of each section of the settings has."""


@dataclass(frozen=True, slots=True)
class LawClass:
    """An imported law. answer: name of its method. model: the class of its settings. file, line: of the method."""

    name: str
    made: type[Any]
    answer: str
    model: type[LawSettings]
    file: Path
    line: int

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
    """Return the files of all own laws that this process has imported."""
    return tuple(sorted({law.file for law in _loaded.values()}))


def known_law(section: str, name: str) -> LawClass | None:
    """Return an own law that this process has imported; None for another. Nothing is imported."""
    return _loaded.get((section, name))


def checked_name(name: str) -> str:
    """Return the name of an own law; UserCodeError where it has not the form of one."""
    if NAME.fullmatch(name) is None or ".py:" in name:
        raise UserCodeError(f"write {OWN_TAG}, for example my_laws:Follower for class Follower in my_laws.py")
    return name


def load_law(section: str, name: str) -> LawClass:
    """Return an own law, imported at the first call; UserCodeError says in one sentence what is wrong with it."""
    if (section, name) not in _loaded:
        checked_name(name)
        module_name, _, class_name = name.partition(":")
        module = import_module(module_name)
        made = getattr(module, class_name, None)
        if not isinstance(made, type):
            raise UserCodeError(_no_class(module, class_name))
        register(section, name, made)
    return _loaded[section, name]


def register(section: str, name: str, made: type[Any]) -> LawClass:
    """Check a class and know it by a name from now on; UserCodeError as `load_law`."""
    answer = ANSWERS[section]
    method = getattr(made, answer, None)
    file = _file_of(made, method)
    here = f"{shown(file)}:{_line_of(made)}: class {made.__name__}"
    if not callable(method):
        raise UserCodeError(f"{here} has no method {answer}(self, scan, state)")
    if inspect.iscoroutinefunction(method):
        raise UserCodeError(f"{here}: {answer} must be a plain method, without async")
    if not _takes(method, 3):
        raise UserCodeError(f"{here}: {answer} must take (self, scan, state)")
    if not _takes(made, 2):
        raise UserCodeError(f"{here} must be made from (settings, car); write __init__(self, settings, car)")
    law = LawClass(name, made, answer, _model_of(made, here), file, _line_of(method))
    _loaded[section, name] = law
    return law


def _model_of(made: type[Any], here: str) -> type[LawSettings]:
    """Return the class of a law's settings; an empty one where it has none."""
    model = getattr(made, "Settings", None)
    if model is None:
        return LawSettings
    if not (isinstance(model, type) and issubclass(model, LawSettings)):
        raise UserCodeError(f"{here}: Settings must be a class derived from wallride.laws.LawSettings")
    without = [name for name, field in model.model_fields.items() if field.is_required()]
    if without:
        raise UserCodeError(f"{here}: its setting {without[0]} has no default; write {without[0]}: TYPE = VALUE")
    try:
        model.model_validate(model().model_dump())
    except ValidationError as error:
        first = error.errors(include_url=False)[0]
        key = ".".join(str(part) for part in first["loc"])
        raise UserCodeError(f"{here}: the default of its setting {key} is refused: {first['msg']}") from None
    return model


def _takes(called: Any, count: int) -> bool:  # noqa: ANN401 - any callable
    try:
        inspect.signature(called).bind(*[None] * count)
    except (TypeError, ValueError):
        return False
    return True


def _file_of(made: type[Any], method: object) -> Path:
    """Return the file of a law: of its method, which a notebook has for its classes as well."""
    code = getattr(method, "__code__", None)
    if code is not None:
        return Path(code.co_filename)
    try:
        return Path(inspect.getfile(made))
    except (OSError, TypeError):
        return Path(made.__module__)


def _line_of(what: Any) -> int:  # noqa: ANN401 - a class or a function
    code = getattr(inspect.unwrap(what) if callable(what) else what, "__code__", None)
    if code is not None:
        return int(code.co_firstlineno)
    try:
        return inspect.getsourcelines(what)[1]
    except (OSError, TypeError):
        return 0


def _no_class(module: ModuleType, wanted: str) -> str:
    """Return that a module lacks a class, and what it has instead of its own."""
    found = [name for name, one in vars(module).items() if isinstance(one, type) and one.__module__ == module.__name__]
    near = difflib.get_close_matches(wanted.lower(), [name.lower() for name in found], 1)
    meant = next((name for name in found if near == [name.lower()]), None)
    others = f"; did you mean {meant}?" if meant else f"; it has {', '.join(found[:5])}" if found else ""
    return f"{shown(file_of(module))} has no class {wanted}{others}"
