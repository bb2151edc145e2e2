"""`wallride lab EXPERIMENT`: from the options to all runs, tables on the terminal, a JSON file and pictures."""

import argparse
import fnmatch
import json
import math
import sys
import time
from collections.abc import Sequence
from pathlib import Path
from typing import Any, TypeVar

from rich.console import Console
from rich.table import Table

from wallride.runtime.control.own_laws.law_class import is_own
from wallride.runtime.host.output_files import write_answer
from wallride.runtime.host.terminal_text import complain
from wallride.runtime.line_files import read_course
from wallride.runtime.map_files import MapError
from wallride.runtime.settings.tree import SettingsError
from wallride.sim.lab import laws
from wallride.sim.lab.cell import DESIRED_M, Cell, CellChoice, Figures, TabledCell, course_name
from wallride.sim.lab.laps import maps_in
from wallride.sim.lab.pool import CellFailedError, experiment, measure_all
from wallride.sim.scenario.conditions import ConditionsError, RequestedConditions, named_conditions, named_once
from wallride.sim.world.map_file import check_map
from wallride.sim.world.own_parts import OWN_PARTS
from wallride.sim.world.pose import Side

C = TypeVar("C", bound=Cell)
FAILED, INTERRUPTED = 1, 130
SPEEDS_MPS, QUICK_SPEEDS_MPS = (1.0, 2.0, 3.0, 4.0), (1.0, 3.0)
MUS, QUICK_MUS = (0.5, 0.8, 1.0), (0.8,)
SIDES: tuple[Side, ...] = ("left", "right")
FIXED_SETTINGS = {
    "wall_follow.method": "--method",
    "wall_follow.side": "--side",
    "wall_follow.desired_distance_m": "--distance",
    "wall_follow.speed_mps": "--speeds",
    "safety.method": "--method FOLLOWER+GUARD",
}
"""Settings that every run has of its own, and the options that choose them."""
MIN_DISTANCE_M, MAX_DISTANCE_M = 0.3, 3.0
_PIPE_WIDTH = 160
_NEARBY_MAPS = ("data/maps", "shared/data/maps")


class LabUsageError(Exception):
    """Invalid option; the text names the fault and the valid form."""


def run(options: argparse.Namespace) -> int:
    """Run one experiment; 0 when it was completed, 1 when an own law failed, 2 for a wrong option, 130 after Ctrl-C."""
    console = Console(stderr=True)
    try:
        choice = chosen(options)
        _check_outputs(options)
        chosen_experiment = experiment(_experiment(options))
        cells = only(chosen_experiment.cells(choice), options.only)
        if options.plot is not None:
            options.plot.mkdir(parents=True, exist_ok=True)
        began_s = time.monotonic()
        figures = measure_all(cells, options.jobs, options.plot, console)
    except (LabUsageError, ConditionsError) as error:
        return complain(error)
    except CellFailedError as error:
        if not any(map(is_own, choice.laws)):
            raise
        complain(error)
        return FAILED
    except KeyboardInterrupt:
        console.print("interrupted; nothing was written")
        return INTERRUPTED
    took_s = time.monotonic() - began_s
    tables = chosen_experiment.tables(figures)
    write(options, choice, figures, tables, took_s)
    if options.json != "-":
        show(tables, f"{len(cells)} runs in {took_s:.0f} s")
    return laws.tell_own_law_faults(figures)


def chosen(options: argparse.Namespace, mus: tuple[float, ...] = MUS) -> CellChoice:
    """Return the selection of the options; LabUsageError or ConditionsError for invalid ones.

    mus: frictions where none is named.
    """
    quick = options.quick
    seeds = _seeds(options)
    laws_chosen = _laws(options.method)
    conditions = named_conditions(RequestedConditions(options.conditions, options.condition))
    mu = named_once(conditions, "vehicle.grip_mu", "--mu", options.mu)
    own_parts = named_once(conditions, "lidar.own_parts", "--own-parts", options.own_parts)
    return CellChoice(
        laws_chosen,
        _numbers("--speeds", options.speeds, 0.3, 8.0) or (QUICK_SPEEDS_MPS if quick else SPEEDS_MPS),
        _numbers("--mu", mu if mu is None else str(mu), 0.1, 2.0) or (QUICK_MUS if quick else mus),
        _sides(options.side, quick=quick),
        seeds,
        quick,
        _maps(options),
        getattr(options, "recordings", ()),
        _distance_m(options),
        getattr(options, "generated", False),
        checked_own_parts(own_parts),
        _settings(options, laws_chosen),
        conditions,
    )


