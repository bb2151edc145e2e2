"""Operator's inputs from a file (docs/driving.md), for tests and demonstrations. Pure apart from reading the file."""

import csv
import math
import tomllib
from bisect import bisect_right
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from wallride.clients.teleop.inputs import BUTTONS, Control, Inputs
from wallride.runtime.host.text_file import TextFileError, read_text
from wallride.runtime.wire.teleop import Input

ALIASES = {
    "lb": Control.MANUAL,
    "rb": Control.AUTONOMY,
    "b": Control.ESTOP,
    "start": Control.RESET,
    "y": Control.TAKE_OVER,
} | {control.value: control for control in BUTTONS}


class ScriptError(ValueError):
    """An invalid script; one line with the place and the fault."""


@dataclass(frozen=True, slots=True)
class Step:
    """Inputs held from a time on [s since the start]."""

    time_s: float
    buttons: frozenset[Control]
    speed: float = 0.0
    steering: float = 0.0


class Script:
    """Steps in order of time."""

    def __init__(self, steps: Iterable[Step]) -> None:
        self._steps = list(steps)
        if not self._steps:
            raise ScriptError("the script is empty")
        for earlier, later in zip(self._steps, self._steps[1:], strict=False):
            if later.time_s <= earlier.time_s:
                raise ScriptError(f"the step at {later.time_s} s does not come after the one at {earlier.time_s} s")
        self._times_s = [step.time_s for step in self._steps]

    @property
    def duration_s(self) -> float:
        """Return the time of its end."""
        return self._times_s[-1]

    def inputs(self, elapsed_s: float, now_s: float) -> Inputs:
        """Return what is held elapsed_s after the start; nothing before it and after the end."""
        at = bisect_right(self._times_s, elapsed_s) - 1
        step = self._steps[at] if at >= 0 and elapsed_s < self.duration_s else Step(0.0, frozenset())
        return Inputs(
            Input.SCRIPT,
            live=True,
            event_s=now_s,
            pressed=step.buttons,
            speed=step.speed,
            steering=step.steering,
            device="script",
        )


def load(path: Path) -> Script:
    """Load a script; ScriptError names the fault."""
    try:
        text = read_text(path)
    except TextFileError as error:
        raise ScriptError(f"{path}: is not a script: {error}") from None
    except OSError as error:
        raise ScriptError(f"{path}: cannot be read: {error.strerror or error}") from None
    try:
        rows = _toml_rows(text) if path.suffix == ".toml" else list(csv.DictReader(text.splitlines()))
        return Script([_step(row, number) for number, row in enumerate(rows, start=1)])
    except (ScriptError, csv.Error) as error:
        raise ScriptError(f"{path}: {error}") from None


def _toml_rows(text: str) -> list[Mapping[str, Any]]:
    try:
        rows = tomllib.loads(text).get("step")
    except tomllib.TOMLDecodeError as error:
        raise ScriptError(str(error)) from None
    if not isinstance(rows, list) or not all(isinstance(row, dict) for row in rows):
        raise ScriptError("a script is a list of [[step]]")
    return rows


def _step(row: Mapping[str, Any], number: int) -> Step:
    unknown = set(row) - {"time_s", "buttons", "speed", "steering"}
    if unknown:
        raise ScriptError(f"step {number}: unknown {min(str(name) for name in unknown)!r}")
    time_s = _number(row, "time_s", number, default=None)
    return Step(time_s, _buttons(row, number), _stick(row, "speed", number), _stick(row, "steering", number))


def _buttons(row: Mapping[str, Any], number: int) -> frozenset[Control]:
    value = row.get("buttons") or []
    names = [name for name in value.split("+") if name.strip()] if isinstance(value, str) else value
    if not isinstance(names, list):
        raise ScriptError(f"step {number}: buttons is a list")
    found = [ALIASES.get(str(name).strip().lower()) for name in names]
    if None in found:
        raise ScriptError(f"step {number}: {names[found.index(None)]!r} is no button; there are {', '.join(ALIASES)}")
    return frozenset(control for control in found if control is not None)


def _stick(row: Mapping[str, Any], name: str, number: int) -> float:
    value = _number(row, name, number, default=0.0)
    if abs(value) > 1:
        raise ScriptError(f"step {number}: {name} = {value} is not between -1 and 1")
    return value


def _number(row: Mapping[str, Any], name: str, number: int, *, default: float | None) -> float:
    value = row.get(name)
    if value in {None, ""} and default is not None:
        return default
    try:
        result = float(str(value))
    except ValueError:
        result = math.nan
    if not math.isfinite(result):
        raise ScriptError(f"step {number}: {name} = {value!r} is not a number")
    return result
