"""Functions that may have a twin in C: the same arguments, the same result, in less time.

The Python function is the definition: it is the one to read, change and test, and it runs wherever the twin is not
available. `use` replaces functions by the compiled ones of the same names (`runtime.kernel` builds and loads them).
"""

import sys
from collections.abc import Callable, Mapping
from functools import wraps
from typing import Any, Final, ParamSpec, TypeVar

P = ParamSpec("P")
R = TypeVar("R")

PLAIN: Final[dict[str, Callable[..., Any]]] = {}
"""Every function that may have a twin, by name, as written in Python."""
_answering: Final[dict[str, Callable[..., Any]]] = {}
_either: Final[dict[str, Callable[..., Any]]] = {}


def twin(plain: Callable[P, R]) -> Callable[P, R]:
    """Register a function that a C function of the same name may replace. Arguments by position only."""
    name = plain.__name__
    if name in PLAIN:
        raise ValueError(f"two functions named {name} may have a twin: rename one")
    PLAIN[name] = _answering[name] = plain
    answering = _answering

    @wraps(plain)
    def either(*given: P.args, **named: P.kwargs) -> R:
        answer: R = answering[name](*given, **named)
        return answer

    _either[name] = either
    return either


def use(compiled: Mapping[str, Callable[..., Any]]) -> None:
    """Use these compiled functions from now on, and the Python ones where none is given."""
    before = dict(_answering)
    for name, plain in PLAIN.items():
        _answering[name] = compiled.get(name, plain)
    for module in list(sys.modules.values()):
        _put_in_place(getattr(module, "__dict__", {}), before)


def _put_in_place(names: dict[str, Any], before: Mapping[str, Callable[..., Any]]) -> None:
    """Bind the compiled function itself in a module that has the name, so that a call takes no extra step."""
    for name in PLAIN.keys() & names.keys():
        if names[name] is _either[name] or (before[name] is not PLAIN[name] and names[name] is before[name]):
            answering = _answering[name]
            names[name] = answering if answering is not PLAIN[name] else _either[name]


def in_use() -> frozenset[str]:
    """Return the names of the functions that run in C."""
    return frozenset(name for name, plain in PLAIN.items() if _answering[name] is not plain)
