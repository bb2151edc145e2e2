"""`wallride replay`: repeats the decisions of a recording and compares them, or plays it over zenoh."""

import argparse
import json
import logging
import math
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from rich.console import Console
from rich.table import Table

from wallride.runtime.host.output_files import write_answer
from wallride.runtime.telemetry.screen_words import because, times
from wallride.sim.recordings import RecordingError
from wallride.sim.replay.drive_log import DriveLog, is_mcap, read_log
from wallride.sim.replay.figures import numbers, stops
from wallride.sim.replay.foreign import open_any
from wallride.sim.replay.moment import moment_at_scan, moment_at_time
from wallride.sim.replay.reenact import ReplayVerdict, reenact
from wallride.sim.replay.run import RecordedRun, run_of

SAME, DIFFERS, CHANGED = 0, 1, 3
SHOWN_STOPS = 30


def run(options: argparse.Namespace) -> int:
    """Replay; 0 when every decision is the same (or foreign scans were judged), 1 at a difference.

    3 at one by changed laws, or after an unknown beginning.
    RecordingError or SettingsError when nothing can be replayed.
    """
    logger = logging.getLogger("wallride")
    level = logger.level
    logger.setLevel(logging.ERROR)  # the mux's reports would carry past times
    try:
        return _replay(options)
    finally:
        logger.setLevel(level)  # of the program that asked: a test, a notebook


def _replay(options: argparse.Namespace) -> int:
    if options.publish:
        from wallride.sim.replay import publish

        return publish.play(options)
    console = Console(highlight=False, markup=False, soft_wrap=True)
    path: Path = options.file
    if path.is_file() and is_mcap(path) and (log := read_log(path)).is_ours:
        return _again(log, options, console) if _is_whole(options) else _moment(log, options, console)
    if not _is_whole(options):
        raise RecordingError(f"{path}: --scan and --at need a recording of wallride, which has the car's decisions.")
    return _by_our_laws(options, console)


def _is_whole(options: argparse.Namespace) -> bool:
    return options.scan is None and options.at_s is None


def _moment(log: DriveLog, options: argparse.Namespace, console: Console) -> int:
    found = moment_at_time(log, options.at_s) if options.scan is None else moment_at_scan(log, options.scan)
    if not _write(found.as_plain(), options.json):
        for line in found.lines():
            console.print(line)
    return SAME


def _again(log: DriveLog, options: argparse.Namespace, console: Console) -> int:
    verdict = reenact(log, options.assignments)
    if _write(as_plain(log.name, verdict), options.json):
        return _code(verdict)
    for note in verdict.notes:
        console.print(f"note: {note}", style="dim")
    what = f"{verdict.decisions} decisions and {verdict.answers} answers over {verdict.duration_s:.1f} s"
    if verdict.first is None:
        how = "identical" if verdict.exact else "the same as far as they can be compared"
        console.print(f"{log.name}: {what}: {how}")
        return SAME
    if verdict.changed:
        console.print(f"{log.name}: {verdict.changed}.", style="bold")
        console.print(f"{what}: {verdict.differing} decisions come out otherwise, which is no fault of the recording")
    else:
        by = "by the very same laws" if verdict.exact else "as what the laws had learnt before may explain"
        by = "by the settings of --set" if options.assignments else by
        console.print(f"{log.name}: {what}: {verdict.differing} decisions differ, {by}")
    console.print(f"first difference: {verdict.first.sentence()}", style="bold")
    for difference in verdict.differences[1:]:
        if difference.scan == verdict.first.scan:
            console.print(f"             also: {difference.sentence()}")
    if verdict.largest_mps:
        console.print(f"largest difference of an allowed speed: {verdict.largest_mps:.3f} m/s", style="dim")
    return _code(verdict)


def _code(verdict: ReplayVerdict) -> int:
    """Return the exit code: other laws, and the same from an unknown beginning, may decide otherwise."""
    if verdict.first is None:
        return SAME
    return CHANGED if verdict.changed or not verdict.exact else DIFFERS


def as_plain(name: str, verdict: ReplayVerdict) -> dict[str, Any]:
    """Return a verdict as plain data for programs."""
    return {
        "name": name,
        "identical": verdict.first is None,
        "laws_changed": verdict.changed,
        "exact": verdict.exact,
        "decisions": verdict.decisions,
        "answers": verdict.answers,
        "scans": verdict.scans,
        "duration_s": verdict.duration_s,
        "differing_decisions": verdict.differing,
        "largest_speed_difference_mps": verdict.largest_mps,
        "differences": [
            {
                "scan": found.scan,
                "time_s": found.time_s,
                "what": found.what,
                "recorded": _finite(found.recorded),
                "replayed": _finite(found.replayed),
            }
            for found in verdict.differences
        ],
        "notes": verdict.notes,
    }


def _by_our_laws(options: argparse.Namespace, console: Console) -> int:
    opened = open_any(options.file, options.assignments, options.topic)
    told = run_of(opened.log)
    figures = numbers(told)
    found = [
        {"from_s": stop.from_s, "until_s": _finite(stop.until_s), "by": stop.winner, "reason": stop.reason,
         "measure": _finite(stop.measure), "also": list(stop.also), "speed_mps": _finite(stop.speed_mps)}
        for stop in stops(told)
    ]  # fmt: skip
    if _write({**figures, "stopped": found, "notes": list(told.notes)}, options.json):
        return SAME
    for note in told.notes:
        console.print(f"note: {note}", style="dim")
    _tell(console, told, figures)
    return SAME


def _tell(console: Console, told: RecordedRun, figures: Mapping[str, Any]) -> None:
    error = figures["distance_error"]
    side, wanted_m = figures["side"], figures["desired_distance_m"]
    seen = len([value for value in told.error.value if math.isfinite(value)])
    console.print(f"{told.name}: {figures['scans']} scans, {figures['duration_s']:.1f} s, by our laws", style="bold")
    console.print(
        f"{side} wall seen in {seen} scans; from the wanted {wanted_m:g} m the car was off by"
        f" {_metres(error['mean_abs_m'])} on average, {_metres(error['rms_m'])} RMS"
    )
    found = stops(told)
    table = Table(
        "at s", "for s", "by", "why", "the car drove", title=f"they would have stopped it {times(len(found))}"
    )
    for stop in found[:SHOWN_STOPS]:
        lasted = f"{stop.until_s - stop.from_s:.2f}" if math.isfinite(stop.until_s) else "to the end"
        why = because(stop.reason, stop.measure)
        table.add_row(f"{stop.from_s:.2f}", lasted, stop.winner, why, f"{stop.speed_mps:.2f} m/s")
    if found:
        console.print(table)
    if len(found) > SHOWN_STOPS:
        console.print(f"and {len(found) - SHOWN_STOPS} more: wallride report has them all")
    caps = [change for change in told.changes if change.winner == "safety" and change.allowed_mps != 0]
    if caps:
        began = "and" if found else "they would have"
        reasons = ", ".join(dict.fromkeys(cap.reason for cap in caps))
        console.print(f"{began} slowed it {times(len(caps))}: {reasons}")
    if not found and not caps:
        console.print("they would have let it drive")


def _write(answer: Mapping[str, Any], target: str | None) -> bool:
    """Write JSON to the requested file; True when no other output is requested."""
    write_answer(json.dumps(answer, indent=2) + "\n", target)
    return target == "-"


def _metres(value: float | None) -> str:
    return "an unknown distance" if value is None else f"{value:.3f} m"


def _finite(value: object) -> object:
    if isinstance(value, float):
        return value if math.isfinite(value) else None
    return value if value is None or isinstance(value, str | int | bool) else str(value)
