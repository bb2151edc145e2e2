"""Options of `wallride teleop`. The client is imported when the command runs."""

import argparse
from pathlib import Path

from wallride.client_options import add_common, add_name, run_client
from wallride.failure import fail, needs
from wallride.parser import Commands, number

MAX_SPEED_MPS = 20.0
FIRST_SPEED_MPS = 0.75
"""Default maximum speed; the page's slider starts at the same value."""


def add(commands: Commands) -> None:
    """Add the command and its options."""
    parser = commands.add_parser(
        "teleop",
        help="drive a car by hand or permit its autonomy, with gamepad or keyboard",
        description="Uses a gamepad, or this terminal's keyboard. Left bumper held: drive by hand."
        " Right bumper held: permit autonomy. Both, B, Space or Esc: e-stop. Released: the car stops at once.",
    )
    add_common(parser)
    _add_devices(parser)
    _add_feel(parser)
    add_name(parser)
    parser.add_argument("--plain", action="store_true", help="print a line per change of state instead of a screen")
    parser.set_defaults(run=run)


def run(options: argparse.Namespace) -> int:
    """Run the client; exit code 2 when a package is missing."""
    with needs("teleop", "teleop needs"):
        from wallride.clients.teleop.app import TeleopProblemError, operate
    try:
        return run_client(operate, options)
    except TeleopProblemError as problem:
        return fail(str(problem))


def _add_devices(parser: argparse.ArgumentParser) -> None:
    device = parser.add_mutually_exclusive_group()
    device.add_argument("--keyboard", action="store_true", help="use this terminal's keyboard, even with a gamepad")
    device.add_argument(
        "--window", action="store_true", help="use the keyboard in a window, which reports released keys"
    )
    device.add_argument(
        "--script", type=Path, metavar="FILE",
        help="buttons from a file, also to permit autonomy: CSV with time_s,buttons,speed,steering, or TOML"
        " (docs/driving.md)",
    )  # fmt: skip
    device.add_argument(
        "--map", action="store_true", help="map an unknown gamepad: asks for each control and writes its file"
    )
    parser.add_argument(
        "--pad", metavar="NAME", help="part of the gamepad's name or USB id (default: the first gamepad)"
    )


def _add_feel(parser: argparse.ArgumentParser) -> None:
    parser.add_argument(
        "--max-speed",
        type=number(0.1, MAX_SPEED_MPS),
        default=FIRST_SPEED_MPS,
        metavar="MPS",
        help=f"speed at full stick (default: {FIRST_SPEED_MPS:g})",
    )
    parser.add_argument(
        "--max-steering",
        type=number(0.05, 1.5),
        default=0.34,
        metavar="RAD",
        help="steering at full stick (default: 0.34)",
    )
    parser.add_argument(
        "--ramp", type=number(0.1, 100), default=2.0, metavar="MPS2",
        help="maximum acceleration; slowing down is immediate (default: 2)",
    )  # fmt: skip
    parser.add_argument(
        "--expo",
        type=number(0, 1),
        default=0.3,
        metavar="X",
        help="curve of the sticks, 0 linear to 1 cubic (default: 0.3)",
    )
    parser.add_argument(
        "--deadzone",
        type=number(0, 0.5),
        default=0.08,
        metavar="X",
        help="dead zone in the middle of a stick (default: 0.08)",
    )
