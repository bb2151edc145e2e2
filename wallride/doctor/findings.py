"""The answer: what was looked at, how it is, what to do; as lines for people, as JSON for programs."""

import json
from collections.abc import Iterable, Sequence
from dataclasses import asdict, dataclass
from enum import StrEnum
from typing import Final

from wallride.runtime.host.terminal_text import one_line

_SUBJECT_CHARS: Final = 22


class Level(StrEnum):
    """How a thing is, from good to bad."""

    OK = "ok"
    WARN = "warn"
    """The car drives, worse or less safely than it could."""
    FAIL = "fail"
    """The car does not drive, or must not."""


EXIT_CODES: Final = {Level.OK: 0, Level.WARN: 1, Level.FAIL: 2}


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


def line(finding: Finding) -> str:
    """Return one or two lines: the finding, and what to do."""
    marks = {Level.OK: "ok  ", Level.WARN: "warn", Level.FAIL: "FAIL"}
    text = f"{marks[finding.level]}  {finding.subject:{_SUBJECT_CHARS}}  {one_line(finding.words)}"
    return f"{text}\n{'':{_SUBJECT_CHARS + 8}}-> {one_line(finding.remedy)}" if finding.remedy else text


def summary(findings: Sequence[Finding]) -> str:
    """Return the last line."""
    counts = {level: sum(one.level is level for one in findings) for level in Level}
    if worst(findings) is Level.OK:
        return f"all {len(findings)} are ok"
    return f"{counts[Level.FAIL]} to mend before it drives, {counts[Level.WARN]} warnings, {counts[Level.OK]} ok"


def as_json(findings: Sequence[Finding]) -> str:
    """Return an object with the worst level and every finding."""
    return json.dumps({"level": worst(findings), "findings": [asdict(one) for one in findings]}, indent=1)


def exit_code(findings: Sequence[Finding]) -> int:
    """Return 0 when all is ok, 1 with warnings, 2 when something must be mended before the car drives."""
    return EXIT_CODES[worst(findings)]
