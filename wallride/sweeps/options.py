"""Options of `wallride lab sweep`, `compare` and `scenario`. The lab is imported when a command runs."""

import argparse
from pathlib import Path

from wallride.failure import later
from wallride.parser import Commands, add_jobs, add_json, add_set, writable, writable_path


def add(experiments: Commands) -> None:
    """Add the commands."""
    _add_sweep(experiments)
    _add_compare(experiments)
    _add_scenario(experiments)


def _command(experiments: Commands, name: str, module: str, what: str, description: str) -> argparse.ArgumentParser:
    command = experiments.add_parser(name, help=what, description=description)
    command.set_defaults(run=later(module, "sim", "the simulator needs"))
    return command


def _add_sweep(experiments: Commands) -> None:
    sweep = _command(
        experiments, "sweep", "wallride.sim.lab.sweep.command",
        "runs declared in a file, into a table; goes on where it was interrupted",
        "Runs what a TOML file declares (a grid, random values) into an SQLite table. Each run counts "
        "once: the same command again runs only what is missing.",
    )  # fmt: skip
    sweep.add_argument("file", type=Path, metavar="FILE.toml", help="the sweep (docs/sweeps.md)")
    sweep.add_argument("--table", type=writable_path, metavar="FILE", help="table of the runs (default: FILE.sqlite)")
    add_jobs(sweep)
    sweep.add_argument(
        "--on", default="", metavar="ADDRESS", help="Ray cluster: ray (on this machine), HOST:PORT or ray://HOST:10001"
    )
    sweep.add_argument("--csv", type=writable, metavar="FILE|-", help="write the runs as CSV")
    add_json(sweep, "the runs")
    sweep.add_argument("--again-failed", action="store_true", help="run those again that failed")


def _add_compare(experiments: Commands) -> None:
    compare = _command(
        experiments, "compare", "wallride.sim.lab.compare.command",
        "whether two sweeps differ: paired differences with bootstrap intervals",
        "Compares two tables, sweeps or settings files run by run, and says which figures differ. "
        "FILE:law=report takes a part of one.",
    )  # fmt: skip
    for side in ("A", "B"):
        compare.add_argument(side.lower(), metavar=side, help="table, sweep or settings file; FILE:NAME=VALUE a part")
    compare.add_argument("--sweep", type=Path, metavar="FILE", help="the drives, where A and B are settings files")
    compare.add_argument("--figures", metavar="A,B", help="figures to compare (default: the usual ones)")
    compare.add_argument(
        "--confidence", type=float, default=0.99, metavar="P", help="of the intervals and the test (default: 0.99)"
    )
    add_jobs(compare)
    add_json(compare, "the comparison")


def _add_scenario(experiments: Commands) -> None:
    scenario = _command(
        experiments, "scenario", "wallride.sim.scenario.command",
        "drives scenario files in virtual time: pass or fail for each expectation",
        "Drives scenario files in virtual time, with the whole process, and says what each expectation "
        "came to. Exit code 1 when one fails, 2 for a mistake in a file. wallride sim FILE plays one in real time.",
    )  # fmt: skip
    scenario.add_argument("files", type=Path, nargs="+", metavar="FILE.toml", help="scenarios (docs/scenarios.md)")
    add_set(scenario)
    add_json(scenario, "the results")