def only(cells: Sequence[C], text: str | None) -> list[C]:
    """Return the cells whose course has one of the names, or matches a pattern; UsageError for a wrong one."""
    if text is None:
        return list(cells)
    courses = dict.fromkeys(cell.scenario for cell in cells)
    kept: set[str] = set()
    for pattern in (part.strip() for part in text.split(",")):
        found = [
            course
            for course in courses
            if fnmatch.fnmatch(course, pattern) or fnmatch.fnmatch(course_name(course), pattern)
        ]
        if not found:
            known = ", ".join(dict.fromkeys(map(course_name, courses)))
            raise LabUsageError(f"--only {pattern}: no course is called so; write some of {known}")
        kept.update(found)
    return [cell for cell in cells if cell.scenario in kept]


def _experiment(options: argparse.Namespace) -> str:
    """Return the module of the experiment: generated rooms have one of their own."""
    generated = options.experiment == "rooms" and options.generated
    return "generated_rooms" if generated else str(options.experiment)


def _seeds(options: argparse.Namespace) -> tuple[int, ...]:
    """Return the seeds: a number of them from the first on, or from A to before B."""
    from_text, colon, to_text = str(options.seeds).partition(":")
    try:
        first, last = (int(from_text), int(to_text)) if colon else (options.seed, options.seed + int(from_text))
    except ValueError:
        first, last = -1, -1
    if first < 0 or last <= first:
        raise LabUsageError(
            f"--seeds {options.seeds} --seed {options.seed}: write how many, or FIRST:END; seeds count from 0, and at"
            " least one is needed"
        )
    return tuple(range(first, last))


def _laws(text: str) -> tuple[str, ...]:
    try:
        return tuple(dict.fromkeys(laws.check(name.strip()) for name in text.split(",")))
    except ValueError as error:
        raise LabUsageError(f"--method {text}: {error}") from None


def _settings(options: argparse.Namespace, chosen_laws: Sequence[str]) -> tuple[str, ...]:
    """Return the settings of every car; UsageError for one that a law does not have or that the runs fix."""
    assignments: list[str] = getattr(options, "assignments", [])
    fixed = next((text for text in assignments if text.partition("=")[0].strip() in FIXED_SETTINGS), None)
    if fixed is not None:
        raise LabUsageError(f"--set {fixed}: the lab varies it; use {FIXED_SETTINGS[fixed.partition('=')[0].strip()]}")
    for law in chosen_laws:
        try:
            settings = laws.settings_of(law, "left", DESIRED_M, 1.0, assignments)
            read_course(settings.map, settings.car)
        except (SettingsError, MapError) as error:
            raise LabUsageError(f"{law}: {error}") from None
    return tuple(assignments)


def _numbers(option: str, text: str | None, low: float, high: float) -> tuple[float, ...]:
    if text is None:
        return ()
    try:
        numbers = tuple(dict.fromkeys(float(part) for part in text.split(",")))
    except ValueError:
        numbers = ()
    if not numbers or not all(math.isfinite(number) and low <= number <= high for number in numbers):
        raise LabUsageError(f"{option} {text}: write numbers between {low:g} and {high:g} with commas between them")
    return numbers


def _distance_m(options: argparse.Namespace) -> float:
    text: str | None = getattr(options, "distance", None)
    distances_m = _numbers("--distance", text, MIN_DISTANCE_M, MAX_DISTANCE_M)
    if len(distances_m) > 1:
        raise LabUsageError(f"--distance {text}: write one number; the tables of two would not be told apart")
    return distances_m[0] if distances_m else DESIRED_M


