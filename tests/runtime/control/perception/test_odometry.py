"""Dead reckoning against circles that one can work out by hand."""

import math
from dataclasses import replace

import pytest

from wallride.drivers.api import MotorState
from wallride.runtime.control.perception.odometry import Odometry

STATE = MotorState(0.0, 1.0, 0.0, 0.0)


def driven(odometry, distance_m, steering_rad, steps=50, start_m=0.0):
    for step in range(steps + 1):
        state = replace(STATE, distance_m=start_m + distance_m * step / steps, steering_rad=steering_rad)
        odometry.update(state)
    return odometry.pose


def test_straight_ahead():
    pose = driven(Odometry(0.33), 5.0, 0.0)
    assert (pose.x_m, pose.y_m, pose.yaw_rad) == (pytest.approx(5.0), 0, 0)


@pytest.mark.parametrize("steering_rad", [0.34, -0.34])
def test_a_full_circle_ends_where_it_began(steering_rad):
    radius_m = 0.33 / math.tan(0.34)
    pose = driven(Odometry(0.33), math.tau * radius_m, steering_rad)
    assert math.hypot(pose.x_m, pose.y_m) < 1e-9


def test_left_is_positive():
    radius_m = 0.33 / math.tan(0.34)
    pose = driven(Odometry(0.33), math.pi / 2 * radius_m, 0.34)
    assert (pose.x_m, pose.y_m) == (pytest.approx(radius_m, rel=1e-3), pytest.approx(radius_m, rel=1e-3))
    assert pose.yaw_rad == pytest.approx(math.pi / 2)


def test_reverse_drives_back():
    odometry = Odometry(0.33)
    driven(odometry, 2.0, 0.2)
    pose = driven(odometry, -2.0, 0.2, start_m=2.0)
    assert math.hypot(pose.x_m, pose.y_m) < 1e-9


def test_nothing_is_integrated_across_a_lost_link():
    odometry = Odometry(0.33)
    odometry.update(STATE)
    odometry.update(None)
    assert odometry.update(replace(STATE, distance_m=100.0)).x_m == 0.0
