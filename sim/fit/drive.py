"""What a fit needs of one or more recorded drives: motion, speed and commands on one time line."""

from collections.abc import Sequence
from dataclasses import dataclass, fields, replace
from typing import TypeVar

import numpy as np

from wallride.runtime.calibration.responses import CommandSteps
from wallride.runtime.calibration.scan_motion import follow_each_other
from wallride.sim.recordings import CommandTrack, OdometryTrack, Recording
from wallride.sim.recordings.scans import motion_of
from wallride.sim.world.pose import Floats

SETTLES_S = 1.0
"""Time after a change of the commanded speed in which the command says nothing about the speed."""
APART_S = 10.0
Track = TypeVar("Track", CommandTrack, OdometryTrack)


@dataclass(frozen=True, slots=True, eq=False)
class Intervals:
    """Motion from one scan to the next by the scans alone; all (n,).

    The car's own odometry is not used: a RACECAR computes its yaw rate from the steering command, which is the very
    thing to be measured. In a corridor nothing tells how far the car went along it: `forward_mps` is too low there.
    """

    from_s: Floats
    to_s: Floats
    forward_mps: Floats
    yaw_rate_radps: Floats

    def __len__(self) -> int:
        """Return the number of intervals."""
        return len(self.from_s)


@dataclass(frozen=True, slots=True, eq=False)
class RecordedDrive:
    """speed_mps: in each interval, (n,), NaN where unknown; origin: of these speeds.

    command: what went to the motor controller; None where it was not recorded.
    """

    motion: Intervals
    speed_mps: Floats
    origin: str
    command: CommandTrack | None
    odometry: OdometryTrack | None

    @property
    def moved_m(self) -> float:
        """Return the way driven while the speed is known."""
        return float(np.nansum(np.abs(self.speed_mps) * (self.motion.to_s - self.motion.from_s)))


def scan_times_s(recording: Recording) -> Floats:
    """Return the times of the scans' middle beams, (n,); where the stamps jump, the times of reception."""
    steady = bool(np.all(np.diff(recording.stamp_s) > 0)) and np.ptp(recording.received_s - recording.stamp_s) < 1.0
    return recording.stamp_s + recording.sweep_s / 2 if steady else recording.received_s


def intervals(recording: Recording) -> Intervals:
    """Return the motion between a recording's scans; intervals are left out at gaps."""
    at_s = scan_times_s(recording)
    motion = motion_of(replace(recording, stamp_s=at_s))
    elapsed_s = np.diff(at_s)
    good = follow_each_other(elapsed_s)
    with np.errstate(invalid="ignore", divide="ignore"):
        middle_rad = (motion.yaw_rad[1:] + motion.yaw_rad[:-1]) / 2
        forward_m = np.cos(middle_rad) * np.diff(motion.x_m) + np.sin(middle_rad) * np.diff(motion.y_m)
        forward_mps, yaw_rate_radps = forward_m / elapsed_s, np.diff(motion.yaw_rad) / elapsed_s
    return Intervals(at_s[:-1][good], at_s[1:][good], forward_mps[good], yaw_rate_radps[good])


def read_drive(recording: Recording) -> RecordedDrive:
    """Return a recording's drive."""
    motion, command = intervals(recording), recording.output or recording.navigation
    command = command if command is not None and len(command) else None
    odometry = recording.odometry if recording.odometry is not None and len(recording.odometry) > 2 else None
    drive = RecordedDrive(motion, np.full(len(motion), np.nan), "nothing", command, odometry)
    middle_s = (motion.from_s + motion.to_s) / 2
    if odometry is not None:
        return replace(drive, speed_mps=np.interp(middle_s, odometry.received_s, odometry.vx_mps), origin="odometry")
    if command is not None:
        return replace(drive, speed_mps=_settled_mps(command, middle_s), origin="commands")
    return replace(drive, speed_mps=motion.forward_mps, origin="scans")


def _settled_mps(command: CommandTrack, at_s: Floats) -> Floats:
    """Return the commanded speed where it has been in force for a while, else NaN."""
    steps = CommandSteps(command.received_s, command.speed_mps)
    ago = (steps.at(at_s - part * SETTLES_S) for part in (0.25, 0.5, 0.75, 1.0))
    now_mps = steps.at(at_s)
    return np.where(np.logical_and.reduce([np.abs(one - now_mps) < 0.1 for one in ago]), now_mps, np.nan)


def join(drives: Sequence[RecordedDrive]) -> RecordedDrive:
    """Return all drives of a car as one, one after the other; commands and odometry only where every drive has them."""
    later: list[RecordedDrive] = []
    start_s = 0.0
    for drive in drives:
        motion, by_s = drive.motion, start_s
        later.append(
            replace(
                drive,
                motion=replace(motion, from_s=motion.from_s + by_s, to_s=motion.to_s + by_s),
                command=drive.command and replace(drive.command, received_s=drive.command.received_s + by_s),
                odometry=drive.odometry and replace(drive.odometry, received_s=drive.odometry.received_s + by_s),
            )
        )
        start_s += (float(motion.to_s[-1]) if len(motion) else 0.0) + APART_S
    motions = [drive.motion for drive in later]
    return RecordedDrive(
        Intervals(*(np.concatenate([getattr(one, each.name) for one in motions]) for each in fields(Intervals))),
        np.concatenate([drive.speed_mps for drive in later]),
        ", ".join(dict.fromkeys(drive.origin for drive in later)),
        _joined([drive.command for drive in later], CommandTrack),
        _joined([drive.odometry for drive in later], OdometryTrack),
    )


def _joined(tracks: Sequence[Track | None], kind: type[Track]) -> Track | None:
    known = [track for track in tracks if track is not None]
    if len(known) < len(tracks):
        return None
    return kind(*(np.concatenate([getattr(track, each.name) for track in known]) for each in fields(kind)))
