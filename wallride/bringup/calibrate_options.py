"""Options of `wallride calibrate`."""

import argparse
from pathlib import Path

from wallride import client_options
from wallride.failure import fail
from wallride.parser import DEFAULT_CONFIG

STEPS = ("speed", "steering", "lidar", "own-parts", "delay", "brake", "outline")


def add(commands: "argparse._SubParsersAction[argparse.ArgumentParser]") -> None:
    """Add the command and its options."""
    parser = commands.add_parser(
        "calibrate",
        help="measure speed and steering gain, the lidar's pose, delays and braking by driving to and fro",
        description="Drives the car through short ways while you hold a key, shows each setting before and after, and"
        " writes to its settings file what you accept. Run it on the car's computer, beside the running car.",
    )
    parser.add_argument("steps", nargs="*", type=_step, metavar="STEP", help=f"of {', '.join(STEPS)} (default: all)")
    parser.add_argument(
        "--config",
        type=Path,
        default=DEFAULT_CONFIG,
        metavar="FILE",
        help=f"the car's file (default: {DEFAULT_CONFIG})",
    )
    parser.add_argument(
        "--wheelbase", type=client_options.between(0.05, 2.0), metavar="M",
        help="wheelbase by ruler; then the servo's gain is measured, and without it the effective wheelbase",
    )  # fmt: skip
    parser.add_argument("--undo", action="store_true", help="put the values before the last calibration back")
    parser.add_argument(
        "--yes", action="store_true", help="hold the deadman and accept everything: simulated cars only"
    )
    client_options.add_common(parser)
    parser.set_defaults(run=run)


def _step(text: str) -> str:
    if text not in STEPS:
        raise argparse.ArgumentTypeError(f"{text} is not a step: {', '.join(STEPS)}")
    return text


def run(options: argparse.Namespace) -> int:
    """Calibrate; exit code 2 with one line for what the user can correct."""
    from wallride.clients.calibration.command import run as calibrate
    from wallride.clients.connection import ConnectionProblemError

    try:
        return calibrate(options)
    except ConnectionProblemError as error:
        return fail(str(error))
