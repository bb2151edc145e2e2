"""`wallride sim`: builds a drive from the command line's options, with its live view and its summary."""

import argparse
import asyncio
import json
import math
from collections.abc import Callable
from contextlib import suppress
from functools import partial
from pathlib import Path
from typing import Any

from rich.console import Console

from wallride.runtime.host.output_files import write_answer, write_file
from wallride.runtime.host.terminal_text import USAGE_ERROR, complain
from wallride.runtime.host.user_module import UserCodeError
from wallride.runtime.line_files import why_no_line
from wallride.runtime.recording.disk import Disk
from wallride.runtime.recording.ring import MB, entries
from wallride.runtime.settings.recording import car_folder
from wallride.runtime.settings.tree import Settings, SettingsError, load_settings
from wallride.sim.car.vehicle import Vehicle, VehicleSettings
from wallride.sim.devices import lidar_kinds
from wallride.sim.figures.comparison import compare
from wallride.sim.figures.tum import tum_text
from wallride.sim.live.asked_scene import SimUsageError, asked_world, build_scene, wishes
from wallride.sim.live.drive_summary import (
    HEARD,
    along_the_line,
    failed_to_record,
    laps_missing,
    plot_drive,
    recorded_words,
    summarize,
    summary_table,
)
from wallride.sim.live.fleet import build_fleet, fleet_summary, run_fleet, write_fleet
from wallride.sim.live.live_conditions import LiveConditions
from wallride.sim.live.live_keys import pressing
from wallride.sim.live.record import Record
from wallride.sim.live.scenario_scene import ScenarioScene, read_scenario
from wallride.sim.live.scenes import RecordingScene, WorldScene
from wallride.sim.live.screen import LiveView, address_in, operate_hint, port_notice, starting
from wallride.sim.live.session import RuntimeStart, SessionError, SimulatorSession, innermost
from wallride.sim.live.stop_request import StopRequest
from wallride.sim.live.user_code import UserCode
from wallride.sim.racing.race import Race, race_figures, sees_its_lap, take_race, world_words
from wallride.sim.recordings import RecordingError, load_recording
from wallride.sim.scenario.command import tell
from wallride.sim.scenario.conditions import Conditions, ConditionsError, conditions_of
from wallride.sim.scenario.driven import judge, mistakes_after
from wallride.sim.scenario.scenario_file import Scenario
from wallride.sim.scenario.simulated_car import find_config, saved_settings
from wallride.sim.scenario.toml_lines import FileMistakeError
from wallride.sim.world.place import World
from wallride.sim.world.pose import Pose
from wallride.sim.world.worlds import is_map

DEFAULT_DURATION_S = 60.0
MAX_LAP_S = 180.0
"""Maximum duration of a lap, so that a standing car does not block a script."""
FAILED = 1
KILLED = 130
BUSY = "busy"


def simulate(options: argparse.Namespace, stop: StopRequest) -> int:
    """Run one simulated drive.

    Returns 0 when it was completed, by time, by laps or by Ctrl-C; 1 when the runtime failed, was not recorded although
    that was wanted, drove without telemetry, so that its own report is missing, drove fewer laps than asked for, or a
    law or driver of the user's failed; 2 for a wrong option or a taken port; 130 when it was killed.
    """
    console, answer = Console(stderr=True), Console(stderr=options.json == "-")
    try:
        with stop.loading():
            config = options.config or find_config()
            saved = saved_settings(config)
            options.race = race = take_race(options, config, saved)
            scenario = read_scenario(options, config)
            settings = _load(options, config, saved)
        _say_first(console, saved, race, settings)
        _check_length(options)
        if options.cars > 1:
            return _fleet(options, config, settings, stop, (console, answer), is_scenario=scenario is not None)
        scene = _scenario_scene(options, scenario) if scenario is not None else None
        drive = _replay if options.recording is not None else partial(_drive, chosen=scene)
        summary = drive(options, config, settings, stop, console)
    except (SettingsError, UserCodeError, RecordingError, ConditionsError, FileMistakeError, SimUsageError) as error:
        return complain(error)
    except SessionError as error:
        return complain(error, KILLED if stop.killed else USAGE_ERROR if error.exit_code == USAGE_ERROR else FAILED)
    if options.json != "-":
        _show(summary, answer, race, put_back=options.put_back)
    write_answer(json.dumps(summary, indent=2) + "\n", options.json)
    if summary["failed"]:
        return complain(summary["failed"], FAILED)
    if failed_to_record(summary["recording"]):
        return FAILED
    if summary["telemetry"] != HEARD:
        return complain(f"{summary['telemetry']}; winners and faults are not known", FAILED)
    missing = "" if options.recording is not None or stop.asked else laps_missing(summary, options.laps)
    if faults := [*UserCode.of(settings).faults(summary["faults"]), *filter(None, [missing])]:
        return complain("; ".join(faults), FAILED)
    return _judged(scenario, scene, answer) if scenario is not None and scene is not None else 0


