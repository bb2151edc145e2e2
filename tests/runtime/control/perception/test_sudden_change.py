"""Views that change at once, and drives that only look like it."""

import math
from dataclasses import replace

import numpy as np
import pytest

from wallride.drivers.api import Scan
from wallride.runtime.control.perception.plausibility import SuddenChange
from wallride.sim.virtual.closed_loop import as_scan
from wallride.sim.world.beams import LidarSettings, scan
from wallride.sim.world.pose import Pose, Twist
from wallride.sim.world.worlds import load_world

LIDAR = LidarSettings()
SCAN_S = 0.025


def told(world, *, speed_mps=2.0, turn_radps=0.0, scans=40, after=lambda number, one: one, said_radps=None):
    """Return at which scans a change is told to a car that drives from the world's start."""
    place, sudden, rng, found = load_world(world), SuddenChange(), np.random.default_rng(3), []
    for number in range(scans):
        now_s = number * SCAN_S
        yaw_rad = place.start.yaw_rad + turn_radps * now_s
        way_m = speed_mps * now_s
        pose = Pose(
            place.start.x_m + way_m * math.cos(place.start.yaw_rad),
            place.start.y_m + way_m * math.sin(place.start.yaw_rad), yaw_rad,
        )  # fmt: skip
        sent_mm = scan(place, pose, Twist(speed_mps, turn_radps), now_s, rng, LIDAR)
        one = after(number, as_scan(sent_mm, LIDAR, now_s, number))
        said = turn_radps if said_radps is None else said_radps
        if sudden.learn(one, said * now_s):
            found.append(number)
    return found


def from_scan_20(change):
    return lambda number, one: replace(one, ranges_m=change(one.ranges_m)) if number >= 20 else one


@pytest.mark.parametrize(
    "change",
    [
        lambda ranges_m: np.roll(ranges_m, -360),
        lambda ranges_m: np.roll(ranges_m, 360),
        lambda ranges_m: ranges_m * np.float32(0.5),
    ],
    ids=["turned right", "turned left", "half as far"],
)
@pytest.mark.parametrize("world", ["loop", "corridor"])
def test_a_lidar_that_was_knocked_or_scales_its_ranges_is_told_once(world, change):
    assert told(world, after=from_scan_20(change)) == [20]


@pytest.mark.parametrize("world", ["loop", "doorway", "cluttered", "inside_corner"])
@pytest.mark.parametrize(("speed_mps", "turn_radps"), [(4.0, 0.0), (0.5, 4.0), (2.0, -2.0)])
def test_fast_driving_and_turning_are_no_sudden_change(world, speed_mps, turn_radps):
    assert told(world, speed_mps=speed_mps, turn_radps=turn_radps, scans=16) == []


def test_a_turn_that_the_wheels_do_not_tell_is_one():
    assert told("loop", speed_mps=0.0, turn_radps=12.0, said_radps=0.0)


def test_another_kind_of_scan_is_another_lidar():
    def coarser(number, one: Scan):
        if number < 20:
            return one
        return replace(one, angle_step_rad=2.0 * one.angle_step_rad, ranges_m=one.ranges_m[::2])

    assert told("loop", after=coarser) == [20]
