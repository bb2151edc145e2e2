"""What scans teach the odometry of its wheels, tyres and gyro, and where they tell nothing."""

import cmath
import math

import numpy as np
import pytest

from tests.runtime.control.localization.rooms import Room, report
from wallride.runtime.control.localization.gyro_odometry import GyroOdometry
from wallride.runtime.control.localization.odometry_errors import BIAS, GYRO_SCALE, SCALE, SLIP
from wallride.runtime.control.perception.odometry import Odometry
from wallride.runtime.control.tyres import slip_rad
from wallride.runtime.control.vehicle import CarSettings

CAR = CarSettings()
STEP_S, LEVEL = 0.025, (0.0, 0.0, 9.81)
WHEELS, GYRO, BIAS_RADPS, MU, STIFF_PER_RAD = 1.03, 1.02, 0.01, 0.7, 5.5
HALL = Room([(-3.5, -3.0, 3.5, 3.0)], [(1.5, 2.4, 2.6, 3.0)], size_m=(8.0, 7.0), corner_m=(-4.0, -3.5))


class Drive:
    """A car whose wheels report 3 % too much and whose gyro 2 %; its tyres slip aside. It has stood for 2 s.

    scans: whether the odometry learns from them. truth, told: poses x, y, yaw at each report.
    """

    def __init__(self, room=HALL, place=0j, *, scans=True, gyro=True):
        self.odometry, self.room, self.scans, self.gyro = GyroOdometry(CAR), room, scans, gyro
        self.place, self.yaw_rad, self.way_m, self.number = place, 0.0, 0.0, 0
        self.bias_radps = BIAS_RADPS
        self.truth, self.told, self.states = [], [], []
        self.go(2.0, 0.0, 0.0)

    def go(self, seconds, speed_mps, turn_radps):
        """Drive on; return this."""
        for _ in range(round(seconds / STEP_S)):
            self.number += 1
            turn_rad, way_m = turn_radps * STEP_S, speed_mps * STEP_S
            aside_rad = -slip_rad(speed_mps * turn_radps, STIFF_PER_RAD, MU)
            self.place += way_m * complex(1.0, aside_rad) * cmath.exp(1j * (self.yaw_rad + turn_rad / 2))
            self.yaw_rad += turn_rad
            self.way_m += WHEELS * way_m
            self._tell(speed_mps, turn_radps)
        return self

    def _tell(self, speed_mps, turn_radps):
        now_s = STEP_S * self.number
        if self.gyro:
            self.odometry.take(now_s, (0.0, 0.0, GYRO * turn_radps + self.bias_radps), LEVEL)
        self.states.append(report(now_s, self.way_m, WHEELS * speed_mps, 0.05))
        pose = self.odometry.update(self.states[-1])
        true = (self.place.real, self.place.imag, self.yaw_rad)
        self.truth.append(true)
        self.told.append((pose.x_m, pose.y_m, pose.yaw_rad))
        if self.scans and speed_mps:
            self.odometry.learn(self.room.scan(true, stamp_s=now_s, noise_m=0.01, seed=self.number))

    def weave(self, rounds):
        """Drive eights, each circle of 1.2 m at three quarters of the grip."""
        for _ in range(rounds):
            for side in (1.0, -1.0):
                self.go(math.tau / 2.08, 2.5, side * 2.08)
        return self

    def off_m(self, steps):
        """Return the error of the place over the last steps, seen from where they began."""
        ways = []
        for poses in (self.truth, self.told):
            (x0_m, y0_m, yaw_rad), (x1_m, y1_m, _) = poses[-steps], poses[-1]
            ways.append(complex(x1_m - x0_m, y1_m - y0_m) * cmath.exp(-1j * yaw_rad))
        return abs(ways[0] - ways[1])


def test_scans_teach_all_errors():
    state = Drive().weave(3).odometry.errors.state
    assert state[SCALE] == pytest.approx(1.0 / WHEELS, abs=0.004)
    assert state[GYRO_SCALE] == pytest.approx(1.0 / GYRO, abs=0.003)
    assert state[SLIP] == pytest.approx(1.0 / (MU * 9.81 * STIFF_PER_RAD), abs=0.003)
    assert state[BIAS] == pytest.approx(0.0, abs=0.003)


def test_what_is_learnt_makes_the_way_exact():
    by_scans, by_gyro = Drive().weave(3).go(2.5, 2.5, 2.08), Drive(scans=False).weave(3).go(2.5, 2.5, 2.08)
    assert by_scans.off_m(100) < 0.05
    assert by_gyro.off_m(100) > 0.1


def test_a_bias_that_has_changed_since_the_car_stood_is_learnt_anew():
    car = Drive().weave(2)
    car.bias_radps += 0.003
    found_radps = [car.weave(2).odometry.errors.state[BIAS] for _ in range(3)]
    assert 0.0003 < found_radps[0] < found_radps[1] < found_radps[2] < 0.003


def test_bare_walls_tell_nothing_of_the_way_along_them():
    endless = Room([(-60.0, -1.0, 60.0, 1.0)], size_m=(124.0, 4.0), corner_m=(-62.0, -2.0))
    car = Drive(endless, -10.0 + 0j).go(6.0, 2.5, 0.0)
    assert car.odometry.errors.state[SCALE] == pytest.approx(1.0, abs=0.002)


def test_a_scene_that_contradicts_is_not_believed():
    car = Drive().weave(1)
    before = car.odometry.errors.state.copy()
    car.room = Room([(-3.2, -2.6, 3.9, 3.4)], size_m=(8.0, 7.0), corner_m=(-4.0, -3.5))
    car.go(STEP_S, 2.5, 2.08)
    assert np.abs(car.odometry.errors.state - before) == pytest.approx(0.0, abs=0.002)


def test_a_gap_ends_a_comparison():
    car = Drive().weave(1)
    car.odometry.update(None)
    before = car.odometry.errors.state.copy()
    car.place += 1.0
    car.go(0.1, 2.5, 2.08)
    assert (car.odometry.errors.state == before).all()


def test_without_a_gyro_nothing_changes():
    car, plain = Drive(gyro=False).go(2.0, 1.0, 0.3), Odometry(CAR.wheelbase_m)
    for state in car.states:
        plain.update(state)
    assert car.odometry.pose == plain.pose


def test_the_same_drive_gives_the_same_poses_to_the_bit():
    assert Drive().weave(1).told == Drive().weave(1).told
