"""Options of `wallride vesc`. Its work is imported when the command runs."""

import argparse
import sys
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING

from wallride.failure import fail
from wallride.parser import Commands, add_config, add_set, default_config, number
from wallride.runtime.host.terminal_text import say, yes_or_no

if TYPE_CHECKING:
    from wallride.vesc.change import SettingsWish

MIN_TIMEOUT_MS, MAX_TIMEOUT_MS = 50, 1000
MAX_BRAKE_A = 100.0


def add(commands: Commands) -> None:
    """Add the command and its two actions."""
    vesc = commands.add_parser("vesc", help="set what protects the car inside the VESC, or put it back")
    actions = vesc.add_subparsers(dest="action", required=True, metavar="ACTION")
    change = actions.add_parser(
        "set",
        help="write command timeout, timeout brake current and servo output",
        description="Writes into the VESC's application configuration, where its firmware is known to the last byte"
        " (3.60 to 7.00): says what will change and asks, wants a standing car and no other program on the port, keeps"
        " a copy first, and reads back. Without a value: 150 ms, 10 A, servo output on. Exit code: 0 done, 2 nothing"
        " was changed, 3 look at what it says.",
    )
    change.add_argument(
        "--timeout-ms", type=number(MIN_TIMEOUT_MS, MAX_TIMEOUT_MS), metavar="MS",
        help="time without a command after which the VESC brakes by itself",
    )  # fmt: skip
    change.add_argument(
        "--brake-current-a", type=number(0.0, MAX_BRAKE_A), metavar="A", help="with which it brakes then"
    )
    change.add_argument("--servo-output", choices=("on", "off"), help="steering (firmware 5.03 and later)")
    back = actions.add_parser(
        "restore",
        help="write a kept copy back into the VESC that it is of",
        description="Writes a copy that `wallride vesc set` kept into the same VESC, with the same cautions.",
    )
    back.add_argument("file", type=Path, metavar="COPY", help="as `wallride vesc set` said")
    for action in (change, back):
        add_config(action, positional=action is change)
        add_set(action)
        action.add_argument("--yes", action="store_true", help="do not ask; without a terminal needed")
        action.add_argument("--dry-run", action="store_true", help="only say what it would write")
        action.set_defaults(run=run)


def run(options: argparse.Namespace) -> int:
    """Change it; exit code 2 with one line where nothing was changed."""
    import asyncio

    from wallride.doctor.computer import this_computer
    from wallride.drivers.address import parse_address
    from wallride.drivers.vesc.settings import VescSettings
    from wallride.runtime.settings.tree import SettingsError, load_settings
    from wallride.vesc import change
    from wallride.vesc.change import backup_folder
    from wallride.vesc.port import refuse_taken_port

    try:
        file = options.config or default_config()
        settings = load_settings(file, options.assignments)
        if not isinstance(settings.motor, VescSettings):
            return fail(f"motor.driver = {settings.motor.driver}: this is about a VESC")
        say(f"settings of {file or 'no file: the defaults'}; motor controller at {settings.motor.address}")
        refuse_taken_port(this_computer(), settings)
        access = change.VescAccess(parse_address(settings.motor.address), backup_folder(), say, _consent(options))
        if options.action == "restore":
            return asyncio.run(change.restore(access, options.file))
        return asyncio.run(change.set_values(access, _wish(options)))
    except (SettingsError, change.VescChangeError) as error:
        return fail(str(error))


def _wish(options: argparse.Namespace) -> "SettingsWish":
    from wallride.vesc.change import SettingsWish, recommended

    if options.timeout_ms is None and options.brake_current_a is None and options.servo_output is None:
        return recommended()
    return SettingsWish(
        None if options.timeout_ms is None else options.timeout_ms / 1000,
        options.brake_current_a,
        None if options.servo_output is None else options.servo_output == "on",
    )


def _consent(options: argparse.Namespace) -> Callable[[], bool]:
    from wallride.vesc.change import VescChangeError

    def agreed() -> bool:
        if options.dry_run:
            say("nothing done (--dry-run)")
            return False
        if options.yes:
            return True
        if not sys.stdin.isatty():
            raise VescChangeError("nothing was changed: without a terminal say --yes")
        if yes_or_no("the car stands, disarmed: write it?", default=False):
            return True
        raise VescChangeError("nothing was changed")

    return agreed
