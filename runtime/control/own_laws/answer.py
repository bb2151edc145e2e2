"""What a law of the user answered, as plain numbers and texts: each value is read once, and none of its class is kept.

An object of the user's may be anything: a text that cannot be written down, a number whose conversion raises. So all of
this runs where an error is the law's fault (`LawRunner.call`).
"""

import math
from typing import TypeVar

from wallride.runtime.host.user_module import shown_text

MAX_REASON = 60
A = TypeVar("A")


class WrongAnswerError(Exception):
    """An answer is of the wrong type or without sense; the text says what the law returned."""


def of_kind(answer: object, wanted: type[A], name: str) -> A:
    """Return an answer of the wanted class."""
    if not isinstance(answer, wanted):
        kind = "nothing" if answer is None else f"a {type(answer).__name__.removeprefix('Law')}"
        raise WrongAnswerError(f"returned {kind} where a {name} is needed")
    return answer


def number(value: object) -> float:
    """Return a number of Python, numpy or any class that converts to one; NaN for what is none, and for truth values.

    An error of the conversion itself is the law's.
    """
    if isinstance(value, bool | str | bytes):
        return math.nan
    try:
        return float(value)  # type: ignore[arg-type]
    except (TypeError, ValueError, OverflowError):
        return math.nan


def text(value: object, name: str) -> str:
    """Return a text, short and printable."""
    if not isinstance(value, str):
        raise WrongAnswerError(f"returned {name} = {shown(value)}, which is no text")
    return shown_text(str.__getitem__(value, slice(MAX_REASON)))


def shown(value: object) -> str:
    """Return a value for a sentence: itself where it is short, else its type."""
    if type(value) in {bool, float, str}:
        return shown_text(repr(value)[:MAX_REASON])
    if type(value) is int and value.bit_length() < MAX_REASON:
        return repr(value)
    return type(value).__name__
