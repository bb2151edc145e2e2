"""Options of `wallride lab sweep`, `compare` and `scenario`. The lab is imported when a command runs."""

import argparse
from collections.abc import Callable
from importlib import import_module
from pathlib import Path
from typing import Any

from wallride.parser import add_set


def add(experiments: "argparse._SubParsersAction[argparse.ArgumentParser]") -> None:
    """Add the commands."""
    _add_sweep(experiments)
    _add_compare(experiments)
    _add_scenario(experiments)


def _add_sweep(experiments: "argparse._SubParsersAction[argparse.ArgumentParser]") -> None:
    sweep = experiments.add_parser(
        "sweep", help="runs declared in a file, into a table; goes on where it was interrupted",
        description="Runs what a TOML file declares (a grid, random values) into an SQLite table. Each run counts "
        "once: the same command again runs only what is missing.",
    )  # fmt: skip
    sweep.set_defaults(run=_running("sim.lab.sweep.command"))
    sweep.add_argument("file", type=Path, metavar="FILE.toml", help="the sweep (docs/sweeps.md)")
    sweep.add_argument("--table", type=Path, metavar="FILE", help="table of the runs (default: FILE.sqlite)")
    sweep.add_argument("--jobs", type=int, metavar="N", help="processes (default: one per core)")
    sweep.add_argument(
        "--on", default="", metavar="ADDRESS", help="Ray cluster: ray (on this machine), HOST:PORT or ray://HOST:10001"
    )
    sweep.add_argument("--csv", metavar="FILE|-", help="write the runs as CSV")
    sweep.add_argument("--json", metavar="FILE|-", help="write the runs as JSON")
    sweep.add_argument("--again-failed", action="store_true", help="run those again that failed")


def _add_compare(experiments: "argparse._SubParsersAction[argparse.ArgumentParser]") -> None:
    compare = experiments.add_parser(
        "compare", help="whether two sweeps differ: paired differences with bootstrap intervals",
        description="Compares two tables, sweeps or settings files run by run, and says which figures differ. "
        "FILE:law=report takes a part of one.",
    )  # fmt: skip
    compare.set_defaults(run=_running("sim.lab.compare.command"))
    for side in ("A", "B"):
        compare.add_argument(side.lower(), metavar=side, help="table, sweep or settings file; FILE:NAME=VALUE a part")
    compare.add_argument("--sweep", type=Path, metavar="FILE", help="the drives, where A and B are settings files")
    compare.add_argument("--figures", metavar="A,B", help="figures to compare (default: the usual ones)")
    compare.add_argument(
        "--confidence", type=float, default=0.99, metavar="P", help="of the intervals and the test (default: 0.99)"
    )
    compare.add_argument("--jobs", type=int, metavar="N", help="processes (default: one per core)")
    compare.add_argument("--json", metavar="FILE|-", help="write the comparison as JSON")


def _add_scenario(experiments: "argparse._SubParsersAction[argparse.ArgumentParser]") -> None:
    scenario = experiments.add_parser(
        "scenario", help="drives scenario files in virtual time: pass or fail for each expectation",
        description="Drives scenario files in virtual time, with the whole process, and says what each expectation "
        "came to. Exit code 1 when one fails, 2 for a mistake in a file. wallride sim FILE plays one in real time.",
    )  # fmt: skip
    scenario.set_defaults(run=_running("sim.scenario.command"))
    scenario.add_argument("files", type=Path, nargs="+", metavar="FILE.toml", help="scenarios (docs/scenarios.md)")
    add_set(scenario)
    scenario.add_argument("--json", metavar="FILE|-", help="write the results as JSON")


def _running(module: str) -> Callable[[argparse.Namespace], int]:
    """Return what runs a command of the lab."""

    def run(options: argparse.Namespace) -> int:
        from wallride.failure import needs

        with needs("sim", "the simulator needs"):
            command: Any = import_module(module)
        return int(command.run(options))

    return run
