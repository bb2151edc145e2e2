"""Options of `wallride emulate`. The simulator is imported when the command runs."""

import argparse
from pathlib import Path

from wallride.client_options import port
from wallride.parser import CONFIG_VARIABLE, Commands, add_set, at_least
from wallride.sim_options import add_conditions

LIDAR_PORT = 10940
"""TCP port of a Hokuyo as it is sold."""


def add(commands: Commands) -> None:
    """Add the command and its options."""
    parser = commands.add_parser(
        "emulate",
        help="only the devices of an emulated car, to try every step without a car",
        description="Keeps an emulated lidar and motor controller running, under names that stay, in a world in which"
        " the car drives. Writes a settings file for `wallride doctor`, `run` and all other commands.",
    )
    parser.set_defaults(run=run, laps=None, race=None, config_variable=CONFIG_VARIABLE)
    parser.add_argument("world", nargs="?", default="corridor", help="a built-in world or a ROS map .yaml")
    add_set(parser, "describe the emulated car by one setting, for example motor.neutral_us=1530")
    parser.add_argument(
        "--folder", type=Path, metavar="DIR", help="of serial ports and settings (default: ~/.local/state/...)"
    )
    parser.add_argument(
        "--lidar", choices=("tcp", "serial", "both"), default="tcp", help="how the lidar is connected (default: tcp)"
    )
    parser.add_argument("--port", type=port, default=LIDAR_PORT, metavar="N", help="of the lidar, 0: a free one")
    parser.add_argument(
        "--vesc-timeout", type=float, default=0.15, metavar="S",
        help="command timeout of the motor controller (default: 0.15; a new VESC has 1.0)",
    )  # fmt: skip
    parser.add_argument(
        "--vesc-brake", type=float, default=10.0, metavar="A",
        help="brake current after the timeout (default: 10; a new VESC has 0)",
    )  # fmt: skip
    parser.add_argument("--duration", type=float, metavar="S", help="end after this time (default: Ctrl-C)")
    parser.add_argument("--pose", metavar="X,Y,THETA", help="start pose of the rear axle [m, m, rad]")
    parser.add_argument("--seed", type=at_least(0), default=0, metavar="N", help="seed of all noise (default: 0)")
    add_conditions(parser.add_argument_group("conditions", "floor, lidar faults and obstacles"))


def run(options: argparse.Namespace) -> int:
    """Emulate until Ctrl-C."""
    from wallride.failure import needs
    from wallride.sim.live.stop_request import StopRequest

    stop = StopRequest()
    with stop.listening():
        with needs("sim", "the emulated car needs"):
            from wallride.sim.live.emulate_command import emulate
        return emulate(options, stop)
