"""The `wallride` command line. Heavy imports are made by the command that needs them, so that --help is fast."""

import argparse
import os
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from wallride import (
    bench_options,
    completion_options,
    foxglove_options,
    keys_options,
    lab_options,
    line_options,
    logs_options,
    monitor_options,
    param_options,
    replay_options,
    report_options,
    sim_options,
    teleop_options,
    topic_options,
)
from wallride.bringup import calibrate_options, doctor_options, emulate_options, import_options
from wallride.deploy import options as deploy_options
from wallride.failure import TRACEBACK_VARIABLE, fail, fail_at_place, forget_output, report
from wallride.fleet import options as fleet_options
from wallride.new import options as new_options
from wallride.parser import Commands, GroupedParser, Parser, add_config, add_set, default_config
from wallride.runtime.host.terminal_text import USAGE_ERROR, one_line, say
from wallride.service import options as service_options
from wallride.vesc import options as vesc_options

LATER = 1
"""Exit code of what the service manager may try again: nothing is wrong with the settings."""

if TYPE_CHECKING:
    from wallride.clients.joystick.car_joystick import CarJoystick
    from wallride.runtime.settings.tree import Settings


def main(arguments: Sequence[str] | None = None) -> int:
    """Run one command and return its exit code: 0 done, 2 an error that the user can correct (the message says how).

    An exception that nothing expected is a sentence, with the details in a file; that of `wallride run`, which brakes
    first, is shown whole, because the journal is where it is looked for.
    """
    # Arrays here are tiny: more BLAS threads would only add contention. Must be set before numpy is imported.
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
    os.environ.setdefault("OMP_NUM_THREADS", "1")
    options = build_parser().parse_args(arguments)
    try:
        code = int(options.run(options))
        sys.stdout.flush()  # a full disk is told here, and not behind the last line of Python
    except KeyboardInterrupt:
        return 130
    except BrokenPipeError:  # `wallride topic echo scan | head` has seen enough
        forget_output()
        return 0
    except Exception as error:
        if options.command == "run" or TRACEBACK_VARIABLE in os.environ:
            raise
        told = fail_at_place(error) if isinstance(error, OSError) else None
        return report(error, options.command) if told is None else told
    return code


def command() -> int:
    """Run the command of this process; the threads and exit handlers of an own law do not put its end off."""
    code = 1
    try:
        code = main()
    finally:
        laws = sys.modules.get("wallride.runtime.control.own_laws.law_class")
        drivers = sys.modules.get("wallride.runtime.own_drivers.driver_class")
        if (laws is not None and laws.loaded_files()) or (drivers is not None and drivers.loaded_driver_files()):
            from wallride.runtime.host.ending import end_in_time

            end_in_time(code)
            for stream in (sys.stdout, sys.stderr):
                stream.flush()  # what ends the process does not
    return code


def build_parser() -> argparse.ArgumentParser:
    """Return the parser; every name in it is a contract that scripts rely on."""
    parser = GroupedParser(prog="wallride", description="Drives a 1/10-scale autonomous racecar.")
    parser.add_argument("--version", action="version", version=f"wallride {_version()}")
    commands: Commands = parser.add_subparsers(dest="command", required=True, metavar="COMMAND", parser_class=Parser)
    _add_run_and_check(commands)
    sim_options.add(commands)
    emulate_options.add(commands)
    doctor_options.add(commands)
    vesc_options.add(commands)
    import_options.add(commands)
    calibrate_options.add(commands)
    lab_options.add(commands.add_parser("lab", help="experiments with the car's own laws, faster than real time"))
    new_options.add(commands)
    for options in (
        bench_options,
        teleop_options,
        monitor_options,
        topic_options,
        fleet_options,
        param_options,
        keys_options,
        logs_options,
        replay_options,
        report_options,
        line_options,
        foxglove_options,
        service_options,
        deploy_options,
    ):
        options.add(commands)
    _add_build_kernel(commands)
    completion_options.add(commands, build_parser)
    return parser


def _add_run_and_check(commands: Commands) -> None:
    run = commands.add_parser("run", help="drive the car until SIGINT or SIGTERM")
    check = commands.add_parser("check", help="validate the settings and print the effective ones")
    run.set_defaults(run=_run)
    check.set_defaults(run=_check)
    for command in (run, check):
        add_config(command)
        add_set(command)
    run.add_argument(
        "--address-file", type=Path, metavar="FILE", help="write the endpoints of telemetry and the session as JSON"
    )
    run.add_argument(
        "--saved", type=Path, metavar="FILE",
        help="file with further settings, to which `param save` writes (default: the TOML file)",
    )  # fmt: skip
    check.add_argument(
        "--devices",
        action="store_true",
        help="open the devices; fail when one does not answer: a part of `wallride doctor`",
    )


