"""Replay of a recorded drive through the car's own perception and safety: their decisions for every scan.

The replay does not steer. The recorded motion is fixed; safety judges, at every scan, the drive that the
recorded mux let through at that moment, or, where that was not recorded, about the motion that the scans show.
"""

import math
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from wallride.drivers.api import MotorState, Scan
from wallride.runtime.arbitration.command import Verdict
from wallride.runtime.calibration.scan_motion import ScanMotion
from wallride.runtime.control.perception.lidar_health import LidarHealth
from wallride.runtime.control.safety.swept import SweptAssessment, SweptGuard
from wallride.runtime.control.safety.swept_settings import SweptSettings
from wallride.runtime.control.vehicle import CarSettings
from wallride.runtime.control.wall_following.ball import BallFollower
from wallride.runtime.control.wall_following.ball_settings import BallSettings
from wallride.runtime.control.wall_following.wall_fit import WallLine
from wallride.sim.recordings import CommandTrack, Recording
from wallride.sim.recordings.scans import motion_of, motor_at, scans_of, wall_line
from wallride.sim.world.pose import Floats, Side

DRIVES_ABOVE_MPS = 0.15
STEERS_ABOVE_MPS = 0.3
"""Minimum speed at which the motion shows the heading of the wheels."""
COMMAND_LASTS_S = 0.3
JUMP_M = 0.1
"""Minimum jump of a distance from scan to scan; no car approaches a wall that fast."""


@dataclass(frozen=True, slots=True)
class AskedDrive:
    """Command of the recorded car at a scan; origin: the topic of the command, or the motion."""

    speed_mps: float
    steering_rad: float
    origin: str


@dataclass(frozen=True, slots=True, eq=False)
class JudgedScan:
    """One scan and its decisions. walker: whether a walker is predicted to cross."""

    scan: Scan
    motor: MotorState
    assessment: SweptAssessment
    asked: AskedDrive
    verdict: Verdict
    line: WallLine | None
    distance_m: float
    walker: bool

    @property
    def drives(self) -> bool:
        """Return whether the recorded car was commanded forward, and safety's decision would have counted."""
        return self.asked.speed_mps > 0

    @property
    def capped(self) -> bool:
        """Return whether safety would have lowered the speed at which the car drove; below 0.3 m/s for a slower car."""
        return self.drives and self.verdict.forward_mps < min(self.asked.speed_mps, max(self.motor.speed_mps, 0.3))

    @property
    def stopped(self) -> bool:
        """Return whether safety would have stopped the car."""
        return self.drives and self.verdict.forward_mps <= 0


@dataclass(slots=True, eq=False)
class Replay:
    """A completely judged recording. side: of the followed wall. masked: (beams,), number of masked scans.

    parts: (beams,), what is known at the end for the car's own parts and dirt.
    """

    recording: Recording
    motion: ScanMotion
    side: Side
    judged: list[JudgedScan]
    health: LidarHealth
    masked: npt.NDArray[np.intp]
    parts: npt.NDArray[np.bool_]


def replay(recording: Recording, side: Side, guard_settings: SweptSettings | None = None) -> Replay:
    """Judge every scan of a recording, in order, with fresh perception."""
    car = CarSettings()
    motion = motion_of(recording)
    guard = SweptGuard(guard_settings or SweptSettings(), car)
    perception = guard.perception
    follower = BallFollower(BallSettings(side=side, speed_mps=2.0), car, perception.views)
    judged: list[JudgedScan] = []
    masked = np.zeros(recording.beams, np.intp)
    for number, scan in enumerate(scans_of(recording)):
        asked = asked_at(recording, motion, number, car)
        motor = motor_at(motion, number, _wheels_rad(motion, number, asked, car), float(recording.received_s[number]))
        assessment = guard.look(scan, motor)
        distance_m = follower.follow(scan, motor).distance_m
        line = wall_line(assessment.view, side)
        verdict, memory = assessment.judge(asked.speed_mps, asked.steering_rad, assessment.memory)
        assessment.commit(memory)
        judged.append(
            JudgedScan(scan, motor, assessment, asked, verdict, line, distance_m, perception.movers.any_moves)
        )
        if perception.health.mask is not None:
            masked += perception.health.mask
    perception.learn()
    parts, dirty = perception.own_parts.parts, perception.health.mask
    if dirty is not None:
        parts = parts | dirty
    return Replay(recording, motion, side, judged, perception.health, masked, parts)


def asked_at(recording: Recording, motion: ScanMotion, number: int, car: CarSettings) -> AskedDrive:
    """Return the command at a scan's arrival; if it was not recorded, the way that the car took."""
    time_s = float(recording.received_s[number])
    for track, origin in ((recording.output, "mux"), (_without_mux(recording), "program")):
        if track is not None and len(track):
            speed_mps, steering_rad = _newest(track, time_s)
            return AskedDrive(speed_mps, _within(steering_rad, car), origin)
    speed_mps = float(motion.speed_mps[number])
    if abs(speed_mps) < DRIVES_ABOVE_MPS:
        return AskedDrive(0.0, 0.0, "motion")
    return AskedDrive(speed_mps, _curving_rad(motion, number, car), "motion")


def _without_mux(recording: Recording) -> CommandTrack | None:
    return recording.navigation if recording.output is None else None


def _newest(track: CommandTrack, time_s: float) -> tuple[float, float]:
    index = int(np.searchsorted(track.received_s, time_s, side="right")) - 1
    if index < 0 or time_s - track.received_s[index] > COMMAND_LASTS_S:
        return 0.0, 0.0
    return float(track.speed_mps[index]), float(track.steering_rad[index])


def _wheels_rad(motion: ScanMotion, number: int, asked: AskedDrive, car: CarSettings) -> float:
    """Return the angle of the wheels: from the motion if it is sufficient, else the requested one."""
    if abs(float(motion.speed_mps[number])) < STEERS_ABOVE_MPS:
        return asked.steering_rad
    return _curving_rad(motion, number, car)


def _curving_rad(motion: ScanMotion, number: int, car: CarSettings) -> float:
    """Return the wheel angle of the way's own curvature; 0 where the car is too slow to determine it."""
    speed_mps = float(motion.speed_mps[number])
    if abs(speed_mps) < STEERS_ABOVE_MPS:
        return 0.0
    return _within(math.atan(float(motion.yaw_rate_radps[number]) * car.wheelbase_m / speed_mps), car)


def _within(wheels_rad: float, car: CarSettings) -> float:
    return min(max(wheels_rad, -car.max_steering_rad), car.max_steering_rad)


def noise(values: Floats) -> float:
    """Return the scan-to-scan noise, free of any steady motion, NaN of too few values.

    The median of |second differences| is 1.4826 times smaller than their standard deviation, and that is sqrt(6) times
    the noise of one value. Jumps are left out by the median; `jumps` counts them.
    """
    bends = np.diff(values, n=2)
    bends = np.abs(bends[np.isfinite(bends)])
    return float(1.4826 * np.median(bends) / math.sqrt(6)) if bends.size else math.nan


def jumps(values_m: Floats) -> int:
    """Return the number of jumps of a distance to another wall."""
    steps_m = np.abs(np.diff(values_m))
    return int(np.count_nonzero(steps_m[np.isfinite(steps_m)] > JUMP_M))
