"""Recordings made by the simulator, whose truth is known, and the real ones where they are."""

import math
from pathlib import Path
from types import MappingProxyType

import numpy as np
import pytest

from wallride.sim.recordings import CommandTrack, Recording, load_recording
from wallride.sim.world.beams import LidarSettings, scan
from wallride.sim.world.pose import Pose, Twist
from wallride.sim.world.worlds import load_world

RACECAR = Path(__file__).resolve().parents[3] / ".." / "shared" / "data" / "racecar"
LIDAR_M = 0.27
PERIOD_S = 0.025


def real(name):
    path = RACECAR / f"{name}.npz"
    if not path.exists():
        pytest.skip(f"the recording {path.name} is not here; it lies in shared/data beside the checkout")
    return load_recording(path)


def arc_poses(scans, speed_mps, curvature_per_m=0.0, start=None):
    """Poses of the rear axle, one per scan."""
    poses = [start or Pose(0.0, 0.0, 0.0)]
    step_m = speed_mps * PERIOD_S
    for _ in range(scans - 1):
        last, turn_rad = poses[-1], curvature_per_m * step_m
        ahead = Pose(last.x_m, last.y_m, last.yaw_rad + turn_rad / 2).ahead(step_m)
        poses.append(Pose(ahead.x_m, ahead.y_m, last.yaw_rad + turn_rad))
    return poses


def recorded(poses, *, world="inside_corner", commands=None, lidar=None, stamps_s=None, name="made up"):
    """What a recorder would have kept of these poses."""
    lidar = lidar or LidarSettings(noise_std_m=0.01, outlier_share=0.01, motion_skew=False)
    surroundings = world if hasattr(world, "cast") else load_world(world)
    random = np.random.default_rng(3)
    seen_mm = np.array([scan(surroundings, at, Twist(), 0.0, random, lidar) for at in poses])
    ranges_m = (seen_mm / 1000).astype(np.float32)
    times_s = np.array([n * PERIOD_S for n in range(len(poses))] if stamps_s is None else stamps_s, np.float64)
    step_rad = math.radians(0.25)
    return Recording(
        name=name, topic="scan", other_topics=(), received_s=times_s + 0.02, stamp_s=times_s, ranges_m=ranges_m,
        angle_min_rad=-540 * step_rad, angle_step_rad=step_rad, range_min_m=0.02, range_max_m=30.0,
        scan_time_s=PERIOD_S, commands=MappingProxyType(commands or {}), odometry=None,
    )  # fmt: skip


def track(speed_mps, steering_rad=0.0, until_s=60.0, from_s=0.0):
    times_s = np.arange(from_s, until_s, 0.05)
    return CommandTrack(times_s, np.full(times_s.size, speed_mps), np.full(times_s.size, steering_rad))
