"""Motion of the lidar between the scans: by wheels and gyro, by wheels and steering, or by the scans alone."""

from dataclasses import dataclass
from typing import Final

import numpy as np

from wallride.runtime.calibration.scan_motion import motion_of_scans
from wallride.runtime.control.localization.gyro_odometry import STANDS_MPS
from wallride.runtime.control.localization.pose_filter import SLIP_S2PM
from wallride.runtime.control.localization.wheel_steps import LOCKS_MPS2, SLIDES_MPS2
from wallride.sim.mapping.lap_record import LapRecord
from wallride.sim.world.pose import Floats

MIN_STANDING: Final = 20
"""Rates of a standing car below which the gyro's bias counts as unknown, 0."""
MAX_RANGE_M: Final = 12.0
BEYOND_S: Final = 0.1
"""A path goes on for this time at its last speed: the last report is older than the last scan."""


@dataclass(frozen=True, slots=True)
class LearntCar:
    """Errors of the car's own sensors, as far as they are known.

    scale: true way over the reported one. trim_rad: true steering less the reported one. slip_s2pm: the rear axle moves
    aside by -slip v^2 yaw rate; 0.023 at a friction of 0.8, 0.037 at 0.5. gyro_scale: true turn over the gyro's.
    bias_radps: of the gyro, beyond what it had while the wheels stood.
    """

    scale: float = 1.0
    trim_rad: float = 0.0
    slip_s2pm: float = SLIP_S2PM
    gyro_scale: float = 1.0
    bias_radps: float = 0.0


@dataclass(frozen=True, slots=True, eq=False)
class LidarPath:
    """Poses of the lidar, (k, 3) x [m], y [m], yaw [rad, continuous], at rising times (k,)."""

    time_s: Floats
    poses: Floats

    def at(self, time_s: Floats) -> Floats:
        """Return the poses at times (n,), (n, 3)."""
        return np.column_stack([np.interp(time_s, self.time_s, part) for part in self.poses.T])

    def turned(self, time_s: Floats, by_rad: Floats) -> "LidarPath":
        """Return the same steps with their headings turned by angles that are known at some times."""
        turn_rad = np.interp(self.time_s, time_s, np.unwrap(by_rad))
        steps = np.diff(self.poses[:, :2], axis=0) @ np.array([1.0, 1j])
        places = np.cumsum(np.append(self.poses[0, :2] @ np.array([1.0, 1j]), steps * np.exp(1j * _middles(turn_rad))))
        return LidarPath(self.time_s, np.column_stack([places.real, places.imag, self.poses[:, 2] + turn_rad]))

    def through(self, time_s: Floats, poses: Floats) -> "LidarPath":
        """Return the path that goes through poses (n, 3) at times (n,), and by its own steps between them."""
        turned = self.turned(time_s, poses[:, 2] - self.at(time_s)[:, 2])
        off = np.column_stack([poses[:, :2] - turned.at(time_s)[:, :2], np.zeros(len(poses))])
        return LidarPath(self.time_s, turned.poses + LidarPath(time_s, off).at(self.time_s))


def odometry_path(record: LapRecord, car: LearntCar) -> LidarPath:
    """Return the motion of a drive by the best that it has."""
    if len(record.reports) < 2:
        motion = motion_of_scans(record.scan_s, record.ranges_m, record.kind, MAX_RANGE_M)
        yaw_rad = np.unwrap(motion.yaw_rad)
        return LidarPath(record.scan_s, np.column_stack([motion.x_m, motion.y_m, yaw_rad]))
    time_s, way_m, speed_mps, steering_rad = record.reports.T
    period_s, true_mps = np.diff(time_s), _not_locked_mps(time_s, speed_mps)
    slides = true_mps != speed_mps
    step_m = car.scale * np.where(slides[1:], _middles(true_mps) * period_s, np.diff(way_m))
    turn_rad = _turns_rad(record, car, step_m, _middles(steering_rad))
    yaw_rad = np.concatenate([[0.0], np.cumsum(turn_rad)])
    aside_m = -car.slip_s2pm * (car.scale * _middles(true_mps)) ** 2 * turn_rad
    cos, sin = np.cos(_middles(yaw_rad)), np.sin(_middles(yaw_rad))
    x_m = np.concatenate([[0.0], np.cumsum(cos * step_m - sin * aside_m)])
    y_m = np.concatenate([[0.0], np.cumsum(sin * step_m + cos * aside_m)])
    poses = np.column_stack([x_m, y_m, yaw_rad])
    poses[:, :2] += _turned(record.lidar_m, yaw_rad)
    last = poses[-1] + (poses[-1] - poses[-2]) * BEYOND_S / max(period_s[-1], 1e-3)
    return LidarPath(np.append(time_s, time_s[-1] + BEYOND_S), np.vstack([poses, last]))


def of_the_axle(poses: Floats, lidar_m: complex) -> Floats:
    """Return poses (n, 3) of the rear axle, given those of the lidar."""
    axle = poses.copy()
    axle[:, :2] -= _turned(lidar_m, poses[:, 2])
    return axle


def gyro_bias_radps(record: LapRecord) -> float:
    """Return the gyro's median rate while the wheels stand (or lock, for a moment); 0 where they hardly do."""
    speed_mps = np.interp(record.gyro[:, 0], record.reports[:, 0], np.abs(record.reports[:, 2]))
    standing = record.gyro[speed_mps < STANDS_MPS, 1]
    return float(np.median(standing)) if len(standing) >= MIN_STANDING else 0.0


def _turns_rad(record: LapRecord, car: LearntCar, step_m: Floats, steering_rad: Floats) -> Floats:
    if len(record.gyro) < 2:
        return step_m * np.tan(steering_rad + car.trim_rad) / record.wheelbase_m
    time_s, rate_radps = record.gyro[:, 0], record.gyro[:, 1] - gyro_bias_radps(record) - car.bias_radps
    angle_rad = np.concatenate([[0.0], np.cumsum(_middles(rate_radps) * np.diff(time_s))])
    turns_rad: Floats = car.gyro_scale * np.diff(np.interp(record.reports[:, 0], time_s, angle_rad))
    return turns_rad


def _not_locked_mps(time_s: Floats, speed_mps: Floats) -> Floats:
    """Return the reported speeds, but where a full brake locks the wheels that of a car that slides on."""
    true_mps = speed_mps.copy()
    for at in range(1, len(time_s)):
        period_s = time_s[at] - time_s[at - 1]
        if true_mps[at] < true_mps[at - 1] - LOCKS_MPS2 * period_s:
            true_mps[at] = max(0.0, speed_mps[at], true_mps[at - 1] - SLIDES_MPS2 * period_s)
    return true_mps


def _middles(values: Floats) -> Floats:
    return (values[1:] + values[:-1]) / 2


def _turned(lidar_m: complex, yaw_rad: Floats) -> Floats:
    there = lidar_m * np.exp(1j * yaw_rad)
    return np.column_stack([there.real, there.imag])
