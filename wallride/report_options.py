"""Options of `wallride report` and `wallride plot`. The code is imported when the command runs."""

import argparse
from functools import partial
from pathlib import Path

from wallride import client_options, replay_options
from wallride.failure import needs
from wallride.parser import Commands, add_json, number, writable_path


def add(commands: Commands) -> None:
    """Add both commands."""
    report = commands.add_parser("report", help="write a page about a recorded run, or two side by side")
    replay_options.add_file(report)
    report.add_argument("beside", nargs="?", type=Path, metavar="FILE2", help="second recording")
    report.add_argument(
        "-o",
        dest="output",
        type=writable_path,
        metavar="RUN.html",
        help="page to write (default: in the current folder)",
    )
    add_json(report, "the figures")
    report.add_argument(
        "--summary",
        type=Path,
        metavar="FILE",
        help="summary of `wallride sim --json`: true position beside the estimated one",
    )
    report.set_defaults(run=partial(replay_options.run_offline, "wallride.sim.run_report.command"))
    plot = commands.add_parser(
        "plot", help="draw topics live in this terminal", description="Needs a terminal only, for example over ssh."
    )
    plot.add_argument(
        "topics", nargs="*", default=["distance_error"], metavar="TOPIC[:FIELD]",
        help="for example distance_error, motor:velocity.0, status:scan_to_motor_ms.p99 (default: distance_error)",
    )  # fmt: skip
    plot.add_argument(
        "--seconds",
        type=number(1, 600, "a number of seconds"),
        default=20.0,
        metavar="S",
        help="time span (default: 20)",
    )
    plot.add_argument("--once", action="store_true", help="listen for that time, draw once and exit")
    client_options.add_common(plot)
    plot.set_defaults(run=_plot, print_line=partial(print, flush=True))


def _plot(options: argparse.Namespace) -> int:
    with needs("clients", "plot needs"):
        from wallride.clients import plot
    return client_options.run_client(plot.run, options)
