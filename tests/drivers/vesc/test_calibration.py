"""Speeds and angles to the VESC's units and back."""

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from wallride.drivers.vesc import codec
from wallride.drivers.vesc.calibration import Calibration
from wallride.drivers.vesc.settings import VescSettings

CALIBRATION = Calibration(VescSettings())


def test_one_metre_per_second_is_the_gain():
    assert CALIBRATION.speed_frame(1.0) == codec.frame(codec.set_erpm(4614))
    assert CALIBRATION.speed_frame(-0.5) == codec.frame(codec.set_erpm(-2307))
    assert CALIBRATION.speed_mps(-2307) == -0.5
    assert CALIBRATION.metres_per_step == pytest.approx(0.0021673, rel=1e-4)


def test_a_standing_motor_is_a_standing_car_whatever_the_offset():
    with_offset = Calibration(VescSettings(speed_to_erpm_offset=100.0))
    assert with_offset.speed_frame(1.0) == codec.frame(codec.set_erpm(4714))
    assert with_offset.speed_mps(4714) == 1.0
    assert with_offset.speed_mps(0) == 0.0


@pytest.mark.parametrize(
    ("steering_rad", "position"),
    [(0.0, 0.530), (0.1, 0.409), (-0.1, 0.652), (0.3135, 0.150), (-0.2634, 0.850), (1.0, 0.150), (-1.0, 0.850)],
)
def test_left_is_a_shorter_pulse_and_the_linkage_limits_are_kept(steering_rad, position):
    allowed_rad = CALIBRATION.allowed_steering_rad(steering_rad)
    assert CALIBRATION.servo_frame(allowed_rad) == codec.frame(codec.set_servo(position))


@given(st.floats(-100, 100))
def test_the_allowed_angle_is_the_wish_or_a_limit(steering_rad):
    allowed_rad = CALIBRATION.allowed_steering_rad(steering_rad)
    assert allowed_rad == steering_rad or allowed_rad == pytest.approx(
        0.31347 if steering_rad > 0 else -0.26337, abs=1e-4
    )
    assert abs(allowed_rad) <= abs(steering_rad)


@pytest.mark.parametrize("bad", [math.nan, math.inf, -math.inf])
def test_what_is_no_number_is_refused(bad):
    with pytest.raises(ValueError, match="not an angle"):
        CALIBRATION.allowed_steering_rad(bad)
    with pytest.raises(ValueError, match="cannot carry"):
        CALIBRATION.speed_frame(bad)


@pytest.mark.parametrize(
    ("speed_mps", "stop"), [(0.0, True), (0.199, True), (-0.199, True), (0.2, False), (-0.2, False)]
)
def test_a_speed_that_the_vesc_cannot_hold_is_a_stop(speed_mps, stop):
    assert CALIBRATION.is_stop(speed_mps) is stop


@pytest.mark.parametrize(
    ("brake_mps2", "current_a"),
    [(math.inf, 40.0), (math.nan, 40.0), (100.0, 40.0), (3.4, 20.0), (0.01, 1.0), (0.0, 1.0), (-5.0, 1.0)],
)
def test_a_stop_brakes_as_hard_as_allowed_and_never_lets_go(brake_mps2, current_a):
    calibration = Calibration(VescSettings(brake_current_a=40.0, brake_mps2_per_a=0.17))
    assert calibration.brake_frame(brake_mps2) == codec.frame(codec.set_brake_current(current_a))
