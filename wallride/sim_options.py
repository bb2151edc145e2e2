"""Options of `wallride sim`. The simulator is imported when the command runs."""

import argparse
from pathlib import Path

from wallride.parser import Commands, add_config, add_json, add_set, at_least, writable_path

MAX_CARS = 32
PICTURES = (".png", ".pdf", ".svg")
LIDARS = (
    "hokuyo", "rplidar", "ydlidar", "a1", "a2", "a3", "c1", "s1", "s2", "s3", "x2", "x4", "x4-pro", "g4", "g6", "tg",
)  # fmt: skip


def add(commands: Commands) -> None:
    """Add the command and its options."""
    sim = commands.add_parser("sim", help="drive an emulated car through its real drivers")
    sim.set_defaults(run=run)
    sim.add_argument(
        "world",
        nargs="?",
        help="a built-in world, track:seed=N, a ROS map .yaml or a scenario .toml (default: loop; with --race the world"
        " in which the map's lap was driven)",
    )
    add_set(sim)
    add_config(sim, "settings file of the simulated car", "config/sim.toml's", positional=False)
    sim.add_argument("--headless", action="store_true", help="no live view, only the summary")
    sim.add_argument("--duration", type=float, metavar="S", help="seconds to drive (default: 60; a recording's length)")
    sim.add_argument(
        "--cars", type=cars, default=1, metavar="N",
        help="number of cars in the world, car1 to carN, each with a runtime of its own (default: 1)",
    )  # fmt: skip
    sim.add_argument(
        "--race", type=lambda text: Path(text).expanduser(), metavar="MAP.yaml",
        help="drive the race line of a map of `wallride map`, in the world that its lap was driven in, from where that"
        " began",
    )  # fmt: skip
    sim.add_argument("--laps", type=int, metavar="N", help="stop after N laps")
    sim.add_argument(
        "--put-back", action="store_true",
        help="put a car that touched something back to its start within 3 s and drive on, instead of ending the drive",
    )  # fmt: skip
    sim.add_argument("--pose", metavar="X,Y,THETA", help="start pose of the rear axle in the world [m, m, rad]")
    sim.add_argument("--seed", type=at_least(0), default=0, metavar="N", help="seed of all noise (default: 0)")
    sim.add_argument(
        "--lidar", choices=LIDARS,
        help="emulated lidar: a UST-10LX, an RPLIDAR (A1) or YDLIDAR (X4), or a model of these"
        " (default: that of lidar.driver)",
    )  # fmt: skip
    _add_files(sim)
    add_conditions(
        sim.add_argument_group("conditions", "floor, lidar faults and obstacles; keys change them while it drives")
    )


def _add_files(sim: argparse.ArgumentParser) -> None:
    sim.add_argument("--recording", type=Path, metavar="FILE", help="play a real recording through the emulated lidar")
    add_json(sim, "the summary")
    sim.add_argument(
        "--tum", type=writable_path, metavar="FILE.tum",
        help="write the true trajectory as TUM's text, for evo: in the world, with --race on the map",
    )  # fmt: skip
    sim.add_argument("--plot", type=picture, metavar="FILE.png", help="draw the path and the error over time")


def add_conditions(group: "argparse._ArgumentGroup") -> None:
    """Add the options for floor, lidar and obstacles."""
    group.add_argument("--friction", type=float, metavar="MU", help="grip of the floor (default: 0.8)")
    group.add_argument("--noise", type=float, metavar="M", help="standard deviation of each distance (default: 0.01)")
    group.add_argument(
        "--dropouts", type=float, metavar="SHARE", help="share of beams without a return, 0 to 1 (default: 0)"
    )
    group.add_argument(
        "--dirt", action="append", default=[], metavar="FROM,TO[,RANGE]",
        help="a dirty sector of the window [deg, deg, m], --dirt=-10,5,0.4 (repeatable); RANGE is 0.05 by default:"
        " inside the car's outline, so ahead a stop",
    )  # fmt: skip
    group.add_argument("--trim", type=float, metavar="RAD", help="wheel angle at the servo's middle position")
    group.add_argument("--delay", type=float, metavar="S", help="delay of servo and motor (default: 0.02)")
    group.add_argument(
        "--own-parts",
        metavar="KIND",
        help="parts of the car that its lidar sees: posts, mounts, cables, trail, film,"
        " wide, beside (as on recorded cars) or none",
    )
    group.add_argument(
        "--obstacle", action="append", default=[], metavar="TEXT",
        help='"box at=3,1" (in the world), "box ahead=1.5 after=4", "person at=3,-1 walks=0,0.8" (repeatable)',
    )  # fmt: skip
    add_car(group)


def add_car(group: "argparse._ActionsContainer") -> None:
    """Add the options for the simulated car itself: a file, as `wallride lab fit` writes it, and single values."""
    group.add_argument(
        "--condition", action="append", default=[], metavar="KEY=VALUE",
        help="another condition: vehicle.mass_kg=4, lidar.outlier_share=0.01 (repeatable)",
    )  # fmt: skip
    group.add_argument(
        "--conditions", type=Path, metavar="FILE.toml",
        help="conditions from a file, for example of `wallride lab fit`: [vehicle], [lidar]",
    )  # fmt: skip


def cars(text: str) -> int:
    """Return a number of cars for an option."""
    if not text.isdecimal() or not 1 <= int(text) <= MAX_CARS:
        raise argparse.ArgumentTypeError(f"{text} is not a number of cars: 1 to {MAX_CARS}")
    return int(text)


def picture(text: str) -> Path:
    """Return the path of a picture to write, for an option."""
    path = writable_path(text)
    if path.suffix.lower() not in PICTURES:
        raise argparse.ArgumentTypeError(f"{text}: name a picture that ends in {', '.join(PICTURES)}")
    return path


def run(options: argparse.Namespace) -> int:
    """Simulate; Ctrl-C ends the drive as the end of the duration does."""
    from wallride.failure import needs
    from wallride.sim.live.stop_request import StopRequest

    stop = StopRequest()
    with stop.listening():
        with needs("sim", "the simulator needs"), stop.loading():
            from wallride.sim.live.command import simulate
        return simulate(options, stop)
