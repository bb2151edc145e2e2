"""Options of `wallride keys`: access to a car over the network."""

import argparse
from pathlib import Path

from wallride.failure import fail, needs
from wallride.parser import Commands, add_config, default_config, number
from wallride.runtime.host.terminal_text import one_line, say

DEFAULT_DIR = Path("/etc/wallride/keys")
ROLES = ("viewer", "operator", "admin", "planner", "car")


def add(commands: Commands) -> None:
    """Add the command and its five actions."""
    keys = commands.add_parser("keys", help="access to this car over the network: keys and roles")
    actions = keys.add_subparsers(dest="action", required=True, metavar="ACTION")
    init = actions.add_parser("init", help="create the keys of this car")
    init.add_argument(
        "--san", action="append", default=[], metavar="NAME|IP", help="another name or address of the car (repeatable)"
    )
    person = _add_person(actions)
    revoke = actions.add_parser("revoke", help="remove every right of a person")
    revoke.add_argument("name", metavar="NAME")
    show = actions.add_parser("list", help="show persons, roles and expiry")
    show.add_argument("--json", action="store_true", help="print JSON")
    router = _add_router(actions)
    for action in (init, person, router):
        action.add_argument("--days", type=_days, default=365, metavar="N", help="validity in days (default: 365)")
        action.add_argument("--renew", action="store_true", help="replace existing keys")
    for action in (init, person, revoke, show, router):
        action.add_argument("--dir", type=Path, default=DEFAULT_DIR, help=f"folder of keys (default: {DEFAULT_DIR})")
        action.add_argument("--car", metavar="NAME", help="name of the car (default: car.name of its settings)")
        add_config(action, positional=False)
        action.set_defaults(run=run)


def _add_person(actions: Commands) -> argparse.ArgumentParser:
    person = actions.add_parser("add", help="create keys for a person or a computer")
    person.add_argument("name", metavar="NAME", help="a-z, 0-9, _ and -, up to 24 characters (a car: 32)")
    person.add_argument(
        "--role",
        choices=ROLES,
        help="viewer: receives topics, reads settings; operator: also drives, changes settings; admin: also records;"
        " planner: a viewer that plans under safety; car: one of a fleet, at its routers (with --renew: as before)",
    )
    person.add_argument("--out", type=Path, metavar="DIR", help="new folder for the keys (default: ./NAME-keys)")
    return person


def _add_router(actions: Commands) -> argparse.ArgumentParser:
    router = actions.add_parser("router", help="create or update a router of a fleet: its keys and its configuration")
    router.add_argument("name", metavar="NAME", help="name of the router, by which cars and people reach it")
    router.add_argument(
        "--san",
        action="append",
        default=[],
        metavar="NAME|IP",
        help="another name or address of the router (repeatable)",
    )
    router.add_argument(
        "--listen", action="append", default=[], metavar="ENDPOINT",
        help="where the router listens (repeatable; default: tls/[::]:7449)",
    )  # fmt: skip
    router.add_argument(
        "--at",
        type=Path,
        metavar="DIR",
        help="where its folder will be on the router's computer, for a start from elsewhere (default: any)",
    )
    router.add_argument(
        "--scan-hz", type=number(0.1, 100), default=10.0, metavar="HZ",
        help="maximum rate of each car's scans for a viewer (default: 10)",
    )  # fmt: skip
    return router


def run(options: argparse.Namespace) -> int:
    """Run the action and print the next step; exit code 2 with one line for an error that the user can correct."""
    from wallride.runtime.security.access_list import KeysError
    from wallride.runtime.settings.tree import SettingsError

    with needs("keys", "keys need"):
        from wallride.clients.keys import command
    try:
        lines = command.run(options, options.car or _car_name(options.config))
    except (KeysError, SettingsError) as error:
        return fail(str(error))
    say("\n".join(map(one_line, lines)))
    return 0


def _car_name(config: Path | None) -> str:
    from wallride.runtime.settings.tree import load_settings

    return load_settings(config or default_config()).car.name


def _days(text: str) -> int:
    days = int(text)
    if not 1 <= days <= 3600:
        raise argparse.ArgumentTypeError("write a number of days from 1 to 3600")
    return days
