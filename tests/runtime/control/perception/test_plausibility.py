"""Wheels and lidar that tell of the same drive, and of different ones: simulated rooms, and real drives."""

import math
from dataclasses import replace

import numpy as np
import pytest

from tests.runtime.control.scans import CAR
from tests.runtime.in_earnest import judged
from wallride.drivers.api import MotorState
from wallride.runtime.control.laws import LiveLaws
from wallride.runtime.control.perception.perception import Perception
from wallride.runtime.control.perception.plausibility import (
    BACKWARDS,
    FROZEN,
    HELD_OR_TURNED,
    STANDS_FOR_S,
    TURNED,
    WHEELS_IN_THE_AIR,
    WRONG_SCALE,
    Plausibility,
)
from wallride.runtime.control.perception.scene_agreement import VANISHED
from wallride.runtime.control.safety.swept import assumed
from wallride.runtime.control.safety.swept_settings import SweptSettings
from wallride.runtime.settings.tree import load_settings
from wallride.sim.virtual.closed_loop import as_scan
from wallride.sim.world.beams import LidarSettings, scan
from wallride.sim.world.pose import Pose, Twist
from wallride.sim.world.worlds import load_world

PERIOD_S = 0.025
ROOMS = ["inside_corner", "loop", "u_turn", "dead_end", "doorway", "cluttered"]


class Room:
    """A car that is moved along an arc in a world, and whose wheels tell what the test wants."""

    def __init__(self, world="loop", seed=1, judge=None, noise_m=0.01, yaw_rad=0.0):
        self.world = load_world(world)
        start = self.world.start
        self.pose = Pose(start.x_m, start.y_m, start.yaw_rad)
        self.rng = np.random.default_rng(seed)
        self.lidar = LidarSettings(noise_std_m=noise_m)
        self.plausibility = judge or Plausibility(CAR)
        self.perception = Perception(CAR, assumed(SweptSettings()))
        self.yaw_rad = yaw_rad  # of the lidar as configured
        self.now_s = self.distance_m = 0.0
        self.sequence = 0
        self.frozen_m = None
        self.odometry_check = True
        self.moved_m = 0.0

    def step(self, speed_mps, *, told=1.0, steering_rad=0.0, motor=True):
        """Move for one scan; told: the wheels' way as a share of the car's, or the wheels' speed where it stands."""
        self.now_s += PERIOD_S
        wheels_mps = told * speed_mps if speed_mps else told
        self.distance_m += wheels_mps * PERIOD_S
        self.moved_m += speed_mps * PERIOD_S
        turn_rad = speed_mps * PERIOD_S * math.tan(steering_rad) / CAR.wheelbase_m
        middle_rad = self.pose.yaw_rad + turn_rad / 2
        self.pose = Pose(
            self.pose.x_m + speed_mps * PERIOD_S * math.cos(middle_rad),
            self.pose.y_m + speed_mps * PERIOD_S * math.sin(middle_rad),
            self.pose.yaw_rad + turn_rad,
        )
        seen = as_scan(
            scan(self.world, self.pose, Twist(0.0, 0.0, 0.0), self.now_s, self.rng, self.lidar),
            self.lidar, self.now_s, self.sequence, self.yaw_rad,
        )  # fmt: skip
        self.sequence += 1
        if self.frozen_m is not None:
            seen = replace(seen, ranges_m=self.frozen_m)
        state = MotorState(self.now_s, wheels_mps, self.distance_m, steering_rad)
        self.last = seen
        percept = self.perception.look(seen, state if motor else None)
        self.plausibility.look(percept, odometry_check=self.odometry_check)

    def drive(self, way_m, speed_mps=1.0, **more):
        for _ in range(round(abs(way_m / speed_mps / PERIOD_S))):
            self.step(speed_mps, **more)
        return self.plausibility


@pytest.mark.parametrize("world", ROOMS)
@pytest.mark.parametrize("steering_rad", [0.0, 0.3, -0.3])
@pytest.mark.parametrize("told", [0.8, 1.0, 1.3])
def test_wheels_that_tell_the_truth_are_believed(world, steering_rad, told):
    found = Room(world).drive(1.0, told=told, steering_rad=steering_rad)
    assert (found.doubt, found.believed, found.words) == ("", True, ())


