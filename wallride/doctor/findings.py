"""One line of the answer: what was looked at, how it is, what to do."""

from collections.abc import Iterable
from dataclasses import dataclass
from enum import StrEnum


class Level(StrEnum):
    """How a thing is, from good to bad."""

    OK = "ok"
    WARN = "warn"
    """The car drives, worse or less safely than it could."""
    FAIL = "fail"
    """The car does not drive, or must not."""


@dataclass(frozen=True, slots=True)
class Finding:
    """subject: what was looked at. words: how it is. remedy: what to do, one sentence; "" where all is well."""

    subject: str
    level: Level
    words: str
    remedy: str = ""


def ok(subject: str, words: str) -> Finding:
    """Return a finding without a problem."""
    return Finding(subject, Level.OK, words)


def warn(subject: str, words: str, remedy: str) -> Finding:
    """Return a finding with which the car drives."""
    return Finding(subject, Level.WARN, words, remedy)


def fail(subject: str, words: str, remedy: str) -> Finding:
    """Return a finding with which the car does not drive, or must not."""
    return Finding(subject, Level.FAIL, words, remedy)


def worst(findings: Iterable[Finding]) -> Level:
    """Return the worst level; ok of none."""
    order = list(Level)
    return max((one.level for one in findings), key=order.index, default=Level.OK)