def _say_first(console: Console, saved: Path, race: Race | None, settings: Settings) -> None:
    """Say what a driver may not expect of the drive."""
    if saved.exists():
        console.print(f"[dim]with what was saved in {saved} (delete it to forget)[/dim]", soft_wrap=True)
    if race is not None and race.notice:
        console.print(f"wallride: {race.notice}", soft_wrap=True)
    kept = settings.recording
    folder = car_folder(kept.model_copy(update={"simulated": True}), settings.car.name)
    with suppress(OSError):  # such a folder is told in the summary
        room_bytes = Disk().free_bytes(folder) + sum(entry.size_bytes for entry in entries(folder))
        if kept.enabled and room_bytes < kept.keep_free_mb * MB:
            console.print(f"wallride: nothing will be recorded: less than {kept.keep_free_mb} MB of the disk are free")


def _load(options: argparse.Namespace, config: Path, saved: Path) -> Settings:
    """Return the settings of the drive, with the driver of the lidar that is emulated; the options then name it."""
    if options.lidar is not None:
        options.assignments = [*lidar_kinds.assignments(options.lidar), *options.assignments]
    settings = load_settings(config, options.assignments, saved, laws=True, drivers=True)
    if words := why_no_line(settings.wall_follow, settings.map):
        raise SimUsageError(f"{words}; a race on a map: --race MAP.yaml (docs/racing.md)")
    options.lidar = options.lidar or lidar_kinds.word_of(settings.lidar)
    if settings.lidar.driver == "auto":
        raise SimUsageError('lidar.driver = "auto" looks for a real lidar: name an emulated one, as in --lidar rplidar')
    return settings


def _show(summary: dict[str, Any], console: Console, race: Race | None, *, put_back: bool) -> None:
    """Print the table, and where the drive was recorded."""
    console.print(summary_table(summary))
    if race is not None and race.notice:
        console.print(f"wallride: {race.notice}", soft_wrap=True)
    if summary.get("collided") and not put_back:
        console.print(
            "The car touched something: that ends a simulated drive (with --put-back it drives on from the start)."
        )
    words, command = recorded_words(summary["recording"])
    console.print(words, soft_wrap=True)
    if command:
        console.print(f"a page of it: {command}", soft_wrap=True)


def _scenario_scene(options: argparse.Namespace, scenario: Scenario) -> ScenarioScene:
    """Return the scene of a scenario; the options must not say what its file says."""
    if options.pose or options.recording is not None or conditions_of(wishes(options)) != Conditions():
        raise SimUsageError(f"{options.world} says where and in what conditions the car drives; change it there")
    return ScenarioScene(scenario, options.laps)


def _instead_of_laps(options: argparse.Namespace) -> str:
    if not is_map(options.world):
        return "give --duration instead"
    ways = "wallride map -o lab.yaml, wallride line lab.yaml, wallride sim --race lab.yaml"
    return f"give --duration instead: a lap is known only after one was driven and mapped: {ways} --laps {options.laps}"


def _judged(scenario: Scenario, scene: ScenarioScene, console: Console) -> int:
    """Tell what the expectations came to; 1 when one of them does not hold, 2 for a mistake that the drive showed."""
    judged, mistakes = judge(scenario, scene.driven), mistakes_after(scenario, scene.driven)
    tell(scenario.text.path, judged, console)
    for words in mistakes:
        complain(words)
    return USAGE_ERROR if mistakes else 0 if all(one.holds is not False for one in judged) else FAILED


