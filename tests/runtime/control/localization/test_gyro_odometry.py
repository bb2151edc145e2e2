"""Odometry by wheels and gyro: what it is better at than the steering, and gyros that it does not believe."""

import math
from dataclasses import replace

import numpy as np
import pytest

from wallride.drivers.api import MotorState
from wallride.runtime.control.localization import gyro_odometry
from wallride.runtime.control.localization.gyro_odometry import GyroOdometry
from wallride.runtime.control.perception.odometry import Odometry
from wallride.runtime.control.vehicle import CarSettings

WHEELBASE_M = 0.3302
LEVEL = (0.0, 0.0, 9.81)
REPORT_S, SPEED_MPS = 0.02, 2.0


class Circle:
    """Drives left circles of 1 m: stands first, then drives for the rest. gyro: a function of the true rate [rad/s]."""

    def __init__(self, gyro=None, *, stands_s=2.0, acceleration_mps2=LEVEL, trim_rad=0.0, locked_s=math.inf):
        self.odometry = GyroOdometry(CarSettings(wheelbase_m=WHEELBASE_M))
        self.gyro, self.acceleration_mps2 = gyro, acceleration_mps2
        self.stands_s, self.trim_rad, self.locked_s = stands_s, trim_rad, locked_s
        self.steering_rad = math.atan(WHEELBASE_M)
        self.time_s = self.way_m = self.true_m = 0.0
        self.true_mps = 0.0
        self.states = []

    def drive(self, seconds, *, samples=True):
        for _ in range(round(seconds / REPORT_S)):
            self.time_s += REPORT_S
            locked = self.time_s > self.stands_s + self.locked_s
            self.true_mps = 0.0 if self.time_s <= self.stands_s else SPEED_MPS
            if locked:
                self.true_mps = max(0.0, SPEED_MPS - 5.0 * (self.time_s - self.stands_s - self.locked_s))
            self.true_m += self.true_mps * REPORT_S
            self.way_m += 0.0 if locked else self.true_mps * REPORT_S
            if self.gyro is not None and samples:
                rate = (0.0, 0.0, self.gyro(self.true_mps))
                self.odometry.take(self.time_s - 0.002, rate, self.acceleration_mps2)
            wheel_mps = 0.0 if locked else self.true_mps
            self.states.append(
                MotorState(self.time_s, wheel_mps, self.way_m, self.steering_rad + self.trim_rad if wheel_mps else 0.0)
            )
            self.odometry.update(self.states[-1])
        return self

    @property
    def turned_rad(self):
        """Return the heading that is told, less the true one."""
        return math.remainder(self.odometry.pose.yaw_rad - self.true_m, math.tau)


def mems(rate):
    return rate + 0.02


def test_without_a_gyro_it_is_the_odometry_by_wheels_and_steering_to_the_bit():
    car, plain = Circle().drive(9.0), Odometry(WHEELBASE_M)
    for state in car.states:
        plain.update(state)
    assert car.odometry.pose == plain.pose
    assert car.odometry.heading == f"steering: {gyro_odometry.NO_SENSOR}"


def test_with_one_the_trim_of_the_steering_and_the_bias_do_not_turn_it():
    by_steering, by_gyro = Circle(trim_rad=0.02).drive(12.0), Circle(mems, trim_rad=0.02).drive(12.0)
    assert abs(by_steering.turned_rad) > 1.0
    assert abs(by_gyro.turned_rad) < 0.02
    assert by_gyro.odometry.heading == "gyro"
    assert by_gyro.odometry.pose.yaw_rate_radps == pytest.approx(SPEED_MPS, abs=0.01)


def test_a_bias_that_is_not_known_yet_is_not_driven_by():
    car = Circle(mems, stands_s=0.5).drive(3.0)
    assert car.odometry.heading == f"steering: {gyro_odometry.UNKNOWN_BIAS}"
    assert abs(car.turned_rad) < 0.05


@pytest.mark.parametrize(
    ("gyro", "acceleration_mps2", "trouble"),
    [
        (lambda rate: -rate, (0.0, 0.0, -9.81), gyro_odometry.NOT_LEVEL),
        (lambda rate: 0.1 * rate, (9.81, 0.0, 0.5), gyro_odometry.NOT_LEVEL),
        (lambda rate: -rate, LEVEL, gyro_odometry.DISAGREES),
        (math.degrees, LEVEL, gyro_odometry.DISAGREES),
        (lambda rate: 0.01, LEVEL, gyro_odometry.DISAGREES),
    ],
    ids=["upside down", "on its side", "mirrored", "degrees", "frozen"],
)
def test_a_gyro_that_cannot_be_right_is_named_and_left_alone(gyro, acceleration_mps2, trouble):
    car = Circle(gyro, acceleration_mps2=acceleration_mps2).drive(5.0)
    assert car.odometry.heading == f"steering: {trouble}"
    before_rad = car.turned_rad
    assert math.remainder(car.drive(5.0).turned_rad - before_rad, math.tau) == pytest.approx(0.0, abs=0.01)


def test_what_falls_silent_leaves_the_heading_to_the_steering_and_takes_it_back():
    car = Circle(mems).drive(6.0)
    car.drive(2.0, samples=False)
    assert car.odometry.heading == f"steering: {gyro_odometry.SILENT}"
    car.drive(4.0)
    assert car.odometry.heading == "gyro"
    assert abs(car.turned_rad) < 0.03
    assert np.isfinite([car.odometry.pose.x_m, car.odometry.pose.y_m]).all()


def test_locked_wheels_do_not_stand_still():
    car = Circle(lambda rate: rate, locked_s=2.0).drive(4.2)
    slid_m = abs(complex(car.odometry.pose.x_m, car.odometry.pose.y_m))
    plain = Odometry(WHEELBASE_M)
    for state in car.states:
        plain.update(state)
    chord_m = 2.0 * abs(math.sin(car.true_m / 2.0))
    assert abs(slid_m - chord_m) < 0.12
    assert abs(abs(complex(plain.pose.x_m, plain.pose.y_m)) - chord_m) > 0.12


def test_a_lost_motor_controller_interrupts_it():
    car = Circle(mems).drive(6.0)
    pose = car.odometry.update(None)
    assert (pose.speed_mps, pose.yaw_rate_radps) == (0.0, 0.0)
    place = complex(pose.x_m, pose.y_m)
    car.way_m += 100.0
    assert abs(complex(car.drive(0.02).odometry.pose.x_m, car.odometry.pose.y_m) - place) < 0.05


def test_the_same_report_once_more_now_with_a_fault_moves_nothing():
    car = Circle(mems).drive(6.0)
    pose = car.odometry.pose
    assert car.odometry.update(replace(car.states[-1], fault="a button")) == pose
