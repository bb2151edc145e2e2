"""Options of `wallride own-parts`."""

from wallride import client_options
from wallride.parser import Commands


def add(commands: Commands) -> None:
    """Add `own-parts` and its two actions."""
    parts = commands.add_parser("own-parts", help="parts of the car that its lidar sees: show or forget them")
    actions = parts.add_subparsers(dest="action", required=True, metavar="ACTION")
    showing = actions.add_parser("show", help="show position and time of learning")
    forgetting = actions.add_parser("forget", help="learn them, and the dirt on the window, again; the car must stand")
    for action in (showing, forgetting):
        action.add_argument("--json", action="store_true", help="print JSON")
        client_options.add_common(action)
        action.set_defaults(run=client_options.client("own_parts"))
