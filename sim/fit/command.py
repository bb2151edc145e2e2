"""`wallride lab fit FILE...`: estimates a car's parameters from recordings of its drives."""

import argparse
from pathlib import Path

from rich.console import Console
from rich.table import Table

from wallride.runtime.host.output_files import write_file
from wallride.runtime.host.terminal_text import complain
from wallride.sim.fit.estimate import CarEstimate, conditions_text, distance, estimate, rows
from wallride.sim.lab.command import answer_console
from wallride.sim.recordings import RecordingError


def run(options: argparse.Namespace) -> int:
    """Estimate, show, and write the conditions where --out asks for them; 2 for an unusable recording or file."""
    try:
        with Console(stderr=True).status(f"matching the scans of {len(options.files)} recordings"):
            found = estimate(options.files, options.wheelbase, options.topic)
        if options.out is not None:
            write_file(options.out, conditions_text(found))
    except RecordingError as error:
        return complain(error)
    _show(found, answer_console(), options.out)
    return 0


def _show(found: CarEstimate, console: Console, out: Path | None) -> None:
    drive = found.drive
    table = Table(
        title=f"{', '.join(found.names)}: {drive.moved_m:.1f} m, speed by {drive.origin}", title_justify="left"
    )
    table.add_column("parameter")
    table.add_column("estimate (90 % interval)", overflow="fold")
    for row in rows(found):
        table.add_row(row.name, row.text)
    console.print(table)
    console.print(distance(found), highlight=False)
    if out is not None:
        console.print(
            f"Try it: wallride sim --conditions {out}, wallride lab walls --conditions {out}",
            highlight=False,
            soft_wrap=True,
        )
