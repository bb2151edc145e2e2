"""A car by servo pulses in virtual time: the planted errors of its settings become the right ones."""

from dataclasses import replace

import numpy as np
import pytest

from tests.wallride.pulses.pulsed_car import RIGHT, TRUE, VirtualBench, calibrated, driven, in_effect, stands_in_neutral
from wallride.clients.calibration import settings_file
from wallride.clients.calibration.command import table
from wallride.clients.calibration.pulse_steps import pulse_steps
from wallride.clients.calibration.ways import CalibrationError
from wallride.runtime.calibration import proposals


def test_a_calibration_ends_with_the_settings_of_the_car(car_toml):
    measured, so_far = calibrated(VirtualBench(seed=5), car_toml)
    settings_file.write(car_toml, [one for one in measured if one.changes], "2026-11-27")
    new = in_effect(car_toml)
    assert new[proposals.NEUTRAL] == pytest.approx(1530, abs=3)
    assert (new[proposals.FORWARD], new[proposals.REVERSE]) == pytest.approx((1575, 1485), abs=4)
    assert new[proposals.THROTTLE] == pytest.approx(40.0, rel=0.06)
    assert new[proposals.PULSE_CENTER] == pytest.approx(1470, abs=3)
    assert new[proposals.PULSE_GAIN] == 1150.0, "left was right; the gain is the ruler's"
    assert new[proposals.WHEELBASE] == pytest.approx(0.33 * 1000 / 1150, rel=0.02)
    assert new["motor.steering_min_us"] == pytest.approx(1230, abs=6)
    assert new["motor.steering_max_us"] == pytest.approx(1760, abs=6)
    assert new[proposals.LIDAR_X] == pytest.approx(0.29, abs=0.01)
    assert new[proposals.LIDAR_YAW] == pytest.approx(np.radians(2.0), abs=0.005)
    assert new[proposals.GRIP] == pytest.approx((30 * 0.17 + 0.4) / 9.81, abs=0.02), "its ESC's brake and the drag"
    shown = table(measured)
    assert "motor.neutral_us           1500    1530" in shown
    assert "by tape" in shown, "what such a car does not tell is said"
    assert "brakes and does not drive backward" in shown
    assert any(note.startswith("throttle: neutral from 148") for note in so_far.notes)


def test_with_a_ruler_the_gain_of_the_servo_is_measured(car_toml):
    bench = VirtualBench(replace(RIGHT, shortest_us=0.0, longest_us=3000.0), seed=2)
    measured, _ = calibrated(bench, car_toml, ["steering"], **{proposals.WHEELBASE: 0.33})
    found = {one.name: one for one in measured}
    assert found[proposals.PULSE_GAIN].new == pytest.approx(1000, rel=0.02)
    assert not found["motor.steering_min_us"].changes, "the linkage goes as far as it is wanted"
    assert not found["motor.steering_max_us"].changes


def test_a_brake_pulse_that_drives_backward_is_found_although_a_weak_one_brakes(car_toml):
    bench = VirtualBench(TRUE, seed=3)
    _, so_far = calibrated(bench, car_toml, ["speed", "steering"])

    def reverses_by_a_long_pulse(bench):
        if bench.written[-1] < 1300.0:
            bench.esc._may_reverse = True

    bench.before_scan = reverses_by_a_long_pulse
    braking = pulse_steps(frozenset({"brake"}))[-1]
    with pytest.raises(CalibrationError, match="backward by its brake pulse"):
        driven(braking, bench, car_toml, so_far)
    assert stands_in_neutral(bench)


def test_a_brake_that_hardly_brakes_is_said(car_toml):
    measured, so_far = calibrated(VirtualBench(replace(RIGHT, brake_a=2.5), seed=6), car_toml, ["brake"])
    assert so_far.deceleration_mps2.value == pytest.approx(0.4 + 2.5 * 0.17 * 300 / 330, rel=0.15)
    assert "hardly brakes" in next(one.words for one in measured if one.name == proposals.BRAKE_PULSE)
