"""Addresses of the objects that a call needs: by CPython's `id`, used as a prefetch hint and for nothing else."""

import gc
import sys
from collections.abc import Iterable, Iterator, Mapping
from types import CodeType, FunctionType, ModuleType
from typing import Any, Final, NamedTuple

import numpy as np
import numpy.typing as npt

Addresses = npt.NDArray[np.intp]

LINE_BYTES: Final = 64
HEADER_BYTES: Final = 16
"""Size of the garbage collector's header, in front of the address that `id` returns."""
MAX_BYTES: Final = 256
"""Maximum size of an object that is no code and no class; longer ones are docstrings, tables or arrays."""


class Call(NamedTuple):
    """One call of a Python function: its code, the names of its module, and the owner of a method, if any."""

    code: CodeType
    names: Mapping[str, Any]
    owner: object


def called(call: Call) -> Iterator[object]:
    """Yield the objects that any such call needs: code, names, constants, the function, and its class."""
    code = call.code
    yield code
    yield code.co_names
    yield code.co_consts
    yield from code.co_names
    yield from (thing for thing in code.co_consts if sys.getsizeof(thing) <= MAX_BYTES)
    for kind in type(call.owner).__mro__:
        if code.co_name in vars(kind):
            found = vars(kind)[code.co_name]
            yield kind
            yield found
            if isinstance(found, property):
                yield found.fget
            return
    yield call.names.get(code.co_name)


def held(owner: object) -> Iterator[object]:
    """Yield an object and the values of its attributes."""
    yield owner
    for thing in gc.get_referents(owner):
        if not isinstance(thing, type | ModuleType | FunctionType):
            yield thing


def addresses(things: Iterable[object]) -> Addresses:
    """Return the addresses of these objects' cache lines, in order."""
    lines = {line for thing in things for line in _lines(thing)}
    return np.array(sorted(lines), np.intp) * LINE_BYTES


def _lines(thing: object) -> range:
    size = sys.getsizeof(thing)
    if not isinstance(thing, CodeType | type):
        size = min(size, MAX_BYTES)
    return range((id(thing) - HEADER_BYTES) // LINE_BYTES, (id(thing) + size - 1) // LINE_BYTES + 1)
