"""Settings from estimates: which way each error is corrected."""

import pytest

from wallride.runtime.calibration import proposals
from wallride.runtime.calibration.arc_fit import ArcFit
from wallride.runtime.calibration.delays import DelayFit
from wallride.runtime.calibration.responses import Estimate, unidentified

NOW = {
    proposals.SPEED_GAIN: 4614.0, proposals.WHEELBASE: 0.25, proposals.SERVO_GAIN: -1.2, proposals.SERVO_OFFSET: 0.53,
    proposals.LIDAR_X: 0.27, proposals.LIDAR_Y: 0.0, proposals.LIDAR_YAW: 0.01, proposals.LATENCY: 0.03,
    proposals.ACTUATION: 0.05, proposals.GRIP: 0.8,
}  # fmt: skip


def sure(value):
    return Estimate(value, value - 0.001, value + 0.001)


def fit(speed=1.0, steering=1.0, wheelbase=0.33, offset=0.0):
    return ArcFit(
        sure(speed), sure(steering), sure(wheelbase), sure(offset), sure(0.29), sure(0.02), sure(0.03), 1.0, 12
    )


def proposed(found, *, ruler=False):
    return {one.name: one.new for one in proposals.of_arcs(found, NOW, ruler=ruler)}


def test_a_car_that_goes_less_far_than_it_reports_gets_a_higher_gain():
    assert proposed(fit(speed=0.8))[proposals.SPEED_GAIN] == pytest.approx(4614 / 0.8, rel=1e-4)


def test_wheels_that_stand_to_the_left_move_the_middle_of_the_servo():
    assert proposed(fit(offset=0.025))[proposals.SERVO_OFFSET] == pytest.approx(0.53 + 0.025 * 1.2)


def test_with_a_ruler_the_servo_is_wrong_and_not_the_wheelbase():
    found = proposed(fit(steering=0.8), ruler=True)
    assert found[proposals.SERVO_GAIN] == pytest.approx(-1.5)
    assert proposals.WHEELBASE not in found


def test_a_reversed_servo_changes_its_sign():
    assert proposed(fit(steering=-1.0, wheelbase=-0.33))[proposals.SERVO_GAIN] == 1.2


def test_a_motor_that_runs_backward_is_no_setting():
    assert set(proposed(fit(speed=-1.0)).values()) == {None}


def test_the_lidar_turns_from_where_it_was():
    found = proposed(fit())
    assert (found[proposals.LIDAR_X], found[proposals.LIDAR_Y]) == (0.29, 0.02)
    assert found[proposals.LIDAR_YAW] == pytest.approx(0.04)


def test_delays_become_latency_and_actuation():
    servo, motor = DelayFit(sure(0.06), sure(3.0)), DelayFit(unidentified("it stood"), sure(3.0))
    found = {one.name: one for one in proposals.of_delays(servo, motor, NOW, 0.025)}
    assert found[proposals.LATENCY].new == pytest.approx(0.072, abs=0.0006)
    assert found[proposals.ACTUATION].new is None
    assert "it stood" in found[proposals.ACTUATION].words


@pytest.mark.parametrize(("low", "new"), [(9.0, 0.8), (5.0, 0.51)])
def test_the_assumed_grip_is_only_ever_lowered(low, new):
    (found,) = proposals.of_braking(Estimate(low + 0.2, low, low + 0.4), NOW)
    assert found.new == new
