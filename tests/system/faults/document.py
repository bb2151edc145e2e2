"""Writes docs/faults.md from the matrix and the measured figures: `python -m tests.system.faults.document`."""

import fcntl
import json
import os
import re
from collections.abc import Mapping
from pathlib import Path

from tests.system.faults.matrix import BY_PERSON, INJECTED, MATRIX, Fault

ROOT = Path(__file__).resolve().parents[3]
PAGE = ROOT / "docs" / "faults.md"
FIGURES = Path(__file__).with_name("measured.json")
COMMAND = "python -m tests.system.faults.document"
UNMEASURED = "-"
HEADER = "| fault | promise | after | bound | measured | busy | test |"
BUSY = "busy: "
"""Prefix of the figures that were measured beside a busy loop on each core."""


def page(figures: Mapping[str, float]) -> str:
    """Return the page; figures: by the key of a fault, the longest reaction measured [s]."""
    lines = [
        f"<!-- Written by `{COMMAND}` from tests/system/faults: edit the matrix, not this page. -->\n",
        "# Faults\n",
        "What the car promises when something breaks, and the test that holds it. *Bound*: the longest time from the",
        "last good data, or from the fault, to the brake on the motor's wire (or to the motor controller's own, where",
        "the process cannot reach it); where the car never stops, the longest time between two motor commands.",
        "*Measured*: the longest of the last measurement, on two cores shared with other work. *Busy*: the longest",
        'beside busy programs on each core, scheduled as by its unit; "-" where there is none yet. *After*: when',
        "the car moves again.\n",
        "The injected faults meet the unmodified process between emulated devices (`pytest tests/system/faults`);",
        "the clock that jumps is the one that the process reads in Python, not the computer's.",
        "`python -m tests.system.faults.measure [--busy]` runs them three times and notes the figures.\n",
    ]
    for group in dict.fromkeys(fault.group for fault in MATRIX):
        lines += [f"## {group}\n", HEADER, "| --- " * 7 + "|"]
        lines += [_row(fault, figures) for fault in MATRIX if fault.group == group]
        lines.append("")
    lines += [
        "## For a person\n",
        "What no program on the car can tell.\n",
        "| fault | what to do |",
        "| --- " * 2 + "|",
    ]
    lines += [f"| {fault} | {remedy} |" for fault, remedy in BY_PERSON]
    return "\n".join([*lines, ""])


def without_figures(text: str) -> str:
    """Return a page without what was measured, to compare what was promised."""
    return re.sub(r"\d+ ms \|", f"{UNMEASURED} |", text)


def _row(fault: Fault, figures: Mapping[str, float]) -> str:
    bound = f"{fault.bound_s:g} s" if fault.bound_s is not None else ""
    measured, busy = (_words(fault, figures.get(prefix + fault.key)) for prefix in ("", BUSY))
    test = "injected" if fault.test == INJECTED else f"`{fault.test.rpartition('/')[2]}`"
    cells = (fault.name, fault.promise, fault.afterwards, bound, measured, busy, test)
    return f"| {' | '.join(cells)} |"


def _words(fault: Fault, figure_s: float | None) -> str:
    if fault.bound_s is None:
        return ""
    return UNMEASURED if figure_s is None else f"{figure_s * 1000:.0f} ms"


def read_figures(path: Path = FIGURES) -> dict[str, float]:
    """Return the measured figures, none where there is no file."""
    return dict(json.loads(path.read_text(encoding="utf-8"))) if path.exists() else {}


def note(path: Path, key: str, figure_s: float) -> None:
    """Keep the longest figure of a measurement; with FAULTS_BUSY in the environment, of one on busy cores."""
    key = BUSY * ("FAULTS_BUSY" in os.environ) + key
    with path.open("a+", encoding="utf-8") as file:
        fcntl.flock(file, fcntl.LOCK_EX)  # several tests may run at once
        file.seek(0)
        figures = json.loads(file.read() or "{}")
        figures[key] = round(max(figure_s, figures.get(key, 0.0)), 3)
        file.truncate(0)
        file.write(json.dumps(dict(sorted(figures.items())), indent=1) + "\n")


if __name__ == "__main__":
    PAGE.write_text(page(read_figures()), encoding="utf-8")
