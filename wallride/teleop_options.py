"""What `wallride teleop` understands. Only definitions: the client itself is imported when it is asked for."""

import argparse
import getpass
import socket
from pathlib import Path

from wallride.client_options import add_common, run_client
from wallride.failure import fail, needs

MAX_SPEED_MPS = 20.0
FIRST_SPEED_MPS = 0.75
"""As slow as the page's slider begins."""


def add(commands: "argparse._SubParsersAction[argparse.ArgumentParser]") -> None:
    """Add the command and its options."""
    parser = commands.add_parser(
        "teleop",
        help="drive a car by hand, or permit its autonomy, with a gamepad or a keyboard",
        description="With a gamepad, or without one with this terminal's keyboard. Left bumper held: drive by hand."
        " Right bumper held: permit autonomy. Both, B, Space or Esc: e-stop. Released: the car stops at once.",
    )
    add_common(parser)
    _add_devices(parser)
    _add_feel(parser)
    parser.add_argument(
        "--name", default=None, help="whom the car and other operators see (default: you@this-computer)"
    )
    parser.add_argument("--plain", action="store_true", help="one line per change of state instead of a screen")
    parser.set_defaults(run=run)


def run(options: argparse.Namespace) -> int:
    """Run the client; 2 when something is missing that the user can mend."""
    options.name = options.name or default_name()
    with needs("teleop", "teleop needs"):
        from clients.teleop.app import TeleopProblemError, operate
    try:
        return run_client(operate, options)
    except TeleopProblemError as problem:
        return fail(str(problem))


def default_name() -> str:
    """Return who this is, as far as the computer knows."""
    try:
        user = getpass.getuser()
    except (KeyError, OSError):
        user = "operator"
    return f"{user}@{socket.gethostname().split('.')[0]}"


def _add_devices(parser: argparse.ArgumentParser) -> None:
    device = parser.add_mutually_exclusive_group()
    device.add_argument("--keyboard", action="store_true", help="this terminal's keyboard, even with a gamepad")
    device.add_argument("--window", action="store_true", help="the keyboard, in a window that sees released keys")
    device.add_argument("--script", type=Path, metavar="FILE", help="a CSV or TOML file instead of hands")
    device.add_argument("--map", action="store_true", help="teach an unknown gamepad: asks, and writes its file")
    parser.add_argument(
        "--pad", metavar="NAME", help="which gamepad, by part of its name or USB id (default: the first)"
    )


def _add_feel(parser: argparse.ArgumentParser) -> None:
    parser.add_argument(
        "--max-speed",
        type=_between(0.1, MAX_SPEED_MPS),
        default=FIRST_SPEED_MPS,
        metavar="MPS",
        help=f"at full stick (default: {FIRST_SPEED_MPS:g})",
    )
    parser.add_argument(
        "--max-steering", type=_between(0.05, 1.5), default=0.34, metavar="RAD", help="at full stick (default: 0.34)"
    )
    parser.add_argument(
        "--ramp", type=_between(0.1, 100), default=2.0, metavar="MPS2",
        help="how fast the speed may grow; slowing down is immediate (default: 2)",
    )  # fmt: skip
    parser.add_argument(
        "--expo", type=_between(0, 1), default=0.3, metavar="X", help="0 linear, 1 cubic sticks (default: 0.3)"
    )
    parser.add_argument(
        "--deadzone", type=_between(0, 0.5), default=0.08, metavar="X", help="middle of a stick (default: 0.08)"
    )


def _between(low: float, high: float):  # type: ignore[no-untyped-def]  # noqa: ANN202 - a converter for argparse
    def number(text: str) -> float:
        value = float(text)
        if not low <= value <= high:
            raise argparse.ArgumentTypeError(f"{text} is not between {low:g} and {high:g}")
        return value

    return number
