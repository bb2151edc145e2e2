"""Courses, scans and followers for the tests of the follower `corridor`."""

import math
from functools import partial

import numpy as np

from wallride.drivers.api import MotorState
from wallride.runtime.control.corridor_following.borders import returns_of
from wallride.runtime.control.corridor_following.corridor_follower import CorridorFollower
from wallride.runtime.control.corridor_following.corridor_settings import CorridorFollowSettings
from wallride.runtime.control.perception.perception import Perception
from wallride.runtime.control.safety.swept import assumed
from wallride.runtime.control.safety.swept_settings import SweptSettings
from wallride.runtime.control.vehicle import CarSettings
from wallride.runtime.control.wall_following.followed_wall import side_view
from wallride.sim.virtual.closed_loop import as_scan
from wallride.sim.world.beams import LidarSettings, true_ranges_m
from wallride.sim.world.place import World
from wallride.sim.world.pose import Pose, Twist
from wallride.sim.world.segments import SegmentGeometry, chain

CAR = CarSettings(max_speed_mps=6.0)
START = Pose(0.0, 0.0, 0.0)


def course(*walls):
    """Return a world of some chains of corners."""
    return World("", SegmentGeometry(np.vstack([chain(list(wall)) for wall in walls])), START)


CORRIDOR = course([(-5, 1), (60, 1)], [(-5, -1), (60, -1)])
JUNCTION = course([(-5, 1), (8, 1), (8, 14)], [(-5, -1), (8, -1), (8, -14)], [(10, 14), (10, -14)])
"""A corridor 2 m wide that ends 8 m ahead in one across."""
CROSSROADS = course(
    [(-5, 1), (6, 1), (6, 14)], [(8, 14), (8, 1), (40, 1)], [(-5, -1), (6, -1), (6, -14)], [(8, -14), (8, -1), (40, -1)]
)
DEAD_END = course([(-5, 1), (3, 1), (3, -1), (-5, -1)])
BEND = course([(-5, 1), (5, 1), (5, 14)], [(-5, -1), (7, -1), (7, 14)])
"""A corridor 2 m wide that turns left by 90 degrees 5 m ahead."""


def seen_in(world, pose=START, stamp_s=0.0, number=0, noise_m=0.0):
    """Return the scan of a car that is at a place."""
    lidar = LidarSettings(noise_std_m=0.0)
    ranges_m = true_ranges_m(world, pose, Twist(), lidar)
    ranges_m = ranges_m + noise_m * np.random.default_rng(number).normal(size=ranges_m.size)
    reported_mm = np.where(np.isfinite(ranges_m), 1000 * ranges_m, 65533).astype(np.uint16)
    return as_scan(np.minimum(reported_mm, 65533), lidar, stamp_s, number)


def report(stamp_s, speed_mps=0.0, distance_m=0.0, steering_rad=0.0):
    return MotorState(stamp_s, speed_mps, distance_m, steering_rad)


def perception(car=CAR):
    return Perception(car, assumed(SweptSettings()))


def follower(car=CAR, **settings):
    chosen = CorridorFollowSettings(**{"speed_mps": 6.0, **settings})
    return CorridorFollower(chosen, car, perception(car))


def returns_in(world, pose=START, side="left"):
    """Return what is seen from a place, as the follower sees it."""
    view = perception().views.see(seen_in(world, pose))
    return returns_of(side_view(view, side), CAR.lidar_m)


def rolled(one, world, begin=START, *, scans=12, speed_mps=2.0, noise_m=0.0):
    """Return the guidance at each scan of a car that rolls straight on, whatever it is told."""
    at = partial(Pose, yaw_rad=begin.yaw_rad)
    ways_m = speed_mps * 0.025 * np.arange(scans)
    return [
        one.follow(
            seen_in(world, at(begin.x_m + w * math.cos(begin.yaw_rad), begin.y_m + w * math.sin(begin.yaw_rad)),
                    0.025 * k, k, noise_m),
            report(0.025 * k, speed_mps, float(w)),
        )
        for k, w in enumerate(ways_m)
    ]  # fmt: skip