@pytest.mark.parametrize("world", ["inside_corner", "loop", "u_turn", "cluttered"])
@pytest.mark.parametrize("steering_rad", [0.0, 0.2])
def test_a_car_that_drives_back_while_its_wheels_report_ahead_is_named_with_the_remedy(world, steering_rad):
    room = Room(world)
    while not room.plausibility.doubt and abs(room.moved_m) < 1.0:
        room.step(-0.5, told=-1.0, steering_rad=steering_rad)
    assert room.plausibility.motor_doubt == BACKWARDS
    assert not room.plausibility.believed
    assert abs(room.moved_m) <= 0.5


@pytest.mark.parametrize("world", ["loop", "inside_corner", "cluttered"])
def test_wheels_that_tell_a_third_of_the_way_are_a_wrong_gain(world):
    room = Room(world)
    while not room.plausibility.doubt and room.moved_m < 3.0:
        room.step(1.0, told=0.33)
    assert room.plausibility.motor_doubt == WRONG_SCALE


def named_after_m(room, *, speed_mps=1.0, steering_rad=0.0):
    while not room.plausibility.doubt and room.moved_m < 1.0:
        room.step(speed_mps, steering_rad=steering_rad)
    return room.moved_m


@pytest.mark.parametrize("world", ["inside_corner", "loop", "u_turn", "dead_end", "cluttered"])
@pytest.mark.parametrize("steering_rad", [0.0, 0.3])
@pytest.mark.parametrize("yaw_deg", [-135, -90, -60, -45, 45, 60, 90, 135])
def test_a_lidar_that_is_turned_on_the_car_is_named_within_40_cm(world, steering_rad, yaw_deg):
    room = Room(world, yaw_rad=math.radians(yaw_deg))
    assert named_after_m(room, steering_rad=steering_rad) < 0.4
    assert room.plausibility.lidar_doubt == TURNED
    assert not room.plausibility.believed


@pytest.mark.parametrize("world", ["straight", "corridor", "doorway", "curved"])
@pytest.mark.parametrize("yaw_deg", [-90, -60, -45, 45, 60, 90])
def test_where_all_walls_are_parallel_what_stands_ahead_of_a_turned_lidar_is_named(world, yaw_deg):
    room = Room(world, yaw_rad=math.radians(yaw_deg))
    assert named_after_m(room) < 0.4
    assert room.plausibility.lidar_doubt == HELD_OR_TURNED


@pytest.mark.parametrize("world", ["inside_corner", "loop", "cluttered"])
def test_a_lidar_that_looks_back_is_named_as_what_looks_the_same(world):
    room = Room(world, yaw_rad=math.pi)
    assert named_after_m(room) < 0.4
    assert room.plausibility.motor_doubt == BACKWARDS
    assert "lidar turned by 180 degrees" in BACKWARDS


@pytest.mark.parametrize("world", ROOMS)
@pytest.mark.parametrize("yaw_deg", [-12, 12])
def test_a_lidar_that_is_mounted_askew_a_little_is_believed(world, yaw_deg):
    found = Room(world, yaw_rad=math.radians(yaw_deg)).drive(1.0)
    assert (found.doubt, found.believed) == ("", True)


def test_a_turned_lidar_is_doubted_until_its_link_is_lost():
    room = Room(yaw_rad=math.radians(90))
    named_after_m(room)
    for _ in range(400):
        room.step(0.0, told=0.0)
    assert room.plausibility.doubt == TURNED
    room.now_s += 1.5
    room.step(0.0, told=0.0)
    room.plausibility.learn()
    assert room.plausibility.doubt == ""
    room.yaw_rad = 0.0
    assert room.drive(0.6).believed


def test_above_2_mps_where_a_car_may_slide_no_direction_is_judged():
    assert Room("cluttered", yaw_rad=math.radians(90)).drive(1.5, speed_mps=3.0).doubt == ""


