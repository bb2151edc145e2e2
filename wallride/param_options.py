"""Options of `wallride param` and `wallride own-parts`. The client is imported when the command runs."""

import argparse
from pathlib import Path

from wallride import client_options
from wallride.parser import Commands, add_config, at_least, default_config, number


def add(commands: Commands) -> None:
    """Add both commands."""
    _add_own_parts(commands)
    param = commands.add_parser("param", help="list, read, change and save the settings of a running car")
    actions = param.add_subparsers(dest="action", required=True, metavar="ACTION")
    listing = actions.add_parser("list", help="every setting with its value, range, unit and meaning")
    listing.add_argument("under", nargs="?", default="", metavar="PREFIX", help="prefix of the names")
    reading = actions.add_parser("get", help="print the values of settings")
    reading.add_argument("names", nargs="+", metavar="NAME")
    setting = actions.add_parser("set", help="change settings while the car drives; all or none")
    setting.add_argument("assignments", nargs="+", metavar="NAME=VALUE", help="for example wall_follow.kp=10")
    saving = actions.add_parser("save", help="write the changes to the settings file of the car")
    saving.add_argument(
        "assignments", nargs="*", metavar="NAME=VALUE", help="further settings to write, in effect after a restart"
    )
    past = actions.add_parser("history", help="list changes with time and author")
    past.add_argument("-n", dest="most", type=at_least(1), default=50, metavar="N", help="the newest N (default: 50)")
    racing = actions.add_parser(
        "race", help="on the car's computer: have a car that stands start anew, to race along a map's line"
    )
    racing.add_argument("map", type=Path, metavar="MAP.yaml", help="a map of `wallride map`, its line beside it")
    racing.add_argument(
        "--speed", dest="speed_mps", type=number(0.1, 50.0), metavar="MPS",
        help="highest speed that is asked (default: the line's)",
    )  # fmt: skip
    add_config(racing, "settings file of the car, where map and law are written", positional=False)
    client_options.add_common(racing)
    racing.set_defaults(run=run_race)
    for action in (listing, reading, past):
        action.add_argument("--json", action="store_true", help="print JSON")
    for action in (listing, reading, setting, saving, past):
        client_options.add_common(action)
        action.set_defaults(run=client_options.client("parameters"))


def run_race(options: argparse.Namespace) -> int:
    """Write map and law, and have the car start anew."""
    from wallride.clients import race_along

    options.config = options.config or default_config()
    return client_options.run_client(race_along.run, options)


def _add_own_parts(commands: Commands) -> None:
    parts = commands.add_parser("own-parts", help="parts of the car that its lidar sees: show or forget them")
    actions = parts.add_subparsers(dest="action", required=True, metavar="ACTION")
    showing = actions.add_parser("show", help="show position and time of learning")
    forgetting = actions.add_parser("forget", help="learn them, and the dirt on the window, again; the car must stand")
    for action in (showing, forgetting):
        action.add_argument("--json", action="store_true", help="print JSON")
        client_options.add_common(action)
        action.set_defaults(run=client_options.client("own_parts"))
