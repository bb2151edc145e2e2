"""What `wallride param` understands. Only definitions: the client is imported when it is asked for."""

import argparse
from typing import TYPE_CHECKING

from wallride import client_options

if TYPE_CHECKING:
    Commands = argparse._SubParsersAction[argparse.ArgumentParser]  # noqa: SLF001 - argparse has no public name for it


def add(commands: "Commands") -> None:
    """Add `param` and its five actions."""
    param = commands.add_parser("param", help="list, read, change and save a driving car's settings")
    actions = param.add_subparsers(dest="action", required=True, metavar="ACTION")
    listing = actions.add_parser("list", help="every setting with its value, range, unit and meaning")
    listing.add_argument("under", nargs="?", default="", metavar="PREFIX", help="only names that begin so")
    reading = actions.add_parser("get", help="the value of one setting, or of several")
    reading.add_argument("names", nargs="+", metavar="NAME")
    setting = actions.add_parser("set", help="change settings while the car drives, all of them or none")
    setting.add_argument("assignments", nargs="+", metavar="NAME=VALUE", help="for example wall_follow.kp=0.5")
    saving = actions.add_parser("save", help="write what was set into the car's own file")
    saving.add_argument(
        "assignments", nargs="*", metavar="NAME=VALUE", help="settings for after a restart, to be written as well"
    )
    past = actions.add_parser("history", help="who changed what, and when")
    past.add_argument("-n", dest="most", type=int, default=50, metavar="N", help="the newest N (default: 50)")
    for action in (listing, reading, past):
        action.add_argument("--json", action="store_true", help="as JSON, for programs")
    for action in (listing, reading, setting, saving, past):
        client_options.add_common(action)
        action.set_defaults(run=run)


def run(options: argparse.Namespace) -> int:
    """Ask the car."""
    from clients import parameters

    return client_options.run_client(parameters.run, options)
