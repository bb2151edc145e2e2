"""What mapping needs of a recorded drive: scans, reports of the wheels, rates of the gyro, on one clock."""

from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Final

import numpy as np
import numpy.typing as npt

from wallride.drivers.api import MotorState, Scan
from wallride.runtime.calibration.scan_motion import Kind
from wallride.runtime.control.vehicle import CarSettings
from wallride.runtime.realtime.wall_clock import NS
from wallride.runtime.recording.decision_log import Event, FollowerEvent, SafetyEvent, ScanEvent
from wallride.runtime.wire import topics
from wallride.sim.fit.drive import scan_times_s
from wallride.sim.recordings import Recording, RecordingError, load_recording
from wallride.sim.replay.drive_log import DriveLog, decode, is_mcap, read_log
from wallride.sim.replay.reenact import events_of
from wallride.sim.replay.settings_text import settings_of
from wallride.sim.world.pose import Floats

TRUE_PERCENT: Final = 0.05
"""Error of the wheels' way that would be printed as 0.0 %."""


@dataclass(frozen=True, slots=True, eq=False)
class LapRecord:
    """A drive.

    kind: of the lidar. ray_s: time from one beam to the next, as of a scan. scan_s: (n,), end of each sweep. ranges_m:
    (n, beams), NaN without a distance. reports: (m, 4), time [s], way [m], speed [m/s] and steering [rad] as the motor
    controller reported them; without rows where it was not recorded. gyro: (g, 2), time [s] and yaw rate [rad/s],
    likewise. lidar_m: place of the lidar ahead of the rear axle and left of it, x + iy. world: the simulated one.
    unix_s: the time since 1970 at 0 of its clock, where that is known.
    """

    name: str
    kind: Kind
    ray_s: float
    scan_s: Floats
    ranges_m: npt.NDArray[np.float32]
    reports: Floats = field(default_factory=lambda: np.zeros((0, 4)))
    gyro: Floats = field(default_factory=lambda: np.zeros((0, 2)))
    lidar_m: complex = 0j
    wheelbase_m: float = 0.33
    world: str = ""
    unix_s: float = 0.0


def read_record(path: Path, topic: str | None = None) -> LapRecord:
    """Return the drive of a file: a recording of wallride, or the scans of another program's.

    topic: of the lidar, where there are several. Raises: RecordingError.
    """
    log = own_log(path)
    return record_of_log(log) if log is not None else record_of_recording(load_recording(path, topic))


def own_log(path: Path) -> DriveLog | None:
    """Return the content of a recording of wallride, None for another file."""
    if path.is_file() and is_mcap(path):
        log = read_log(path)
        return log if log.is_ours else None
    return None


def record_of_recording(recording: Recording) -> LapRecord:
    """Return the drive of another program's recording: its scans alone, since nothing tells what its wheels mean."""
    ranges_m = np.array(recording.ranges_m)
    ranges_m[~((ranges_m >= recording.range_min_m) & (ranges_m <= recording.range_max_m))] = np.nan
    kind = (recording.angle_min_rad, recording.angle_step_rad, recording.beams)
    last_s = scan_times_s(recording) + recording.sweep_s / 2
    order = np.flatnonzero(np.diff(np.maximum.accumulate(last_s), prepend=-np.inf) > 0.0)
    return LapRecord(recording.name, kind, recording.ray_s, last_s[order], ranges_m[order])


def record_of_log(log: DriveLog) -> LapRecord:
    """Return the drive of a recording of wallride, from its decision log, which has each report of the wheels."""
    decoded = {message.sequence: message for message in log.of(topics.SCAN)}
    events = events_of(log)
    taken = [event for event in events if isinstance(event, ScanEvent) and event.sequence in decoded]
    if len(taken) < 2:
        raise RecordingError(f"{log.name} holds {len(taken)} scans: a map needs a drive.")
    kind = (taken[0].angle_min_rad, taken[0].angle_step_rad, taken[0].beams)
    taken = [event for event in taken if event.beams == kind[2]]
    ranges_m = np.array([decode(decoded[event.sequence]).ranges for event in taken], dtype=np.float32)
    ahead_s = decoded[taken[0].sequence].stamp_ns / NS - taken[0].stamp_s
    rates = [(one.stamp_ns / NS - ahead_s, decode(one).angular_velocity.z) for one in log.of(topics.IMU)]
    settings = settings_of(log, laws=False)
    car = settings.car
    return LapRecord(
        log.name, kind, taken[0].ray_s, np.array([event.stamp_s for event in taken]), ranges_m,
        reports_of(_states(events)), np.array(rates).reshape(-1, 2), car.lidar_m, car.wheelbase_m,
        settings.recording.world, ahead_s,
    )  # fmt: skip


def record_of_scans(name: str, scans: Sequence[Scan], states: Sequence[MotorState], car: CarSettings) -> LapRecord:
    """Return the drive of scans and motor states as drivers deliver them, such as those of a simulated car."""
    first = scans[0]
    kind = (first.angle_min_rad, first.angle_step_rad, first.ranges_m.size)
    return LapRecord(
        name, kind, first.ray_s, np.array([scan.stamp_s for scan in scans]),
        np.array([scan.ranges_m for scan in scans]), reports_of(states),
        lidar_m=car.lidar_m, wheelbase_m=car.wheelbase_m,
    )  # fmt: skip


def reports_of(states: Sequence[MotorState]) -> Floats:
    """Return time, way, speed and steering of each report, (m, 4), those with the same time once."""
    rows = {state.stamp_s: (state.stamp_s, state.distance_m, state.speed_mps, state.steering_rad) for state in states}
    return np.array([rows[stamp_s] for stamp_s in sorted(rows)]).reshape(-1, 4)


def wheel_words(scale: float) -> str:
    """Return what the wheels report of the way, in words. scale: true way over reported way."""
    more_percent = 100.0 / scale - 100.0
    if abs(more_percent) < TRUE_PERCENT:
        return "the wheels report the way as it is"
    return f"the wheels report {abs(more_percent):.1f} % too {'much' if more_percent > 0.0 else 'little'} way"


def _states(events: Sequence[Event]) -> list[MotorState]:
    asked = [event.motor for event in events if isinstance(event, SafetyEvent | FollowerEvent)]
    return [state for state in asked if state is not None]
