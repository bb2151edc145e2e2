"""Small values of which the hot path makes dozens for every scan."""

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import TypeVar, dataclass_transform

T = TypeVar("T")


@dataclass_transform(frozen_default=True, field_specifiers=(field,))
def value(*, eq: bool = True) -> Callable[[type[T]], type[T]]:
    """Make a class a dataclass with slots that are read-only for the type checker, not for the interpreter.

    A frozen dataclass takes four times as long to make, and a scan's path to the motor makes thirty of them. Compared
    and hashed like a frozen one; with eq=False (arrays inside) by identity.
    """

    def made(plain: type[T]) -> type[T]:
        return dataclass(slots=True, eq=eq, unsafe_hash=eq)(plain)

    return made