def _drive(
    options: argparse.Namespace, config: Path, settings: Settings, stop: StopRequest, console: Console, *,
    chosen: ScenarioScene | None = None,
) -> dict[str, Any]:  # fmt: skip
    race: Race | None = options.race
    with stop.loading():
        conditions, scene, vehicle = build_scene(options, settings, chosen)
    scene.back_to = vehicle.pose if options.put_back else None
    scene.turning = lidar_kinds.device_for(options.lidar)
    if chosen is not None and scene.turning is not None:
        raise SimUsageError(f"--lidar {options.lidar}: a scenario drives with the Hokuyo, whose faults it sets")
    world = scene.world
    if options.laps and world.lap is None:
        raise SimUsageError(f"--laps {options.laps}: {world.name} has no lap; {_instead_of_laps(options)}")
    duration_s = options.duration or (options.laps * MAX_LAP_S if options.laps else DEFAULT_DURATION_S)
    if race is not None and not sees_its_lap(world, vehicle.pose):
        console.print("wallride: the car begins outside of the course: it sees no part of the line", soft_wrap=True)
    live, began = LiveConditions(vehicle, scene, conditions), vehicle.pose
    origin = race.origin_in(world) if race is not None and chosen is None else began
    attach: dict[str, Any] = {"on_devices": chosen.attach} if chosen is not None else {}
    session = SimulatorSession(
        scene, vehicle, conditions.wiring.wired(settings.motor), desired_m=settings.wall_follow.desired_distance_m,
        watched=not options.headless, changes=live, user_code=UserCode.of(settings), **attach,
    ).fit(settings.motor)  # fmt: skip
    named = options.world if is_map(options.world) else world.name
    driven_in = world_words(named, world.side, began if chosen is None and began != world.start else None)
    start = _start(options, config, settings, driven_in)
    record = _run(session, start, duration_s, stop, console, _view(options, scene, vehicle, console, live), live)
    summary = {
        "world": world.name,
        **summarize(record, settings),
        "collided": scene.collided,
        "contacts": scene.contacts,
        "laps": len(scene.lap_times_s),
        "lap_times_s": scene.lap_times_s,
        **(_race_figures(race, record, origin, scene.lap_times_s) if race is not None else {}),
        "conditions": conditions.changed(),
        "changed_while_driving": live.done + len({change.stamp_s for change in record.changes}),
    }
    _write_drive(options, settings, record, world, origin if race is not None else Pose(0.0, 0.0, 0.0))
    return summary


def _race_figures(race: Race, record: Record, origin: Pose, laps_s: list[float]) -> dict[str, Any]:
    return along_the_line(record.reasons_s) | race_figures(*record.as_driven(), race.line, origin, laps_s)


def _write_drive(options: argparse.Namespace, settings: Settings, record: Record, world: World, origin: Pose) -> None:
    """Write what was asked for of a drive. origin: of its trajectory."""
    if options.tum is not None:
        write_file(options.tum, tum_text(record.trajectory(origin)))
    if options.plot is not None:
        plot_drive(options.plot, world, record, settings)


def _fleet(
    options: argparse.Namespace, config: Path, settings: Settings, stop: StopRequest,
    consoles: tuple[Console, Console], *, is_scenario: bool,
) -> int:  # fmt: skip
    """Drive several cars. consoles: for progress, and for the answer."""
    if options.pose or options.laps or options.plot or options.tum or options.recording is not None or is_scenario:
        raise SimUsageError(
            "--cars: goes with a world and --duration; not with a scenario, --pose, --laps, --plot or --tum"
        )
    conditions = conditions_of(wishes(options))
    try:
        with stop.loading():
            world = asked_world(options, settings)
        cars = build_fleet(world, options.cars, conditions, settings, options.seed, put_back=options.put_back)
    except (ValueError, OSError) as error:
        raise SimUsageError(str(error)) from None
    failure: SessionError | None = None
    for car in cars:
        car.scene.turning = lidar_kinds.device_for(options.lidar)
    try:
        asyncio.run(run_fleet(cars, options, config, settings, stop, consoles[0]))
    except* SessionError as group:
        failure = innermost(group)
    failed = str(failure or "")
    if failure is not None and not all(car.record.end_early(failed) for car in cars):
        raise failure
    if stop.killed:
        raise SessionError("killed; there is no summary")
    return write_fleet(fleet_summary(cars, world.name, failed), options.json, UserCode.of(settings), consoles[1])


