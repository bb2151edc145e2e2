"""Options of `wallride param` and `wallride own-parts`. The client is imported when the command runs."""

from wallride import client_options
from wallride.parser import Commands, at_least


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
    for action in (listing, reading, past):
        action.add_argument("--json", action="store_true", help="print JSON")
    for action in (listing, reading, setting, saving, past):
        client_options.add_common(action)
        action.set_defaults(run=client_options.client("parameters"))


def _add_own_parts(commands: Commands) -> None:
    parts = commands.add_parser("own-parts", help="parts of the car that its lidar sees: show or forget them")
    actions = parts.add_subparsers(dest="action", required=True, metavar="ACTION")
    showing = actions.add_parser("show", help="show position and time of learning")
    forgetting = actions.add_parser("forget", help="learn them, and the dirt on the window, again; the car must stand")
    for action in (showing, forgetting):
        action.add_argument("--json", action="store_true", help="print JSON")
        client_options.add_common(action)
        action.set_defaults(run=client_options.client("own_parts"))
