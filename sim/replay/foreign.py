"""Another program's recording, judged by our laws: their decisions for every scan, as if the car had made them.

The recorded motion is fixed; only the decisions are ours. The result is a log with the car's own topics, so that all
readers of our recordings (report, player, monitor) read these too.
"""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from importlib.metadata import version
from pathlib import Path
from typing import Never

import numpy as np

from wallride.drivers.api import Health, LinkState, MotorState, Scan
from wallride.runtime.arbitration.command import Output, Source, consent
from wallride.runtime.control.guidance import Guidance
from wallride.runtime.control.perception.odometry import Odometry
from wallride.runtime.realtime.wall_clock import WallClock
from wallride.runtime.ros.definitions import TYPES
from wallride.runtime.settings.tree import Settings, load_settings, to_toml
from wallride.runtime.telemetry.status import Journey, ObservedState
from wallride.runtime.telemetry.topic_writers import Newest, TopicWriters
from wallride.runtime.wire import topics
from wallride.sim.recordings import OdometryTrack, Recording, RecordingError, load_recording
from wallride.sim.recordings.scans import better_side, is_foreign, motion_of, motor_at, scans_of
from wallride.sim.replay.drive_log import DriveLog, LoggedMessage, is_mcap, read_log
from wallride.sim.replay.stack import ReplayStack

TICK_S = 0.02
STATUS_EVERY_S = 0.1
MAX_HOLE_S = 120.0
ROUNDED_MPS = 0.05
BY_SCAN = (
    topics.SCAN,
    topics.WALL,
    topics.FOOTPRINT,
    topics.NAVIGATION,
    topics.SAFETY,
    topics.ODOM,
    topics.TF,
    topics.MOTOR,
)
ONLY_THE_WAY = "driven by another program; the words are ours"


@dataclass(frozen=True, slots=True)
class RecordedLidar:
    """Lidar of a file."""

    health: Health

    async def run(self, on_scan: Callable[[Scan], None]) -> Never:
        """Refuse: its scans are handed over by the file's reader."""
        raise NotImplementedError(self.health.message)


def settings_for(recording: Recording, assignments: Sequence[str]) -> tuple[Settings, list[str]]:
    """Return settings that suit a recording, and a description of the choice.

    Side and speed are the recorded car's unless they are assigned. SettingsError when an assignment is unusable.
    """
    wanted = list(assignments)
    notes = []
    given = {assignment.partition("=")[0].strip() for assignment in assignments}
    if "wall_follow.side" not in given:
        side = better_side(recording)
        wanted.append(f"wall_follow.side={side}")
        notes.append(f"the {side} wall is followed, which is the one that is seen better")
    tracks = [track for track in (recording.navigation, recording.output) if track is not None and len(track)]
    fastest_mps = max((float(np.max(track.speed_mps)) for track in tracks), default=0.0)
    if "wall_follow.speed_mps" not in given and fastest_mps > ROUNDED_MPS:
        speed_mps = round(min(fastest_mps, load_settings(None, wanted).car.max_speed_mps), 3)
        wanted.append(f"wall_follow.speed_mps={speed_mps}")
        notes.append(f"{speed_mps:g} m/s is asked for, as by the recorded program")
    return load_settings(None, wanted, laws=True), notes


def drive_recording(recording: Recording, settings: Settings, notes: Sequence[str] = ()) -> DriveLog:
    """Return the messages of the car for a recorded drive; RecordingError when its scans are of many lidars."""
    if is_foreign(recording):
        raise RecordingError(
            f"{recording.name} holds scans of several lidars on one topic (their stamps run backwards):"
            " it cannot be driven by."
        )
    return _Foreign(recording, settings, [*recording.notes, *notes]).run()