def checked_own_parts(kind: str | None) -> str:
    """Return the kind of own parts, "" for none named; LabUsageError for an unknown one."""
    if kind is not None and kind not in OWN_PARTS:
        raise LabUsageError(f"--own-parts {kind}: write one of {', '.join(OWN_PARTS)}")
    return kind or ""


def _sides(text: str | None, *, quick: bool) -> tuple[Side, ...]:
    if text is None:
        return SIDES[:1] if quick else SIDES
    wanted = [part.strip() for part in text.split(",")]
    if not set(wanted) <= set(SIDES):
        raise LabUsageError(f"--side {text}: write left, right or left,right")
    return tuple(side for side in SIDES if side in wanted)


def _maps(options: argparse.Namespace) -> tuple[str, ...]:
    """Return the maps to drive; UsageError for one that cannot be read, before any of them is driven."""
    found = _found_maps(options) if hasattr(options, "maps") else ()
    for path in found:
        try:
            check_map(Path(path))
        except (ValueError, OSError) as error:
            raise LabUsageError(str(error)) from None
    return found


def _found_maps(options: argparse.Namespace) -> tuple[str, ...]:
    folder: Path | None = options.maps
    if folder is not None:
        found = maps_in(folder)
        if not found:
            raise LabUsageError(f"--maps {folder}: there is no .yaml file of a map in it")
        return found
    above = [Path.cwd(), *Path(__file__).resolve().parents]
    nearby = (place / name for place in above for name in _NEARBY_MAPS)
    return next((found for place in nearby if (found := maps_in(place))), ())


def check_folder(path: Path, what: str) -> None:
    """Refuse a folder for `what` that -o names where none can be made, before minutes of driving; LabUsageError."""
    if path.exists() and not path.is_dir():
        raise LabUsageError(f"-o {path}: is a file; name a folder for {what}")
    if not path.absolute().parent.is_dir():
        raise LabUsageError(f"-o {path}: there is no folder {path.parent}; make it first")


def _check_outputs(options: argparse.Namespace) -> None:
    """Check the folder of pictures before minutes of driving, not after them."""
    if options.plot is not None and options.plot.exists() and not options.plot.is_dir():
        raise LabUsageError(f"--plot {options.plot}: is not a directory; name one for the pictures")


def write(
    options: argparse.Namespace,
    choice: CellChoice,
    figures: Sequence[Figures],
    tables: Sequence[TabledCell],
    took_s: float,
) -> None:
    """Write the JSON file that the options name, if any."""
    if options.json is None:
        return
    summary: dict[str, Any] = {
        "experiment": options.experiment,
        "methods": choice.laws,
        "speeds_mps": choice.speeds_mps,
        "mu": choice.mus,
        "sides": choice.sides,
        "seeds": choice.seeds,
        "quick": choice.quick,
        "settings": choice.settings,
        "conditions": choice.conditions,
        "took_s": round(took_s, 1),
        "notes": {table.title: table.notes for table in tables if table.notes},
        "cells": figures,
    }
    write_answer(json.dumps(summary, indent=1, allow_nan=False) + "\n", options.json)


def answer_console(*, markup: bool = True) -> Console:
    """Return standard output for tables."""
    # A file or a pipe has no width of its own: use one that no table breaks.
    return Console(width=None if sys.stdout.isatty() else _PIPE_WIDTH, markup=markup)


def show(tables: Sequence[TabledCell], took: str) -> None:
    """Print tables with their notes. took: what was run, and how long."""
    console = answer_console(markup=False)
    for made in tables:
        table = Table(*made.columns, title=made.title, title_justify="left")
        for row in made.rows:
            table.add_row(*row)
        console.print(table)
        for note in made.notes:
            console.print(f"  {note}", highlight=False)
    console.print(took, highlight=False)
