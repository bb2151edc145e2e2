"""The car's own motion: predicted by wheels, steering and tyres, and put right by the scans."""

import cmath
import math
from dataclasses import replace

import numpy as np
import pytest

from tests.runtime.control.corridor_following.course_scenes import report
from tests.runtime.control.perception.motion.test_scan_matching import room
from tests.runtime.control.scans import CAR, see
from wallride.runtime.control.perception.motion.own_motion import CARRIED_S, KEYFRAME_S, MatchedOdometry
from wallride.runtime.control.tyres import Tyres

TYRES = Tyres(CAR.wheelbase_m, 0.8, 4.7, 5.5)
PERIOD_S = 0.025
NOTHING = see(np.full(1081, np.nan))


class Driven:
    """A car that drives straight on in a room, while its wheels report a steering."""

    def __init__(self, steering_rad=0.0, speed_mps=1.0, sees=True, **walls):
        self.odometry = MatchedOdometry(TYRES)
        self.steering_rad, self.speed_mps, self.sees, self.walls = steering_rad, speed_mps, sees, walls
        self.number, self.now_s = 0, 0.0

    def motor(self, **state):
        told = report(self.now_s, self.speed_mps, self.speed_mps * self.now_s, self.steering_rad)
        return replace(told, **state)

    def scan(self, *, lost=False, reports=True, since_s=PERIOD_S, **state):
        self.number, self.now_s = self.number + 1, self.now_s + since_s
        motor = self.motor(**state) if reports else None
        motion = self.odometry.look(self.now_s, motor)
        at_m = self.speed_mps * self.now_s
        view = room((at_m, 0.0, 0.0), seed=self.number, **self.walls) if self.sees else NOTHING
        self.odometry.learn(view, lost=lost)
        return motion

    def scans(self, count, **conditions):
        for _ in range(count):
            motion = self.scan(**conditions)
        return motion


def heading_rad(place):
    return cmath.phase(place.turn)


def test_steering_that_turns_by_mistake_is_put_right_over_many_scans():
    motion = Driven(0.1).scans(40)
    assert motion.sure
    assert abs(heading_rad(motion.before)) < 0.01
    assert abs(motion.before.at_m.imag) < 0.03
    assert heading_rad(Driven(0.1, sees=False).scans(40).before) > 0.2, "by wheels alone it is not"


def test_a_place_is_predicted_first_and_corrected_by_its_own_scan():
    car = Driven(0.1)
    car.scans(20)
    predicted = car.scan().here
    corrected = car.scan().before
    assert corrected.stamp_s == predicted.stamp_s
    assert abs(heading_rad(corrected)) < abs(heading_rad(predicted))


def test_the_trim_is_learnt_from_the_turn_that_the_scans_show():
    assert Driven(0.02, speed_mps=2.0).scans(120).trim_rad == pytest.approx(-0.02, abs=0.005)


def test_noise_on_the_walls_of_a_corridor_moves_nothing_along_it():
    car = Driven(speed_mps=3.0, ends_m=(-60.0, 60.0), noise_m=0.02)
    first = car.scan().here
    motion = car.scans(40)
    assert (motion.here.at_m - first.at_m).real == pytest.approx(3.0, abs=0.05)


def test_in_a_bend_the_rear_axle_slips_outward_and_the_turn_lags():
    car = Driven(speed_mps=4.0, sees=False)
    first = car.scan().here
    car.steering_rad = 0.1
    assert car.scan().here.turn_radps == 0.0
    assert 0.0 < car.scan().here.turn_radps < 0.5 * 4.0 * math.tan(0.1) / CAR.wheelbase_m
    last, motion = car.scans(60).here, car.scan()
    course_rad = cmath.phase((motion.here.at_m - last.at_m) / last.turn)
    assert course_rad < 0.0 < motion.here.turn_radps
    assert motion.here.way_m - first.way_m == pytest.approx(4.0 * 63 * PERIOD_S)


def test_a_car_that_is_first_seen_in_a_bend_turns_already():
    assert Driven(0.1, speed_mps=2.0).scan().here.turn_radps == pytest.approx(2.0 * math.tan(0.1) / CAR.wheelbase_m)


def test_an_old_report_is_carried_on_to_the_scan_but_not_for_long():
    car = Driven(speed_mps=2.0, sees=False)
    first = car.scan().here
    late = car.scan(stamp_s=PERIOD_S).here
    assert late.way_m - first.way_m == pytest.approx(2.0 * PERIOD_S + 2.0 * PERIOD_S)
    stale = car.scan(stamp_s=-9.0).here
    assert stale.way_m == pytest.approx(2.0 * car.now_s + 2.0 * CARRIED_S)


@pytest.mark.parametrize("gap", [{"reports": False}, {"lost": True}])
def test_a_car_whose_wheels_tell_nothing_is_followed_by_its_scans(gap):
    car = Driven(speed_mps=2.0)
    began_m = car.scans(20, speed_mps=2.0).here.at_m
    frozen_m = car.speed_mps * car.now_s
    for _ in range(12):
        motion = car.scan(**gap, distance_m=frozen_m, speed_mps=0.0)
        assert abs(motion.here.at_m - motion.before.at_m) < 1e-6, "the wheels stand"
        assert car.odometry.slid.at_m.real == pytest.approx(2.0 * PERIOD_S, abs=0.02)
    after = car.scan(speed_mps=2.0)
    assert after.before.at_m - began_m == pytest.approx(12 * 2.0 * PERIOD_S, abs=0.03)
    assert not after.sure
    assert car.scans(3).sure


def test_of_a_slide_without_a_scene_nothing_is_told():
    car = Driven(speed_mps=2.0, sees=False)
    car.scans(5)
    car.scan(lost=True, speed_mps=0.0)
    assert car.odometry.slid is None


@pytest.mark.parametrize("field", ["speed_mps", "distance_m", "steering_rad"])
def test_a_report_that_is_no_number_tells_nothing(field):
    car = Driven(sees=False)
    before = car.scans(3).here
    assert car.scan(**{field: math.nan}).here.at_m == before.at_m
    assert math.isfinite(abs(car.scans(2).here.at_m))


def test_a_scene_that_shows_no_turn_teaches_no_trim():
    car, ranges_m = Driven(speed_mps=2.0), np.full(1081, 9.0)
    for number in range(20):
        noisy_m = ranges_m + np.random.default_rng(number).normal(0.0, 0.01, 1081)
        car.now_s += PERIOD_S
        motion = car.odometry.look(car.now_s, car.motor())
        car.odometry.learn(see(noisy_m))
    assert motion.trim_rad == 0.0


def test_over_a_gap_of_the_lidar_the_wheels_tell_the_way():
    car = Driven(speed_mps=1.0, sees=False)
    last = car.scans(4).here
    after = car.scan(since_s=2 * KEYFRAME_S).here
    assert (after.at_m - last.at_m).real == pytest.approx(2 * KEYFRAME_S, abs=1e-6)