class _Foreign:
    def __init__(self, recording: Recording, settings: Settings, notes: Sequence[str]) -> None:
        self._recording = recording
        self._scans = scans_of(recording)
        self._states = motor_states(recording, settings)
        self._stage = ReplayStack(settings, self._scans[0].received_s)
        self._stage.queue.put(consent(Source.PERMIT, "a recording needs no permit"))
        self._journey = Journey(self._stage.now_s)
        self._newest = Newest(scan_period_s=recording.scan_time_s)
        self._odometry = Odometry(settings.car.wheelbase_m)
        self._writers = TopicWriters(
            self._observed(settings.car.name), settings.car, self._newest, self._journey,
            wall_clock=WallClock(lambda: 0.0, lambda: 0), side=lambda: settings.wall_follow.side, ball_m=lambda: None,
        )  # fmt: skip
        self._log = DriveLog(recording.name, notes=list(notes))
        self._log.metadata["wallride"] = {
            "car": settings.car.name, "version": version("wallride"), "settings": to_toml(settings),
            "source": f"{recording.name}: {ONLY_THE_WAY}",
        }  # fmt: skip
        self._mind: tuple[object, ...] = ()
        self._status_s = -math.inf

    def run(self) -> DriveLog:
        for scan, state in zip(self._scans, self._states, strict=True):
            self._tick_until(scan.received_s)
            self._answer(scan, state)
        return self._log

    def _tick_until(self, now_s: float) -> None:
        """Decide in the gap between two scans as the mux does, so that a gap in a recording is a stop."""
        stage = self._stage
        if now_s - stage.now_s > MAX_HOLE_S:
            stage.now_s = now_s - MAX_HOLE_S
        while stage.now_s + TICK_S < now_s:
            stage.now_s += TICK_S
            self._decided(stage.step())
        stage.now_s = max(stage.now_s, now_s)  # foreign stamps may run backwards

    def _answer(self, scan: Scan, state: MotorState) -> None:
        stage, newest = self._stage, self._newest
        stage.wire.state = newest.motor = state
        newest.scan = scan
        stage.look(scan, state)
        guidance: Guidance = stage.follow(scan, state)
        newest.guided = (scan, guidance)
        self._journey.scans += 1
        self._journey.score.add(guidance.error_m, state.speed_mps)
        self._journey.pose = self._odometry.update(state)
        output = stage.step()
        self._decided(output)
        self._keep(topics.DISTANCE_ERROR, self._writers.distance_error(scan, guidance))
        for topic in BY_SCAN:
            self._write(topic)
        self._keep(topics.OUTPUT, self._writers.output(output))
        if stage.now_s - self._status_s >= STATUS_EVERY_S:
            self._status_s = stage.now_s
            self._write(topics.STATUS)

    def _decided(self, output: Output) -> None:
        self._newest.output = output
        decision = output.decision
        mind = (decision.winner, decision.driver, decision.reason)
        if mind != self._mind:
            self._mind = mind
            self._write(topics.DECISION)

    def _write(self, topic: str) -> None:
        self._keep(topic, self._writers.write(topic))

    def _keep(self, topic: str, written: tuple[float, bytes] | None) -> None:
        if written is not None:
            stamp_s, payload = written
            self._log.messages.append(
                LoggedMessage(topic, TYPES.get(topic, ""), self._writers.unix_ns(stamp_s), payload)
            )

    def _observed(self, car: str) -> ObservedState:
        recording, stage = self._recording, self._stage
        what = f"{recording.topic}, {recording.beams} beams"
        return ObservedState(
            car=car,
            version=version("wallride"),
            lidar=RecordedLidar(Health(LinkState.READY, what, "recording")),
            motor=stage.wire,
            queue=stage.queue,
            clock=stage.clock,
            seconds_by_winner=stage.mux.seconds_by_winner,
            window=lambda: stage.laws.words,
            view=lambda: stage.laws.perception.newest_view,
        )


def motor_states(recording: Recording, settings: Settings) -> list[MotorState]:
    """Return the motor state that a controller would have reported at each scan: from odometry, else from the scans."""
    if recording.odometry is not None and len(recording.odometry) > 1:
        return _by_odometry(recording, recording.odometry, settings)
    motion = motion_of(recording)
    states = []
    for number in range(len(recording)):
        speed_mps, turning_radps = float(motion.speed_mps[number]), float(motion.yaw_rate_radps[number])
        wheels_rad = _wheels_rad(speed_mps, turning_radps, settings)
        states.append(motor_at(motion, number, wheels_rad, float(recording.received_s[number])))
    return states


def _by_odometry(recording: Recording, track: OdometryTrack, settings: Settings) -> list[MotorState]:
    order = np.argsort(track.received_s, kind="stable")
    times_s = track.received_s[order]
    speeds_mps = track.vx_mps[order]
    way_m = np.concatenate(([0.0], np.cumsum(speeds_mps[1:] * np.clip(np.diff(times_s), 0.0, 0.2))))
    newest = np.clip(np.searchsorted(times_s, recording.received_s, side="right") - 1, 0, None)
    states = []
    for number, at in enumerate(newest):
        speed_mps = float(speeds_mps[at])
        wheels_rad = _wheels_rad(speed_mps, float(track.wz_radps[order][at]), settings)
        states.append(MotorState(float(recording.received_s[number]), speed_mps, float(way_m[at]), wheels_rad))
    return states


def _wheels_rad(speed_mps: float, turning_radps: float, settings: Settings) -> float:
    """Return the angle of the wheels for a car's turn; 0 where it is too slow to determine it."""
    car = settings.car
    if abs(speed_mps) < 0.3:
        return 0.0
    wheels_rad = math.atan(turning_radps * car.wheelbase_m / speed_mps)
    return min(max(wheels_rad, -car.max_steering_rad), car.max_steering_rad)


@dataclass(frozen=True, slots=True)
class OpenedRecording:
    """An opened recording. ours: whether wallride drove the recorded car."""

    log: DriveLog
    ours: bool


def open_any(path: Path, assignments: Sequence[str] = (), topic: str | None = None) -> OpenedRecording:
    """Return the content of a file; assignments and topic are for recordings of others.

    RecordingError when nothing can be read, SettingsError when an assignment is unusable.
    """
    if path.is_file() and is_mcap(path):
        log = read_log(path)
        if log.is_ours:
            return OpenedRecording(log, ours=True)
    recording = load_recording(path, topic)
    settings, notes = settings_for(recording, assignments)
    return OpenedRecording(drive_recording(recording, settings, notes), ours=False)
