"""Scans, followers and drives of the rolling ball's tests."""

import math

import numpy as np

from tests.runtime.control import scans
from tests.runtime.control.scans import CAR, SCAN_S
from wallride.drivers.api import MotorState
from wallride.runtime.control.perception.view import ViewCache
from wallride.runtime.control.wall_following.ball import BallFollower
from wallride.runtime.control.wall_following.ball_law import Aim, Steered, look_aheads_m, pursuit_steering
from wallride.runtime.control.wall_following.ball_path import RADII_M, BallPath
from wallride.runtime.control.wall_following.ball_settings import BallSettings
from wallride.sim.world.beams import LidarSettings, true_ranges_m
from wallride.sim.world.pose import Pose, Twist
from wallride.sim.world.worlds import load_world

MOTOR = MotorState(0.0, 0.0, 0.0, 0.0)


def scan_of(ranges_m, number=0, late_s=0.0):
    ranges_m = np.where(np.isfinite(ranges_m), ranges_m, np.nan)
    return scans.scan_of(ranges_m, SCAN_S * number, number, late_s=late_s)


def scan_in(name, x_m=0.0, y_m=0.0, yaw_rad=0.0, side="left", number=0, late_s=0.0):
    world = load_world(name, side=side)
    mirror = 1 if side == "left" else -1
    pose = Pose(x_m, mirror * y_m, mirror * yaw_rad)
    return scan_of(true_ranges_m(world, pose, Twist(), LidarSettings(noise_std_m=0.0)), number, late_s)


def follower(**changes):
    return BallFollower(BallSettings(**changes), CAR, ViewCache(CAR))


def places(path):
    radius_m = np.array(path.radius_m)
    return radius_m * np.cos(path.bearing_rad), radius_m * np.sin(path.bearing_rad)


def along(way, speed_mps=1.0, *, error_m=0.0, line=(math.nan, math.nan), bend=0.0, kp=13.5, kd=4.5):
    """Answer a path that is at the bearing way(r) on the circle of radius r; None where it does not cross it."""
    radii_m = RADII_M + look_aheads_m(0.4, 0.3, speed_mps)
    bearing_rad = [way(r_m) for r_m in radii_m]
    crosses = tuple(rad is not None for rad in bearing_rad)
    path = BallPath(radii_m, tuple(rad or 0.0 for rad in bearing_rad), crosses, crosses)
    return pursuit_steering(path, Aim(error_m, line[0], line[1], bend, speed_mps), Steered(kp, kd, 0.33, 0.0, 0.4))


def arc(curvature, speed_mps):
    """The steering of a car without error on an arc."""
    return along(lambda r_m: math.asin(r_m * curvature / 2), speed_mps)[3]