def test_wheels_in_the_air_are_told_and_not_backed_out_by_and_no_fault():
    room = Room()
    for _ in range(40):
        room.step(0.0, told=1.0)
    found = room.plausibility
    assert (found.doubt, found.believed, found.words) == ("", False, (WHEELS_IN_THE_AIR,))
    room.drive(1.0)
    assert (found.believed, found.words) == (True, ())


def test_a_bare_corridor_tells_nothing():
    found = Room("straight", noise_m=0.02).drive(1.5, told=-1.0)
    assert (found.doubt, found.believed) == ("", True)


def test_once_confirmed_a_car_may_slide_with_locked_wheels():
    room = Room()
    room.drive(0.6)
    found = room.drive(1.0, told=0.01)
    assert (found.doubt, found.believed) == ("", True)


def test_after_a_lost_link_the_first_way_is_compared_again():
    room = Room()
    room.drive(0.6)
    room.step(0.0, told=0.0, motor=False)
    assert room.drive(0.6, told=-1.0).motor_doubt == BACKWARDS


def test_a_doubt_lasts_until_the_car_has_stood_and_the_next_way_is_compared_anew():
    room = Room()
    found = room.drive(0.6, told=-1.0)
    for _ in range(round(STANDS_FOR_S / PERIOD_S)):
        assert found.motor_doubt
        room.step(0.0, told=0.0)
    room.drive(0.1, speed_mps=0.1, told=0.0)
    assert found.doubt == ""
    assert not found.believed, "not before it was compared"
    assert room.drive(0.6).believed


def test_where_wheels_and_scans_are_of_two_drives_they_are_not_compared():
    room = Room()
    room.odometry_check = False
    assert room.drive(1.0, told=-1.0).doubt == ""


@pytest.mark.parametrize("wrong", ["phases", "mounting"])
def test_switching_the_comparison_off_ends_its_doubt_and_on_again_begins_it_anew(wrong):
    told, room = (-1.0, Room()) if wrong == "phases" else (1.0, Room(yaw_rad=math.pi / 2))
    assert room.drive(0.8, told=told).doubt
    room.plausibility._scene.doubt = VANISHED
    room.odometry_check = False
    room.step(0.0, told=0.0)
    room.step(0.0, told=0.0)
    assert (room.plausibility.doubt, room.plausibility.believed) == ("", True)
    room.odometry_check = True
    assert room.drive(0.8, told=told).doubt, "nothing was mended"


def test_a_scan_that_repeats_bit_for_bit_while_the_wheels_turn_is_a_faulty_lidar():
    room = Room()
    room.drive(0.6)
    room.frozen_m = room.last.ranges_m
    assert room.drive(0.25).doubt == ""
    found = room.drive(0.1)
    assert found.doubt == found.lidar_doubt == FROZEN
    room.drive(1.0)
    assert found.lidar_doubt
    room.frozen_m = None
    room.step(0.0, told=0.0)
    assert found.doubt == ""


def test_a_scan_that_repeats_while_the_car_stands_is_none():
    room = Room()
    room.step(0.0, told=0.0)
    room.frozen_m = room.last.ranges_m
    for _ in range(400):
        room.step(0.0, told=0.0)
    assert room.plausibility.doubt == ""
    assert room.drive(0.25).doubt == ""


@pytest.mark.parametrize("method", ["swept", "report"])
def test_the_laws_answer_a_doubt_with_a_stop_and_its_words(method):
    settings = load_settings(None, [f"safety.method={method}"])
    laws = LiveLaws(settings.wall_follow, settings.safety, CAR)
    room = Room(judge=laws.plausibility)
    room.drive(0.6, told=-1.0)
    verdict = judged(laws.look(room.last, MotorState(room.now_s, -1.0, room.distance_m, 0.0)), 1.0, 0.0)
    assert (verdict.forward_mps, verdict.reverse_mps, verdict.reason) == (0.0, 0.0, BACKWARDS)


def test_the_way_of_a_repeated_scan_counts_from_the_first_report_of_the_wheels():
    room = Room()
    room.step(1.0, motor=False)
    room.frozen_m = room.last.ranges_m
    room.step(1.0, motor=False)
    room.step(0.0, told=0.0)
    assert room.drive(0.25).doubt == ""
    assert room.drive(0.1).doubt == FROZEN
