"""`wallride calibrate`: guides through the steps, shows before and after, writes what is accepted."""

import argparse
from collections.abc import Callable, Mapping, Sequence
from contextlib import AbstractContextManager, suppress
from datetime import UTC, datetime
from functools import partial
from pathlib import Path
from typing import Protocol

from pydantic import ValidationError

from wallride.clients.calibration import OUTLINE, SPEED, STEPS, settings_file
from wallride.clients.calibration.current_values import check_writable, current_values
from wallride.clients.calibration.deadman import AlwaysHeld, TerminalDeadman
from wallride.clients.calibration.link import GONE, HeldDeadman, LetGoError, RemoteLink
from wallride.clients.calibration.steps import (
    OUTLINE_WORDS,
    CalibrationProgress,
    DrivenStep,
    drive_tape,
    driven_steps,
    new_values,
)
from wallride.clients.calibration.ways import CalibratedCar, CalibrationError
from wallride.clients.connection import ConnectionProblemError
from wallride.clients.remote.car import RemoteCar
from wallride.clients.remote.driver import DriveRefusedError
from wallride.clients.status import lost_device
from wallride.clients.teleop import terminal
from wallride.runtime.calibration import proposals
from wallride.runtime.calibration.proposals import Proposal
from wallride.runtime.host.terminal_text import asked, in_columns, say, yes_or_no
from wallride.runtime.parameters.file import StoreError
from wallride.runtime.settings.tree import Settings, SettingsError
from wallride.runtime.wire import topics


class StepLink(CalibratedCar, Protocol):
    """A car that is driven for one step."""

    def forget(self) -> None:
        """Begin with what comes from now on."""


OpenLink = Callable[[HeldDeadman], AbstractContextManager[StepLink]]
TRIES = 5
STATUS_WITHIN_S = 1.0


def run(options: argparse.Namespace) -> int:
    """Calibrate, or undo the last calibration; ConnectionProblemError for what the user can correct."""
    try:
        if options.undo:
            return _undo(_file(options))
        return _calibrate(options)
    except (StoreError, SettingsError, CalibrationError, DriveRefusedError) as error:
        raise ConnectionProblemError(str(error)) from None


def _undo(path: Path) -> int:
    for line in settings_file.undo(path):
        say(line)
    say(f"{path}: as before the calibration; restart the car")
    return 0


def _calibrate(options: argparse.Namespace) -> int:
    path, wanted = _file(options), frozenset(options.steps or STEPS)
    say(f"settings of {path}")
    with RemoteCar(options) as car:
        now = current_values(car, path)
        check_yes(given=options.yes, simulated=bool(car.parameters["recording.simulated"]))
        _check_devices(car)

        def open_link(deadman: HeldDeadman) -> RemoteLink:
            return RemoteLink(car, deadman, say)

        so_far, measured = begin(now, options.wheelbase)
        if (options.yes or OUTLINE not in wanted) and (why := refusal(so_far.now)):
            raise CalibrationError(f"{why}; measure the outline in the same run")
        measured += drive_steps(open_link, driven_steps(wanted), so_far, always=options.yes)
        if SPEED in wanted and so_far.arcs is not None and so_far.arcs.fit.speed_factor.why and not options.yes:
            measured += _tape(open_link, so_far)
    return finish(path, wanted, now, so_far, measured, yes=options.yes)


def begin(now: Mapping[str, float], wheelbase_m: float | None) -> tuple[CalibrationProgress, list[Proposal]]:
    """Return a calibration that has driven nothing yet. wheelbase_m: by ruler, None without one."""
    so_far, measured = CalibrationProgress(dict(now), ruler=wheelbase_m is not None), []
    if wheelbase_m is not None:
        so_far.now = {**now, proposals.WHEELBASE: wheelbase_m}
        measured.append(_by_hand(proposals.WHEELBASE, now, wheelbase_m, "by ruler"))
    return so_far, measured


def drive_steps(
    open_link: OpenLink, steps: Sequence[DrivenStep], so_far: CalibrationProgress, *, always: bool
) -> list[Proposal]:
    """Drive all steps that can be driven; return what they measured."""
    measured: list[Proposal] = []
    for step in steps:
        if missing := step.missing(so_far):
            say(f"\n{missing}")
            continue
        measured += drive_step(open_link, step, so_far, always=always)
    return measured


def finish(
    path: Path, wanted: frozenset[str], now: Mapping[str, float], so_far: CalibrationProgress,
    measured: list[Proposal], *, yes: bool,
) -> int:  # fmt: skip
    """Ask for what the car cannot see, show everything, and write what is accepted."""
    if OUTLINE in wanted and not yes:
        known = {**now, **new_values(measured)}
        for _ in range(TRIES):
            outline = _outline(known)
            if not (why := refusal({**known, **new_values(outline)})):
                break
            say(f"  {why}")
        measured += outline
    for note in so_far.notes:
        say(note)
    if not measured:
        say("nothing was measured, and nothing was written: the car drives as before")
        return 0
    say(table(measured))
    return _write(path, [one for one in measured if one.changes], yes=yes)


def _file(options: argparse.Namespace) -> Path:
    path: Path = options.config
    check_writable(path)
    return path


