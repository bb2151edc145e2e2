"""Options of `wallride map`, `wallride pose` and `wallride line`. The code is imported when the command runs."""

import argparse
import math
from functools import partial
from pathlib import Path

from wallride import replay_options
from wallride.failure import fail, needs
from wallride.parser import (
    Commands,
    add_config,
    add_json,
    add_set,
    default_config,
    number,
    writable_files,
    writable_map,
    writable_poses,
)


def add(commands: Commands) -> None:
    """Add the commands."""
    _add_map(commands)
    _add_pose(commands)
    line = commands.add_parser(
        "line",
        help="compute the race line of a map, with its lap time",
        description="Computes the line of least curvature round a map, its speeds and its lap time, and writes it as"
        " a file for programs of the field (s, x, y, yaw, curvature, speed) and a picture. The defaults leave a reserve"
        " of grip and distance for what drives the line.",
    )
    line.add_argument("map", metavar="MAP", help="a ROS map's .yaml file, a built-in world, or track:seed=N")
    line.add_argument(
        "-o", dest="output", type=writable_files, metavar="LINE.csv",
        help="file to write; the picture goes beside it (default: MAP.line.csv beside the map;"
        " here where its folder takes no file, and for a built-in world)",
    )  # fmt: skip
    line.add_argument("--side", choices=("left", "right"), help="which wall leads round the map (default: left)")
    line.add_argument(
        "--path", type=Path, metavar="FILE",
        help="the way round instead: a text file with x and y, as driven or drawn, such as a centre line (default: the"
        " path of the lap beside a map of `wallride map`)",
    )  # fmt: skip
    line.add_argument("--reverse", action="store_true", help="the other way round")
    _add_limits(line)
    add_config(line, "settings file with the car's size and steering", positional=False)
    add_set(line)
    add_json(line, "the figures")
    line.set_defaults(run=run)


def _add_map(commands: Commands) -> None:
    map_ = commands.add_parser(
        "map",
        help="make a map of a recorded lap, with a verdict on it",
        description="Makes a map of a recorded lap, in the format of ROS's map_server, with the path of the lap beside"
        " it and a picture. Drive a lap along the wall and on past the start, round one more corner. Exit code 0: the"
        " map is good. 1: it is refused, with the reason; the files are there to look at.",
    )
    replay_options.add_recording(map_)
    map_.add_argument(
        "-o", dest="output", type=writable_map, metavar="MAP.yaml",
        help="map to write; image, path, walls and picture go beside it (default: the recording's name, here)",
    )  # fmt: skip
    map_.add_argument(
        "--open", action="store_true", help="the drive does not return to its beginning, and need not for a good map"
    )
    add_json(map_, "the figures")
    map_.set_defaults(run=partial(replay_options.run_offline, "wallride.sim.mapping.command", extra="map"))


def _add_pose(commands: Commands) -> None:
    pose = commands.add_parser(
        "pose",
        help="find where a recorded drive was on a map, scan by scan",
        description="Finds the pose of a recorded drive on a map as the car itself does: where the map's lap began, or"
        " else anywhere. Writes the poses and a picture, and says how well the scans fit. Exit code 1: the drive was"
        " not found on the map, or fits it badly; places that look alike are said, not guessed.",
    )
    replay_options.add_recording(pose)
    pose.add_argument("map", type=Path, metavar="MAP.yaml", help="a map of `wallride map`, or any other ROS map")
    pose.add_argument(
        "-o", dest="output", type=writable_poses, metavar="POSES.csv",
        help="file to write; the picture goes beside it (default: the recording's name with .pose.csv, here)",
    )  # fmt: skip
    pose.add_argument(
        "--anywhere", action="store_true", help="search the whole map, not first where the map's lap began"
    )
    pose.add_argument(
        "--tum", action="store_true", help="write the trajectory as TUM's text, too, for evo, beside the poses: *.tum"
    )
    add_json(pose, "the figures")
    pose.set_defaults(run=partial(replay_options.run_offline, "wallride.sim.mapping.pose_command", extra="map"))


def _add_limits(line: argparse.ArgumentParser) -> None:
    line.add_argument(
        "--mu", type=number(0.01, 5.0), default=0.8, metavar="MU", help="friction of the floor (default: 0.8)"
    )
    line.add_argument(
        "--speed", dest="speed_mps", type=number(0.3, 50.0), default=6.0, metavar="MPS",
        help="highest speed (default: 6)",
    )  # fmt: skip
    add_reserve(line)
    line.add_argument(
        "--avoid", type=_circle, action="append", default=[], metavar="X,Y,RADIUS",
        help="a round place to keep away from, in metres on the map; --avoid=-1,2,0.3 where X is negative (repeatable)",
    )  # fmt: skip


def add_reserve(command: argparse.ArgumentParser) -> None:
    """Add the distance and the shares of the grip that a line leaves to what drives it."""
    command.add_argument(
        "--keep", dest="keep_m", type=number(0.01, 100.0), default=0.36, metavar="M",
        help="distance from walls to the middle of the car (default: 0.36)",
    )  # fmt: skip
    command.add_argument(
        "--lateral", dest="lateral_share", type=_share, default=0.75, metavar="SHARE",
        help="share of the grip that bends may use (default: 0.75)",
    )  # fmt: skip
    command.add_argument(
        "--brake", dest="brake_share", type=_share, default=0.6, metavar="SHARE",
        help="share of the grip that braking may use (default: 0.6; at most 4.6 m/s2, as the VESC's ramp)",
    )  # fmt: skip


def run(options: argparse.Namespace) -> int:
    """Compute and write; exit code 2 with one line for an error that the user can correct."""
    with needs("map", "lines need"):
        from wallride.runtime.settings.tree import SettingsError
        from wallride.sim.racing import command
    options.config = options.config or default_config()
    try:
        return command.run(options)
    except (SettingsError, ValueError, OSError) as error:
        if isinstance(error, OSError) and error.errno is not None:
            raise
        return fail(str(error))  # of a map that is not there, in words


def _share(text: str) -> float:
    share = float(text)
    if not 0.0 < share <= 1.0:
        raise argparse.ArgumentTypeError("write a share from 0 to 1")
    return share


def _circle(text: str) -> tuple[float, float, float]:
    try:
        numbers = tuple(float(part) for part in text.split(","))
    except ValueError:
        numbers = ()
    if len(numbers) != 3 or not all(map(math.isfinite, numbers)) or numbers[2] < 0.0:
        raise argparse.ArgumentTypeError("write three numbers, X,Y,RADIUS")
    return numbers
