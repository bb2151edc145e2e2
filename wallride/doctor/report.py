"""The answer as lines for people and as JSON for programs, and its exit code."""

import json
from collections.abc import Sequence
from dataclasses import asdict
from typing import Final

from wallride.doctor.findings import Finding, Level, worst
from wallride.runtime.host.terminal_text import one_line

EXIT_CODES: Final = {Level.OK: 0, Level.WARN: 1, Level.FAIL: 2}
_SUBJECT_CHARS: Final = 22


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
