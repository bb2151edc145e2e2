"""Options of `wallride logs` and `wallride record`."""

import argparse
import sys
from pathlib import Path

from wallride import client_options
from wallride.parser import Commands, at_least
from wallride.runtime.host.terminal_text import say

MB = 1_000_000


def add(commands: Commands) -> None:
    """Add both commands."""
    logs = commands.add_parser(
        "logs",
        help="recordings: list, get, keep, trim, info, recover",
        description="Without an action: list the recordings of this machine; with options, as `list`: --car NAME.",
    )
    actions = logs.add_subparsers(dest="action", metavar="ACTION")
    logs.set_defaults(run=client_options.client("logs"), action="list", print_line=say, local="", json=False)
    listing = actions.add_parser("list", help="list the recordings of a car or a local folder")
    getting = actions.add_parser("get", help="copy recordings from a car (default: the newest drive)")
    getting.add_argument("names", nargs="*", metavar="NAME", help="as in `wallride logs list`")
    getting.add_argument("--last", type=at_least(1), default=1, metavar="N", help="the newest N drives (default: 1)")
    getting.add_argument("--black-boxes", action="store_true", help="black boxes instead of drives")
    getting.add_argument(
        "-o",
        "--output",
        default=".",
        metavar="DIR",
        help="folder to write to, into a folder of the car (default: the current one)",
    )
    trimming = actions.add_parser("trim", help="delete the oldest recordings down to a size")
    trimming.add_argument("--keep-mb", type=at_least(0), required=True, metavar="MB", help="total size to keep")
    for action in (listing, getting, trimming):
        client_options.add_common(action)
        action.add_argument(
            "--local", nargs="?", const="", metavar="DIR",
            help="local folder instead of a car (default: this machine's recordings)",
        )  # fmt: skip
    _add_for_files(actions, listing)
    for action in actions.choices.values():
        action.set_defaults(run=client_options.client("logs"), print_line=say, progress=_progress)
    _add_record(commands)


def _add_for_files(actions: Commands, listing: argparse.ArgumentParser) -> None:
    info = actions.add_parser("info", help="show the contents of a recording")
    mending = actions.add_parser("recover", help="repair a truncated recording in place")
    keeping = actions.add_parser("keep", help="protect recordings from deletion for new ones")
    for action in (info, mending, keeping):
        action.add_argument("files", nargs="+", type=Path, metavar="FILE")
    for action in (listing, info):
        action.add_argument("--json", action="store_true", help="print JSON")


def _add_record(commands: Commands) -> None:
    record = commands.add_parser("record", help="start or stop a recording, independent of the drive")
    record.add_argument("action", choices=("start", "stop", "status"))
    record.add_argument("--json", action="store_true", help="print JSON")
    client_options.add_common(record)
    record.set_defaults(run=client_options.client("logs", "record"), print_line=say)


def _progress(name: str, got_bytes: int, of_bytes: int) -> None:
    """Show the progress on a terminal."""
    if sys.stderr.isatty():
        end = "\n" if got_bytes >= of_bytes else ""
        print(f"\r{name}  {got_bytes / MB:.1f} of {of_bytes / MB:.1f} MB", end=end, file=sys.stderr, flush=True)
