"""`wallride lab races`: laps on the maps of courses, by several laws, as a table beside theory and published times."""

import argparse
import time
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, replace
from pathlib import Path
from tempfile import TemporaryDirectory

from rich.console import Console

from wallride.runtime.host.terminal_text import complain
from wallride.sim.lab import laws
from wallride.sim.lab.cell import CellChoice, Figures
from wallride.sim.lab.command import INTERRUPTED, LabUsageError, check_folder, chosen, only, show, write
from wallride.sim.lab.laps import LOOPS
from wallride.sim.lab.pool import in_order, progress_bar
from wallride.sim.lab.workers.submit import submit
from wallride.sim.races.mapped_lap import map_course
from wallride.sim.races.race_cell import RaceCell, Racing, not_raced
from wallride.sim.races.race_table import tables
from wallride.sim.scenario.conditions import ConditionsError

EXPERIMENT = "races"
MUS = (0.8,)


@dataclass(frozen=True, slots=True)
class CourseMapping:
    """The work on a course: its map, in a folder."""

    folder: Path

    def __call__(self, course: str) -> Figures:
        """Return why the course cannot be raced on, "" where it can."""
        return {"reason": map_course(course, self.folder)}


def run(options: argparse.Namespace) -> int:
    """Map and race; 0 when it was completed, 1 when an own law failed, 2 for a wrong option, 130 after Ctrl-C."""
    console = Console(stderr=True)
    began_s = time.monotonic()
    try:
        choice = race_choice(options)
        cells = only(race_cells(choice, options), options.only)
        with folder_of_maps(options.output) as folder:
            rows = measure(cells, folder, options.jobs, console)
    except (LabUsageError, ConditionsError) as error:
        return complain(error)
    except KeyboardInterrupt:
        console.print("interrupted; no table was made")
        return INTERRUPTED
    made, took_s = tables(rows), time.monotonic() - began_s
    write(options, choice, rows, made, took_s)
    if options.json != "-":
        show(made, f"{len(cells)} races in {took_s:.0f} s")
    return laws.tell_own_law_faults(rows)


def race_choice(options: argparse.Namespace) -> CellChoice:
    """Return the selection of the options; LabUsageError or ConditionsError for invalid ones."""
    own_map = next((text for text in options.assignments if text.startswith("map.")), None)
    if own_map is not None:
        raise LabUsageError(f"--set {own_map}: every race has the map of its own course; leave it out")
    return replace(chosen(options, MUS), speeds_mps=(options.speed_mps,))


def race_cells(choice: CellChoice, options: argparse.Namespace) -> list[RaceCell]:
    """Return every race: of each course all laws, frictions and seeds."""
    courses = (*choice.maps, *LOOPS, *(f"track:seed={seed}" for seed in options.tracks))
    return [
        RaceCell(
            EXPERIMENT, course, law, options.speed_mps, mu, choice.sides[0], seed, own_parts=choice.own_parts,
            settings=choice.settings, conditions=choice.conditions, laps=options.laps, assumed=options.assumed,
            delay_s=options.delay_s, stiffness=options.stiffness, lateral_share=options.lateral_share,
            brake_share=options.brake_share, keep_m=options.keep_m, box=options.box,
        )
        for course in courses for mu in choice.mus for law in choice.laws for seed in choice.seeds
    ]  # fmt: skip


def measure(cells: Sequence[RaceCell], folder: Path, jobs: int | None, console: Console) -> list[Figures]:
    """Return the figures of every race in their order: first the maps are made, then all is driven."""
    courses = list(dict.fromkeys(cell.scenario for cell in cells))
    with progress_bar("maps", len(courses), console) as (progress, bar):
        mapped = in_order(submit(courses, CourseMapping(folder), jobs=jobs), lambda: progress.advance(bar))
    reasons = {course: found["reason"] for course, found in zip(courses, mapped, strict=True)}
    driven = [cell for cell in cells if not reasons[cell.scenario]]
    with progress_bar(EXPERIMENT, len(driven), console) as (progress, bar):
        figures = iter(in_order(submit(driven, Racing(folder), jobs=jobs), lambda: progress.advance(bar)))
    return [
        not_raced(cell, reasons[cell.scenario]) if reasons[cell.scenario] else next(figures) for cell in cells
    ]  # fmt: skip


@contextmanager
def folder_of_maps(named: Path | None) -> Iterator[Path]:
    """Yield the folder for the maps: the named one, which keeps them, or one that goes at the end."""
    if named is None:
        with TemporaryDirectory() as place:
            yield Path(place)
        return
    check_folder(named, "the maps of the laps")
    named.mkdir(exist_ok=True)
    yield named.absolute()