def _add_build_kernel(commands: Commands) -> None:
    build = commands.add_parser(
        "build-kernel",
        help="compile the hot functions on this machine",
        description="Compiles the hot functions with this machine's C compiler, or zig's of the extra `compiler`, into "
        "the installed package. Without them the same functions run in Python, more slowly.",
    )
    build.add_argument("--native", action="store_true", help="for this machine's processor only (-march=native)")
    build.add_argument(
        "--seal", action="store_true",
        help="after an edit: declare that the C does what the Python does now; then run tests/runtime/kernel",
    )  # fmt: skip
    build.set_defaults(run=_build_kernel)


def _run(options: argparse.Namespace) -> int:
    from wallride.drivers.api import DriverError
    from wallride.runtime.security.access_list import KeysError
    from wallride.runtime.settings.tree import SettingsError

    try:
        file = options.config or default_config()
        settings, about_lidar = _with_its_lidar(_load(file, options.assignments, options.saved), file, options)
        problems = _problems(settings, (file, options.saved, options.address_file))
        session, warnings = _session(settings)
        routers, about_routers = _routers(settings)
        warnings += (*about_lidar, *about_routers, *_warnings(settings, options.saved or file))
    except (SettingsError, KeysError) as error:
        return fail(str(error))
    except DriverError as error:
        fail(f'lidar.driver = "auto": {error}')
        return LATER
    if problems:
        return fail("; ".join(problems))
    from wallride.runtime import launch
    from wallride.runtime.restarting import ProcessRestart, start_again

    restart = ProcessRestart(file, options.saved, options.assignments)
    try:
        files = launch.Files(
            options.saved or file, file if options.saved else None, options.address_file, options.assignments, restart
        )
        joystick, problems_of_pads = _joystick(settings)
        launch.main(settings, files, launch.Sessions(session, routers), (*warnings, *problems_of_pads), joystick)
    except launch.LaunchError as error:
        return fail(str(error))
    return start_again() if restart.wanted else 0


def _with_its_lidar(
    settings: "Settings", file: Path | None, options: argparse.Namespace
) -> "tuple[Settings, tuple[str, ...]]":
    """Return the settings with the lidar that `auto` found and wrote down, and what is to be said of it."""
    from wallride.drivers.auto.settings import AutoLidarSettings

    if not isinstance(settings.lidar, AutoLidarSettings):
        return settings, ()
    import asyncio
    from datetime import UTC, datetime

    from wallride.runtime.found_lidar import look_for, write_down

    found = asyncio.run(look_for(settings.lidar, settings.motor))
    words = write_down(found, file, options.saved, options.assignments, datetime.now(UTC).date())
    return settings.model_copy(update={"lidar": found.settings}), (words,)


def _joystick(settings: "Settings") -> "tuple[CarJoystick | None, tuple[str, ...]]":
    """Return the reader of a gamepad on the car, where it is wanted, and warnings about files of layouts."""
    if settings.joystick.enabled == "off":
        return None, ()
    import secrets

    from wallride.clients.joystick.car_joystick import CarJoystick
    from wallride.clients.joystick.devices import LinuxPads
    from wallride.clients.teleop.pad_files import read_all
    from wallride.clients.teleop.shaping import InputShape

    wanted = settings.joystick
    layouts, problems = read_all(Path(wanted.layouts_folder))
    shape = InputShape(max_speed_mps=wanted.max_speed_mps, max_steering_rad=wanted.max_steering_rad)
    return CarJoystick(LinuxPads(), secrets.randbits(63) + 1, shape, layouts), tuple(problems)


def _check(options: argparse.Namespace) -> int:
    from wallride.doctor.program import laws_open_to_others
    from wallride.runtime.security.access_list import KeysError
    from wallride.runtime.settings.tree import SettingsError, to_toml

    file = options.config or default_config()
    try:
        settings = _load(file, options.assignments)
        print(to_toml(settings), end="")
        _, warnings = _session(settings)
        warnings += (*_routers(settings)[1], *_warnings(settings, file))
        warnings += tuple("; ".join(said) for said in laws_open_to_others())
    except (SettingsError, KeysError) as error:
        return fail(str(error))
    problems = _problems(settings, [file]) + _mistakes_of_course(settings)
    if options.devices and not problems:
        problems = _device_problems(settings)
    for text in (*warnings, *problems):
        say(f"wallride: {one_line(text)}", file=sys.stderr)
    return USAGE_ERROR if problems else 0