def _replay(
    options: argparse.Namespace, config: Path, settings: Settings, stop: StopRequest, console: Console
) -> dict[str, Any]:
    if options.lidar != lidar_kinds.HOKUYO:
        raise SimUsageError(f"--lidar {options.lidar}: a recording is played through the Hokuyo")
    with stop.loading():
        recording = load_recording(options.recording)
    for note in recording.notes:
        console.print(f"[dim]{note}[/dim]")
    if conditions_of(wishes(options)) != Conditions():
        raise SimUsageError(
            "--recording: its scans are what they are; friction, dirt, obstacles and the like need a world"
        )
    # The emulated wheels turn as our laws command, the recorded scans show the way of another car.
    options.assignments = ["safety.odometry_check=false", *options.assignments]
    scene = RecordingScene(recording)
    vehicle = Vehicle(VehicleSettings(), Pose(0.0, 0.0, 0.0))
    wanted_m = settings.wall_follow.desired_distance_m
    wiring = Conditions().wiring.wired(settings.motor)
    session = SimulatorSession(
        scene, vehicle, wiring, desired_m=wanted_m, watched=not options.headless, user_code=UserCode.of(settings)
    )
    session.record.steering_rad = answers_rad = list[float]()
    duration_s = options.duration or math.inf
    start = _start(options, config, settings, f"recording {recording.name}")
    record = _run(session, start, duration_s, stop, console, _view(options, None, vehicle, console))
    pairs = scene.pairs(answers_rad)
    if options.plot is not None:
        from wallride.sim.figures.drawing import save_comparison

        save_comparison(options.plot, pairs, f"{recording.name}: steering, {settings.wall_follow.side} wall")
    return {
        "world": f"recording {recording.name}",
        **summarize(record, settings),
        "collided": False,
        "laps": 0,
        "lap_times_s": [],
        "runtime_distance_error": record.telemetry.get("status", {}).get("distance_error"),
        "recorded_navigation": compare(pairs),
    }


def _start(options: argparse.Namespace, config: Path, settings: Settings, world: str) -> RuntimeStart:
    """Return the start of the runtime; without a named port a free one is taken."""
    is_named = "listen" in settings.telemetry.model_fields_set or "any_port" in settings.telemetry.model_fields_set
    is_placed = "simulated" in settings.recording.model_fields_set
    is_joystick_named = "enabled" in settings.joystick.model_fields_set
    chosen = [
        *([] if is_named else ["telemetry.any_port=true"]),
        *([] if is_placed else ["recording.simulated=true"]),
        *([] if is_joystick_named else ["joystick.enabled=off"]),  # `wallride teleop` beside it reads this computer's
    ]
    assignments = [*options.assignments, *chosen, f"recording.world={json.dumps(world)}"]
    return RuntimeStart(config, assignments, ["--saved", str(saved_settings(config))], settings.telemetry.listen)


def _run(
    session: SimulatorSession, start: RuntimeStart, duration_s: float, stop: StopRequest, console: Console,
    view: "LiveView | None", live: LiveConditions | None = None,
) -> Record:  # fmt: skip
    record = session.record
    failure: SessionError | None = None
    show: Callable[[Record], None] = view.show if view is not None else _teller(console)
    with pressing(live, stop, wanted=view is not None) as obey_keys:

        def frame(record: Record) -> None:
            obey_keys()
            show(record)

        try:
            if view is not None:
                view.start()
            asyncio.run(session.run(start, duration_s, stop, frame))
        except* SessionError as group:
            failure = innermost(group)  # raised below: until Python 3.11.4 it becomes a group here
        finally:
            if view is not None:
                view.stop()
    if failure is not None and not record.end_early(str(failure)):
        raise failure
    if stop.killed:
        raise SessionError("killed; there is no summary")
    if not record.failed and record.exit_code != 0:
        console.print("\n".join(record.log))
        record.failed = f"the runtime ended with exit code {record.exit_code}"
    return record


def _teller(console: Console) -> Callable[[Record], None]:
    """Return a function that prints once, without a live view, the car's address and the page's."""
    told = [""]

    def tell(record: Record) -> None:
        if (notice := port_notice(record.address, record.listen)) not in told:
            console.print(notice, soft_wrap=True)
            told.append(notice)
        if (busy := record.held_up.words) and BUSY not in told:
            console.print(busy, soft_wrap=True)
            told.append(BUSY)
        for line in (starting(record), operate_hint(record.address), f"in a browser: {address_in(record.page)}"):
            if line not in told and not line.endswith(": "):
                console.print(f"[dim]{line}[/dim]", soft_wrap=True)
                told.append(line)

    return tell


def _view(
    options: argparse.Namespace, scene: WorldScene | None, vehicle: Vehicle, console: Console,
    live: LiveConditions | None = None,
) -> "LiveView | None":  # fmt: skip
    if options.headless or not console.is_terminal:
        return None
    return LiveView(console, scene.outline_m if scene is not None else None, vehicle, live)


def _check_length(options: argparse.Namespace) -> None:
    if options.duration is not None and not 0 < options.duration < math.inf:
        raise SimUsageError(f"--duration {options.duration:g}: give a finite number of seconds above 0")
    if options.laps is not None and options.laps < 1:
        raise SimUsageError(f"--laps {options.laps}: give a whole number of laps, 1 or more")
