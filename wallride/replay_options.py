"""Options of `wallride replay`. The code is imported when the command runs."""

import argparse
import sys
import time
import tomllib
from contextlib import suppress
from pathlib import Path

from wallride.clients import DEFAULT_CONNECT
from wallride.failure import fail, needs
from wallride.parser import Commands, add_json, add_set, number
from wallride.runtime.host.terminal_text import say

KEYS = "space pauses, + and - change the speed, arrows go 5 s, page keys 30 s, home begins anew, q ends"
AGES = (("days", 86_400), ("h", 3600), ("min", 60), ("s", 1))
"""Units of a recording's age, with their seconds."""


def add(commands: Commands) -> None:
    """Add the command."""
    replay = commands.add_parser(
        "replay",
        help="decide a recording again and show the first difference, or publish it",
        description=(
            "Decides a recording of wallride again and compares every decision. Exit code 0: all the same. 1: a"
            " difference. 3: a difference, and laws, map or line have changed since, or the file begins after the start"
            " of the process. Of another program's drive (a rosbag or an archive) it reports what our laws would have"
            " done. --scan or --at tells instead why the car drove as it did at one scan: the follower's answer, the"
            " decision and its reason, what was sent. --publish plays a recording onto zenoh: " + KEYS + "."
        ),
    )
    add_file(replay)
    add_json(replay, "the result")
    moment = replay.add_mutually_exclusive_group()
    moment.add_argument("--scan", type=int, metavar="N", help="tell only why the car drove as it did at scan N")
    moment.add_argument(
        "--at", dest="at_s", type=float, metavar="S", help="the same, at the newest scan S seconds after the beginning"
    )
    replay.add_argument("--publish", action="store_true", help="publish on zenoh, for monitor, topic and plot")
    replay.add_argument(
        "--speed", type=number(0.05, 50), default=1.0, metavar="X", help="speed of playing (default: 1)"
    )
    replay.add_argument(
        "--from", dest="begin_s", type=float, default=0.0, metavar="S", help="start S seconds after the beginning"
    )
    replay.add_argument("--loop", action="store_true", help="repeat")
    replay.add_argument("--car", metavar="NAME", help="name of the published car (default: the recorded one)")
    replay.add_argument(
        "--listen", metavar="ENDPOINT", default=DEFAULT_CONNECT,
        help=f"endpoint for monitors (default: {DEFAULT_CONNECT})",
    )  # fmt: skip
    replay.set_defaults(run=run)


def add_file(parser: argparse.ArgumentParser) -> None:
    """Add the options of replay and report: recording, settings and topic."""
    add_recording(parser)
    add_set(parser, "override a recorded setting, for example wall_follow.kp=10")


def add_recording(parser: argparse.ArgumentParser) -> None:
    """Add the recording, and which of its lidars is meant."""
    parser.add_argument(
        "file", type=Path, nargs="?", metavar="FILE",
        help="our .mcap, or a .bag, .db3, .mcap, .npz with LaserScans (default: the newest recording of this computer)",
    )  # fmt: skip
    parser.add_argument(
        "--topic", metavar="NAME", help="topic of the lidar, where another program's recording has several"
    )


def run(options: argparse.Namespace) -> int:
    """Replay; exit code 2 with one line for an error that the user can correct."""
    return run_offline("wallride.sim.replay.command", options)


def run_offline(module: str, options: argparse.Namespace, *, extra: str = "sim") -> int:
    """Run a module that reads recordings; an error that the user can correct becomes one line and exit code 2.

    extra: of the installation, with the packages that the module needs.
    """
    from importlib import import_module

    with needs(extra, "recordings need"):
        command = import_module(module)
        from wallride.runtime.settings.tree import SettingsError
        from wallride.sim.recordings import RecordingError
    if options.file is None:
        options.file = newest()
        if options.file is None:
            return fail("there is no recording on this computer yet: name a FILE, or drive: wallride sim")
        say(f"the newest recording: {options.file} ({_about(options.file)})", file=sys.stderr)
    for name in ("file", "beside"):
        if getattr(options, name, None) is not None:
            setattr(options, name, found(getattr(options, name)))
            _tell_unfinished(getattr(options, name))
    try:
        return int(command.run(options))
    except (RecordingError, SettingsError) as error:
        return fail(str(error))


def found(path: Path) -> Path:
    """Return a recording's path: as it is written, or, where nothing is there, as `wallride logs` lists it."""
    from wallride.runtime.recording.ring import file_named
    from wallride.runtime.settings.recording import recordings_folder

    return path if path.exists() else file_named(path, recordings_folder("")) or path


def _tell_unfinished(path: Path) -> None:
    """Say of a recording that a car is still writing it."""
    from wallride.runtime.recording.recover import file_state

    if path.is_file() and file_state(path) == "recording":
        say(f"{path} is still being recorded: this is of what it holds so far", file=sys.stderr)


def _about(path: Path) -> str:
    """Return a recording's world, length and age, in words, as far as they are known."""
    from wallride.runtime.recording.channels import SETTINGS
    from wallride.runtime.recording.file_summary import duration_s
    from wallride.sim.recordings import RecordingError
    from wallride.sim.replay.drive_log import read_log

    age_s, length_s, world = time.time() - path.stat().st_mtime, duration_s(path), ""
    with suppress(RecordingError, ValueError, AttributeError):
        world = str(tomllib.loads(read_log(path, SETTINGS).settings_text).get("recording", {}).get("world", ""))
    unit, unit_s = next(one for one in AGES if age_s >= one[1] or one[1] == 1)
    length = f"{length_s:.1f} s long" if length_s is not None else ""
    return ", ".join(filter(None, [world, length, f"{max(0.0, age_s) / unit_s:.0f} {unit} old"]))


def newest() -> Path | None:
    """Return the newest recording of this computer, None without one."""
    from wallride.runtime.recording.ring import newest_recording
    from wallride.runtime.settings.recording import recordings_folder

    return newest_recording(recordings_folder(""))