def _build_kernel(options: argparse.Namespace) -> int:
    from wallride.runtime.kernel.build import BuildError
    from wallride.runtime.kernel.command import run

    try:
        for line in run(native=options.native, seal=options.seal):
            say(line)
    except BuildError as error:
        return fail(str(error))
    return 0


def _load(config: Path | None, assignments: Sequence[str], saved: Path | None = None) -> "Settings":
    from wallride.runtime.settings.tree import load_settings

    return load_settings(config, assignments, saved, laws=True, drivers=True)


def _session(settings: "Settings") -> tuple[dict[str, Any], tuple[str, ...]]:
    """Return the configuration of the car's session and warnings about its keys; KeysError for unusable keys."""
    from datetime import UTC, datetime

    from wallride.runtime.ros.graph import access
    from wallride.runtime.security.key_files import car_session

    telemetry, ros = settings.telemetry, settings.ros2_graph()
    keys = access(ros, drives=settings.ros2.drive, scans=settings.lidar.driver == "topic") if ros is not None else None
    return car_session(telemetry.listen, telemetry.keys_dir, settings.car.name, datetime.now(UTC), keys)


def _routers(settings: "Settings") -> tuple[list[dict[str, Any]], tuple[str, ...]]:
    """Return the configurations of the sessions with routers and warnings about their keys; KeysError as above."""
    from datetime import UTC, datetime

    from wallride.runtime.security.key_files import uplink_sessions
    from wallride.runtime.wire.zenoh_config import Role

    telemetry, planners = settings.telemetry, settings.planner_names()
    highest = Role(telemetry.connect_role)
    return uplink_sessions(
        telemetry.connect, telemetry.connect_keys_dir, settings.car.name, datetime.now(UTC), planners, highest
    )


def _problems(settings: "Settings", files: Sequence[Path | None]) -> list[str]:
    """Return what keeps the car from starting: its places, and the user's own laws and drivers. files: of settings."""
    from wallride.doctor.places import colliding_places
    from wallride.doctor.ports import unusable_paths
    from wallride.runtime.control.laws import own_law_mistakes
    from wallride.runtime.lidars import own_driver_mistakes

    laws = own_law_mistakes(settings.wall_follow, settings.safety, settings.car)
    drivers = own_driver_mistakes(settings.lidar, settings.motor)
    return unusable_paths(settings) + colliding_places(settings, files) + laws + drivers


def _warnings(settings: "Settings", file: Path | None) -> tuple[str, ...]:
    """Return what is to be said of settings with which the car drives. file: where limits were saved."""
    from wallride.doctor.slow_speeds import too_slow_to_turn
    from wallride.runtime.line_files import why_no_line

    words = why_no_line(settings.wall_follow, settings.map)
    without_a_line = [f"{words}: the car follows the wall"] if words else []
    return (*_saved_limits(file), *too_slow_to_turn(settings), *without_a_line)


def _mistakes_of_course(settings: "Settings") -> list[str]:
    """Return why the car would not start with its map and line."""
    from wallride.runtime.line_files import read_course
    from wallride.runtime.map_files import MapError

    try:
        read_course(settings.map, settings.car)
    except MapError as error:
        return [str(error)]
    return []


def _saved_limits(file: Path | None) -> tuple[str, ...]:
    """Return a warning for each limit that was saved while the car ran, from afar or on its page."""
    from wallride.runtime.parameters.catalogue import shown
    from wallride.runtime.parameters.file import MARK, marked

    limits = marked(file) if file is not None else {}
    return tuple(
        f"{file}: {name} = {shown(value)} was saved while the car ran: look at it, and delete the comment '{MARK}'"
        for name, value in limits.items()
    )


def _device_problems(settings: "Settings") -> list[str]:
    """Open both devices; return what must be mended before the car drives: a part of `wallride doctor`."""
    import asyncio
    import logging

    from wallride.doctor.computer import this_computer
    from wallride.doctor.examine import examine
    from wallride.doctor.findings import Level

    logging.getLogger().addHandler(logging.NullHandler())  # what the drivers log is in the findings

    async def look() -> list[str]:
        groups = ("ports", "lidar", "motor")
        return [
            f"{finding.subject}: {finding.words}; {finding.remedy}"
            async for finding in examine(this_computer(), settings, groups)
            if finding.level is Level.FAIL
        ]

    return asyncio.run(look())


def _version() -> str:
    from importlib.metadata import version

    return version("wallride")
