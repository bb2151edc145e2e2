"""What the wheels say of the lidar's motion during a turn."""

import math

import pytest

from wallride.drivers.api import MotorState
from wallride.drivers.turning.grid import STILL
from wallride.runtime.control.vehicle import CarSettings
from wallride.runtime.lidars import TurnMotion

CAR = CarSettings(wheelbase_m=0.33, steering_rate_radps=2.0, max_steering_rad=0.34, lidar_x_m=0.2, lidar_y_m=0.1)


def report(stamp_s, steering_rad=0.0, speed_mps=1.0):
    return MotorState(stamp_s=stamp_s, speed_mps=speed_mps, distance_m=0.0, steering_rad=steering_rad)


def asked(*reports):
    """Return the motion of each turn, one report a turn."""
    waiting = iter(reports)
    motion = TurnMotion(CAR, lambda: next(waiting))
    return [motion() for _ in reports]


def steering_of(motion):
    return math.atan(motion.yaw_rate_radps * CAR.wheelbase_m / 1.0)


def test_a_command_turns_the_car_half_in_the_turn_in_which_the_servo_gets_there():
    told_rad = [steering_of(one) for one in asked(report(0.0), report(0.2, 0.3), report(0.4, 0.3))]
    assert told_rad == pytest.approx([0.0, 0.15, 0.3])


def test_the_servo_turns_no_faster_than_it_can():
    told_rad = [steering_of(one) for one in asked(report(0.0), report(0.05, 0.3), report(0.1, 0.3))]
    assert told_rad == pytest.approx([0.0, 0.05, 0.15])


def test_no_command_turns_the_wheels_beyond_their_end():
    assert steering_of(asked(report(0.0, 0.9))[0]) == pytest.approx(CAR.max_steering_rad)


def test_the_lidar_turns_with_the_car_it_is_mounted_on():
    motion = asked(report(0.0, 0.2))[0]
    assert motion.x_mps == pytest.approx(1.0 - motion.yaw_rate_radps * CAR.lidar_y_m)
    assert motion.y_mps == pytest.approx(motion.yaw_rate_radps * CAR.lidar_x_m)


@pytest.mark.parametrize("gap", [None, report(0.2, math.nan), report(0.2, speed_mps=math.inf)])
def test_without_a_report_no_motion_is_taken_out_and_the_next_one_counts_as_it_is(gap):
    motions = asked(report(0.0), gap, report(0.4, 0.3))
    assert motions[1] == STILL
    assert steering_of(motions[2]) == pytest.approx(0.3)


def test_the_same_report_asked_twice_is_its_own_angle():
    assert steering_of(asked(report(0.0), report(0.0, 0.2))[1]) == pytest.approx(0.2)
