"""Functions with an equivalent in C (PEP 399): the same arguments, the same result, in less time.

The Python function is the definition: it is the one to read, change and test. Where the extension module is built
(`wallride build-kernel`), `@accelerated` returns the C function of the same name at import, as long as that was written
for the Python that is here: a fingerprint of the function and of all that it calls tells. Else it returns the Python.
"""

import hashlib
import importlib
import json
import os
import sys
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from types import ModuleType
from typing import TYPE_CHECKING, Any, Final, ParamSpec, TypeVar, overload

if TYPE_CHECKING:
    from wallride.drivers.fingerprint import Sources

P = ParamSpec("P")
R = TypeVar("R")

SWITCH: Final = "WALLRIDE_COMPILED"
"""Environment variable; "0": all functions run in Python. It is read at import."""
ROOT: Final = Path(__file__).parents[1]
"""Folder that holds `drivers`, `runtime` and `sim`."""
EXTENSION: Final = "wallride.drivers._accelerated"
NOT_BUILT: Final = "not built: wallride build-kernel"

_switched_off: Final = os.environ.get(SWITCH) == "0"


class UnfitError(Exception):
    """The C function cannot be used; the text is the reason."""


@dataclass(slots=True)
class Accelerated:
    """A function with an equivalent in C, and what makes the arguments of that; None where they are the same.

    why: the reason for which the Python runs; empty where it is the C.
    """

    python: Callable[..., Any]
    flat: Callable[..., tuple[Any, ...]] | None = None
    why: str = ""

    def compiled(self) -> Callable[..., Any]:
        """Return the C function, its constants set; UnfitError with the reason where it must not be used."""
        module, name = self.python.__module__, self.python.__name__
        found, seal = extension(), sealed()
        entry = seal["functions"].get(f"{module}.{name}")
        if entry is None or not hasattr(found, name) or not hasattr(found, "over"):
            raise UnfitError("it is not in the C that was built: wallride build-kernel")
        if not _is_as_sealed(module, name, entry, seal):
            raise UnfitError("edited since its C was sealed")
        for constant in entry["constants"]:
            _set(found, constant, seal["constants"][constant])
        function: Callable[..., Any] = getattr(found, name)
        return function if self.flat is None else found.over(function, self.flat)


FUNCTIONS: Final[dict[str, Accelerated]] = {}
"""Every function with an equivalent in C whose module has been imported, by name."""


@overload
def accelerated(python: Callable[P, R], /) -> Callable[P, R]: ...


@overload
def accelerated(*, flat: Callable[P, tuple[Any, ...]]) -> Callable[[Callable[P, R]], Callable[P, R]]: ...


def accelerated(
    python: Callable[..., Any] | None = None, /, *, flat: Callable[..., tuple[Any, ...]] | None = None
) -> Callable[..., Any]:
    """Return the C function of the same name where it fits this one, else this one. Arguments by position only.

    flat: makes the arguments of the C from those of the Python: arrays and numbers from structures.
    """
    if python is None:
        return lambda law: _resolved(Accelerated(law, flat))
    return _resolved(Accelerated(python))


def accelerable(python: Callable[P, R]) -> Callable[P, R]:
    """Mark a function with an equivalent in C, and leave the choice to its caller: `Accelerated(...).compiled()`."""
    return python


def _resolved(one: Accelerated) -> Callable[..., Any]:
    python = one.python
    name = python.__name__
    if name in FUNCTIONS:
        raise ValueError(f"two functions named {name} are accelerated: rename one")
    FUNCTIONS[name] = one
    if _switched_off:
        one.why = f"{SWITCH}=0"
        return python
    try:
        return one.compiled()
    except UnfitError as reason:
        one.why = str(reason)
        return python


def in_c() -> frozenset[str]:
    """Return the names of the functions that run in C."""
    return frozenset(name for name, one in FUNCTIONS.items() if not one.why)


@cache
def extension() -> ModuleType:
    """Return the extension module; UnfitError where there is none that this Python can load."""
    try:
        return importlib.import_module(EXTENSION)
    except ModuleNotFoundError:
        raise UnfitError(NOT_BUILT) from None
    except ImportError as error:
        raise UnfitError(f"it cannot be loaded ({error}): wallride build-kernel") from None


@cache
def sealed() -> Mapping[str, Any]:
    """Return what the extension says of the Python for which it was built; see `wallride.runtime.kernel.survey`."""
    facts: Mapping[str, Any] = json.loads(extension().SEAL)
    return facts


@cache
def digest(module: str) -> str:
    """Return a hash of a module's source file."""
    try:
        return hashlib.sha256(
            (ROOT / f"{module.removeprefix('wallride.').replace('.', '/')}.py").read_bytes()
        ).hexdigest()
    except OSError:
        return ""  # without its source it has changed


@cache
def _sources() -> "Sources":
    from wallride.drivers.fingerprint import Sources  # a car whose source is that of the build never parses it

    return Sources(ROOT, passed=frozenset(sealed()["constants"]))


def _is_as_sealed(module: str, name: str, entry: Mapping[str, Any], seal: Mapping[str, Any]) -> bool:
    """Return whether the function is the one for which the C was written; its text is parsed only after an edit."""
    if all(digest(used) == seal["files"][used] for used in entry["modules"]):
        return bool(entry["fits"])
    return bool(_sources().fingerprint(module, name).digest == entry["seal"])


def _set(library: ModuleType, constant: str, slots: Mapping[str, Any]) -> None:
    """Hand a Python constant to the C; UnfitError where the C cannot take this value."""
    module, _, name = constant.rpartition(".")
    value = getattr(sys.modules.get(module), name, None)
    values = value if isinstance(value, tuple) else (value,)
    if len(values) != len(slots["kinds"]) or not all(isinstance(one, int | float) for one in values):
        raise UnfitError(f"{constant} is {value!r}, which its C does not expect")
    for place, (one, kind) in enumerate(zip(values, slots["kinds"], strict=True)):
        if kind == "fixed" and one != slots["fixed"][place]:
            raise UnfitError(f"{constant} was {slots['fixed'][place]!r} when it was built: wallride build-kernel")
        if kind == "whole" and not isinstance(one, int):
            raise UnfitError(f"{constant} was a whole number when it was built: wallride build-kernel")
        if kind != "fixed":
            library.set_constant(slots["first"] + place, one)