def check_yes(*, given: bool, simulated: bool) -> None:
    """CalibrationError where no person holds a key, and the car is a real one."""
    if given and not simulated:
        raise CalibrationError("--yes holds the deadman for you: it is for simulated and emulated cars only")
    if not given and not terminal.is_there():
        raise CalibrationError("the deadman is a key: run it in a terminal (or --yes, with an emulated car)")


def _check_devices(car: RemoteCar) -> None:
    """CalibrationError where lidar or motor is away, before a person holds a key."""
    with suppress(ConnectionProblemError):  # it sends no status; then a step says what is missing
        status = car.latest(topics.STATUS, timeout_s=STATUS_WITHIN_S).fields
        if lost := lost_device(status):
            raise CalibrationError(GONE.format(lost))


def drive_step(open_link: OpenLink, step: DrivenStep, so_far: CalibrationProgress, *, always: bool) -> list[Proposal]:
    """Drive a step, again after the operator let go; [] where it was skipped. always: the deadman is held for it."""
    say(f"\n{step.title}\n  {step.before}")
    for _ in range(1 if always else TRIES):
        deadman = AlwaysHeld() if always else TerminalDeadman()
        try:
            with deadman, open_link(deadman) as link:
                if not always:
                    say(f"  hold {deadman.key} to drive; let go to stop; Space ends the step")
                deadman.wait()
                link.forget()
                return list(step.run(link, so_far))
        except LetGoError as error:
            say(f"  {error}")
        except CalibrationError as error:
            if always:
                raise CalibrationError(f"{step.title}: {error}; nothing was written") from None
            say(f"  {error}")
        if not yes_or_no("  drive this step again? (n: leave it out)", default=True):
            return []
    say(f"  {step.title}: left out after {TRIES} tries")
    return []


def _tape(open_link: OpenLink, so_far: CalibrationProgress) -> list[Proposal]:
    """Measure the speed gain with a tape where the walls do not tell it."""
    step = DrivenStep(
        "speed, with a tape", "Mark the floor beside a rear wheel. The car drives forward and stays.", drive_tape
    )
    drive_step(open_link, step, so_far, always=False)
    reported_m = so_far.taped_m
    taped_m = (
        asked("  distance from the mark to the wheel [m], Enter for none: ", _length_m, None) if reported_m else None
    )
    if not taped_m or not reported_m:
        return []
    gain = so_far.now[proposals.SPEED_GAIN] * reported_m / taped_m
    words = f"{taped_m:g} m by tape, {reported_m:.3f} m reported"
    return [_by_hand(proposals.SPEED_GAIN, so_far.now, round(gain, 1), words)]


def _outline(now: Mapping[str, float]) -> list[Proposal]:
    """Ask for the outline, which the car cannot see."""
    say("\noutline\n  Measure with a tape; Enter keeps the value.")
    found: list[Proposal] = []
    for name, words in OUTLINE_WORDS.items():
        said = {**now, **new_values(found)}
        length_m = asked(f"  {name}, {words} [{now[name]:g} m]: ", partial(_outline_m, said, name), None)
        if length_m is not None:
            found.append(_by_hand(name, now, length_m, "by tape"))
    return found


def _outline_m(now: Mapping[str, float], name: str, text: str) -> float:
    """Return a length of the outline; ValueError for one that the car's settings refuse."""
    length_m = _length_m(text)
    if why := refusal({**now, name: length_m}):
        raise ValueError(f"{text}: {why}")
    return length_m


def refusal(values: Mapping[str, float]) -> str:
    """Return why the car's settings refuse these values, "" where they do not."""
    section = {key.removeprefix("car."): value for key, value in values.items() if key.startswith("car.")}
    try:
        Settings.model_validate({"car": section})
    except ValidationError as error:
        return str(error.errors()[0]["msg"]).removeprefix("Value error, ")
    return ""


def _length_m(text: str) -> float:
    try:
        value = float(text.replace(",", "."))
    except ValueError:
        value = 0.0
    if not 0.0 < value < 100.0:
        raise ValueError(f"{text} is not a length in metres, as 0.42")
    return value


def _by_hand(name: str, now: Mapping[str, float], new: float, words: str) -> Proposal:
    return Proposal(name, now[name], new, words)


def table(measured: Sequence[Proposal]) -> str:
    """Return before and after as lines."""
    rows = [("setting", "before", "after", "")]
    rows += [
        (one.name, f"{one.old:g}", "as before" if one.new is None or not one.changes else f"{one.new:g}", one.words)
        for one in measured
    ]
    return "\n".join(in_columns(rows))


def _write(path: Path, changed: Sequence[Proposal], *, yes: bool) -> int:
    if not changed:
        say("nothing to write: every setting that could be measured is as before")
        return 0
    if not yes and not yes_or_no(f"write {len(changed)} values to {path}?", default=False):
        say("nothing was written: the car drives as before; the table above has the values")
        return 0
    kept = settings_file.write(path, changed, datetime.now(UTC).date().isoformat())
    say(f"{path}: {len(changed)} values written; restart the car. Undo: wallride calibrate --undo --config {path}")
    say(f"the values before are in {kept}")
    return 0
