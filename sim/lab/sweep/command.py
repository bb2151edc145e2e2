"""`wallride lab sweep FILE`: runs what a file declares into a table, and goes on where it was interrupted."""

import argparse
import csv
import io
import json
import time
from collections.abc import Iterator, Mapping, Sequence
from contextlib import closing
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from rich.console import Console
from rich.table import Table

from wallride.runtime.host.output_files import write_answer
from wallride.runtime.host.terminal_text import complain
from wallride.sim.lab.command import INTERRUPTED, answer_console
from wallride.sim.lab.figures import distinct, mean, text
from wallride.sim.lab.pool import progress_bar
from wallride.sim.lab.sweep.drive_cell import DriveCell, measure, settings_hash
from wallride.sim.lab.sweep.plan import SweepPlan, read_plan
from wallride.sim.lab.sweep.table import RunKey, RunTable, TableError, columns, open_table, run_key
from wallride.sim.lab.workers.finished_cell import WorkerStartError
from wallride.sim.lab.workers.submit import submit
from wallride.sim.scenario.toml_lines import FileMistakeError

FAILED = 1
MAX_LINES = 40
SHOWN = ("mean_error_m", "rms_error_m", "mean_speed_mps", "min_clearance_m")
Row = Mapping[str, Any]


@dataclass(frozen=True, slots=True)
class Workers:
    """What runs the cells. jobs, on: as of `submit`."""

    jobs: int | None = None
    on: str = ""


@dataclass(frozen=True, slots=True)
class SweepCount:
    """Runs of a command: all of the sweep, those that were there, those made now, those of all that failed."""

    all: int
    known: int
    made: int
    failed: int


def run(options: argparse.Namespace) -> int:
    """Run a sweep; 0 when all runs are in the table, 1 when some of them failed, 2 for a mistake, 130 after Ctrl-C."""
    console = Console(stderr=True)
    table_path: Path = options.table or options.file.with_suffix(".sqlite")
    began_s = time.monotonic()
    try:
        plan = read_plan(options.file)
        with open_table(table_path, writes=True) as table:
            if options.again_failed:
                table.forget_failed()
            keys = list(keys_of(plan))
            count = fill(table, plan, keys, Workers(options.jobs, options.on), console)
            rows = [one.row() for one in table.runs(keys)]
    except (FileMistakeError, TableError, WorkerStartError) as error:
        return complain(error)
    except KeyboardInterrupt:
        console.print(f"interrupted; what has ended is in {table_path}, and the same command goes on")
        return INTERRUPTED
    export(options, rows)
    if "-" not in {str(options.json), str(options.csv)}:
        out = answer_console()
        _show(rows, plan, out)
        took_s = time.monotonic() - began_s
        out.print(
            f"{count.all} runs in {table_path}: {count.made} made in {took_s:.1f} s, {count.known} were there,"
            f" {count.failed} failed", highlight=False, soft_wrap=True,
        )  # fmt: skip
    return FAILED if count.failed else 0


def keys_of(plan: SweepPlan) -> Iterator[RunKey]:
    """Yield the key of every run; FileMistakeError for the first one with a wrong value, before any is driven."""
    for cell in plan.cells:
        yield run_key(cell, settings_hash(cell, plan.setup_of(cell)))


def fill(table: RunTable, plan: SweepPlan, keys: Sequence[RunKey], workers: Workers, console: Console) -> SweepCount:
    """Run what the table does not have."""
    known = table.known()
    missing = [(cell, key) for cell, key in zip(plan.cells, keys, strict=True) if key not in known]
    cells: list[DriveCell] = [cell for cell, _ in missing]
    with (
        progress_bar(plan.text.path.stem, len(keys), console) as (progress, bar),
        closing(submit(cells, measure, jobs=workers.jobs, on=workers.on)) as ended,
    ):
        progress.advance(bar, len(keys) - len(missing))
        for done in ended:
            table.add(missing[done.index][1], done)
            progress.advance(bar)
    failed = sum(bool(one.error) for one in table.runs(keys))
    return SweepCount(len(keys), len(keys) - len(missing), len(missing), failed)


def export(options: argparse.Namespace, rows: Sequence[Row]) -> None:
    """Write the rows as CSV and JSON where that was asked for; "-" is standard output."""
    write_answer(json.dumps(rows, indent=1, allow_nan=False) + "\n", options.json)
    write_answer(_csv_text(rows), options.csv)


def _csv_text(rows: Sequence[Row]) -> str:
    file = io.StringIO()
    writer = csv.DictWriter(file, columns(rows))
    writer.writeheader()
    for row in rows:
        writer.writerow({name: json.dumps(one) if isinstance(one, list) else one for name, one in row.items()})
    return file.getvalue()


def _show(rows: Sequence[Row], plan: SweepPlan, console: Console) -> None:
    """Print the means for every combination of the grid, and the first failures."""
    names = [name for name in plan.varied if name != "seed"]
    groups: dict[tuple[str, ...], list[Row]] = {}
    for row in rows:
        groups.setdefault(tuple(str(row.get(name)) for name in names), []).append(row)
    table = Table(*names, "runs", "failed", "contacts", *SHOWN, title=plan.text.path.stem, title_justify="left")
    for values, some in list(groups.items())[:MAX_LINES]:
        whole = [row for row in some if not row["error"]]
        contacts = sum(row["collided"] for row in whole)
        means = [text(mean(whole, name)) if whole else "-" for name in SHOWN]
        table.add_row(*values, str(len(some)), str(len(some) - len(whole)), str(contacts), *means)
    console.print(table)
    if len(groups) > MAX_LINES:
        console.print(f"  {len(groups) - MAX_LINES} further combinations are in the table alone", highlight=False)
    for error in [one for one in distinct(rows, "error") if one][:5]:
        console.print(f"  failed: {error}", highlight=False, soft_wrap=True)
