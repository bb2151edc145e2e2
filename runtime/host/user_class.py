"""Classes of the user by the name "module:Class": found, imported once, looked at before anything moves."""

import difflib
import inspect
import re
from pathlib import Path
from types import ModuleType
from typing import Any, Final, TypeVar

from pydantic import BaseModel, ValidationError

from wallride.runtime.host.user_module import UserCodeError, as_user_code_error, file_of, import_module, shown

OWN_TAG: Final = "module:Class"
"""Form of the name, and its place in the lists of choices."""
NAME: Final = re.compile(r"[^\W\d]\w*(\.[^\W\d]\w*)*:[^\W\d]\w*")
M = TypeVar("M", bound=BaseModel)


def checked_name(name: str, example: str) -> str:
    """Return the name of a class; UserCodeError, with an example, where it has not the form of one."""
    if NAME.fullmatch(name) is None or ".py:" in name:
        raise UserCodeError(f"write {OWN_TAG}, for example {example}")
    return name


def import_class(name: str) -> type[Any]:
    """Return a class by its name; UserCodeError says in one sentence what is wrong with it."""
    module_name, _, class_name = name.partition(":")
    module = import_module(module_name)
    made = getattr(module, class_name, None)
    if not isinstance(made, type):
        raise UserCodeError(_no_class(module, class_name))
    return made


def model_of(made: type[Any], here: str, base: type[M], public: str) -> type[M]:
    """Return the class of its settings, its attribute `Settings`; the empty `base`, named `public`, without one."""
    model = getattr(made, "Settings", None)
    if model is None:
        return base
    if not (isinstance(model, type) and issubclass(model, base)):
        raise UserCodeError(f"{here}: Settings must be a class derived from {public}")
    without = [name for name, field in model.model_fields.items() if field.is_required()]
    if without:
        raise UserCodeError(f"{here}: its setting {without[0]} has no default; write {without[0]}: TYPE = VALUE")
    try:
        validated(model, validated(model, {}).model_dump(warnings=False))
    except ValidationError as error:
        first = error.errors(include_url=False)[0]
        key = ".".join(str(part) for part in first["loc"])
        why = first["msg"].removeprefix("Value error, ")
        raise UserCodeError(f"{here}: the default of its setting {key} is refused: {why}") from None
    return model


def validated(model: type[M], given: Any) -> M:  # noqa: ANN401 - whatever stood in the file
    """Return settings of the user's class; what its own validators raise is a UserCodeError that names its line."""
    with as_user_code_error(ValidationError):
        return model.model_validate(given)


def takes(called: Any, count: int) -> bool:  # noqa: ANN401 - any callable
    """Tell whether it can be called with so many arguments by position."""
    try:
        inspect.signature(called).bind(*[None] * count)
    except (TypeError, ValueError):
        return False
    return True


def file_of_class(made: type[Any], method: object) -> Path:
    """Return the file of a class: of its method, which a notebook has for its classes as well."""
    code = getattr(method, "__code__", None)
    if code is not None:
        return Path(code.co_filename)
    try:
        return Path(inspect.getfile(made))
    except (OSError, TypeError):
        return Path(made.__module__)


def line_of(what: Any) -> int:  # noqa: ANN401 - a class or a function
    """Return its first line, 0 where that is not known."""
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
    listed = ", ".join([*found[:5], *(["..."] if len(found) > 5 else [])])
    others = f"; did you mean {meant}?" if meant else f"; it has {listed}" if found else ""
    return f"{shown(file_of(module))} has no class {wanted}{others}"
