"""Functions that may have a twin in C: the same arguments, the same answer, sooner.

The Python is the law: it is what is read, changed and tested, and it runs wherever the twin cannot be had. `use` puts
the compiled functions in the place of those of the same names (`runtime.kernel` builds and loads them).
"""

from collections.abc import Callable, Mapping
from functools import wraps
from typing import Any, Final, ParamSpec, TypeVar

P = ParamSpec("P")
R = TypeVar("R")

PLAIN: Final[dict[str, Callable[..., Any]]] = {}
"""Every function that may have a twin, by name, as written in Python."""
_answering: Final[dict[str, Callable[..., Any]]] = {}


def twin(plain: Callable[P, R]) -> Callable[P, R]:
    """Let a function of this name, written in C, answer instead, once there is one. Arguments by position only."""
    name = plain.__name__
    if name in PLAIN:
        raise ValueError(f"two functions named {name} may have a twin: rename one")
    PLAIN[name] = _answering[name] = plain
    answering = _answering

    @wraps(plain)
    def either(*given: P.args, **named: P.kwargs) -> R:
        answer: R = answering[name](*given, **named)
        return answer

    return either


def use(compiled: Mapping[str, Callable[..., Any]]) -> None:
    """Let these functions answer from now on, and the Python ones where none is given."""
    for name, plain in PLAIN.items():
        _answering[name] = compiled.get(name, plain)


def in_use() -> frozenset[str]:
    """Return the names of the functions that are answered in C."""
    return frozenset(name for name, plain in PLAIN.items() if _answering[name] is not plain)
