"""Options of `wallride calibrate`."""

import argparse
from pathlib import Path

from wallride import client_options
from wallride.clients.calibration import STEPS
from wallride.failure import fail
from wallride.parser import DEFAULT_CONFIG, Commands, add_config, default_config, number

SUFFIX = ".toml"


def add(commands: Commands) -> None:
    """Add the command and its options."""
    parser = commands.add_parser(
        "calibrate",
        help="measure speed and steering gain, the lidar's pose, delays and braking by driving to and fro",
        description="Drives the car through short ways while you hold a key, shows each setting before and after, and"
        " writes to its settings file what you accept. Run it on the car's computer, beside the running car; by servo"
        " pulses in its place.",
    )
    parser.add_argument(
        "steps", nargs="*", type=_step, action=_StepsAndFile, metavar="STEP",
        help=f"of {', '.join(STEPS)} (default: all)",
    )  # fmt: skip
    add_config(parser, "settings file of the car, also among the steps", positional=False)
    parser.add_argument(
        "--wheelbase", type=number(0.05, 2.0), metavar="M",
        help="wheelbase by ruler; then the servo's gain is measured, and without it the effective wheelbase",
    )  # fmt: skip
    parser.add_argument("--undo", action="store_true", help="put the values before the last calibration back")
    parser.add_argument(
        "--yes", action="store_true", help="hold the deadman and accept everything: simulated cars only"
    )
    client_options.add_common(parser)
    parser.set_defaults(run=run)


class _StepsAndFile(argparse.Action):
    """Keep the steps, and the settings file where it is named among them."""

    def __call__(
        self, parser: argparse.ArgumentParser, namespace: argparse.Namespace, values: object, _option: str | None = None
    ) -> None:
        words = list(map(str, values)) if isinstance(values, list) else []
        files = [text for text in words if text.endswith(SUFFIX)]
        if len({*files, *([str(namespace.config)] if namespace.config else [])}) > 1:
            parser.error(f"two settings files: {', '.join(files)}; name one")
        if files:
            namespace.config = Path(files[0])
        namespace.steps = [text for text in words if text not in files]


def _step(text: str) -> str:
    if text not in STEPS and not text.endswith(SUFFIX):
        raise argparse.ArgumentTypeError(f"{text} is not a step: {', '.join(STEPS)}; nor a settings file, {SUFFIX}")
    return text


def run(options: argparse.Namespace) -> int:
    """Calibrate; exit code 2 with one line for what the user can correct."""
    from wallride.clients.calibration.command import run as calibrate
    from wallride.clients.connection import ConnectionProblemError
    from wallride.pulses import command as pulses

    options.config = options.config or default_config() or DEFAULT_CONFIG
    try:
        if not options.undo and (settings := pulses.pulsed_settings(options.config)) is not None:
            return pulses.run(options, settings)
        return calibrate(options)
    except ConnectionProblemError as error:
        return fail(str(error))
