"""The path that is really driven, and what the outline meets on it."""

import math

import numpy as np
import pytest

from wallride.runtime.control.safety.footprint import Outline, PathMotion, arc, first_contact


def complexes(places):
    return np.asarray(places, np.complex128)


def test_three_points_are_a_thing_and_two_are_noise():
    outline = Outline(0.45, 0.13, 0.19)
    points = np.array([1.0, 1.0 + 0.01j, 1.0 - 0.01j])
    assert first_contact(path(1.0, 0.0), outline, points).travel_m == pytest.approx(0.55)
    assert first_contact(path(1.0, 0.0), outline, points[:2]).travel_m == math.inf


def path(speed_mps, steering_rad, wheel_rad=0.0, latency_s=0.1, direction=1.0, **more):
    motion = PathMotion(speed_mps, direction, wheel_rad, latency_s, 3.2, 0.33, **more)
    return arc(motion, steering_rad, 3.0)


def test_the_wheels_keep_their_angle_for_the_latency_and_then_slew():
    curvature = path(2.0, 0.34).curvature_per_m
    travel_s = path(2.0, 0.34).travel_m / 2.0
    assert (curvature[travel_s < 0.1] == 0).all()
    middle = int(np.argmin(abs(travel_s - 0.15)))
    assert math.atan(0.33 * curvature[middle]) == pytest.approx(3.2 * (travel_s[middle] - 0.1))
    assert curvature[-1] == pytest.approx(math.tan(0.34) / 0.33)


def test_the_path_is_a_circle_once_the_wheels_stand():
    there = path(1.0, 0.34, wheel_rad=0.34)
    radius_m = 0.33 / math.tan(0.34)
    assert abs(there.place_m - 1j * radius_m) == pytest.approx(radius_m, abs=2e-3)
    back = path(1.0, 0.34, wheel_rad=0.34, direction=-1.0)
    assert back.place_m[3].real < 0 < back.place_m[3].imag
    assert abs(back.place_m - 1j * radius_m) == pytest.approx(radius_m, abs=2e-3)


def test_a_car_drifts_outward_in_a_bend():
    true, drifting = path(3.0, 0.1, 0.1), path(3.0, 0.1, 0.1, slip_rad_per_mps2=0.2 / 9.0)
    curvature = math.tan(0.1) / 0.33
    metre = int(np.argmin(abs(true.travel_m - 1.0)))
    drift_m = drifting.place_m[metre].imag - true.place_m[metre].imag
    assert drift_m == pytest.approx(-0.2 * curvature * 1.0, abs=0.01)
    assert (drifting.heading == true.heading).all()


def test_a_car_that_gains_speed_is_carried_out_of_its_bend():
    holding = path(2.0, 0.34, 0.34, turning_mps2=4.0)
    gaining = path(2.0, 0.34, 0.34, turning_mps2=4.0, along_mps2=3.0, end_mps=4.0)
    assert holding.curvature_per_m == pytest.approx(1.0)
    assert gaining.curvature_per_m[0] == pytest.approx(4.0 / (4.0 + 2 * 3.0 * 0.06))
    assert gaining.curvature_per_m[-1] == pytest.approx(4.0 / 16.0)  # no faster than it wants to be
    braking = path(4.0, 0.34, 0.34, turning_mps2=4.0, along_mps2=-3.0)
    assert braking.curvature_per_m[0] == pytest.approx(4.0 / (16.0 - 2 * 3.0 * 0.06))
    assert braking.curvature_per_m[-1] == pytest.approx(math.tan(0.34) / 0.33)


def test_the_flank_is_told_from_the_nose():
    outline = Outline(0.45, 0.13, 0.19)
    rows = np.linspace(0.0, 0.3, 9)
    assert first_contact(path(1.0, 0.0), outline, complexes(0.6 + 1j * (rows / 5 + 0.1))).aside_m == pytest.approx(0.1)
    assert first_contact(path(1.0, 0.0), outline, complexes(0.6 + 1j * (rows - 0.15))).aside_m == 0.0
    assert first_contact(path(1.0, 0.0), outline, complexes(rows + 0.25j)).travel_m == math.inf
    # Backing with the wheels to the left swings the nose out to the right, its flank first.
    right = complexes(np.linspace(0.1, 0.3, 9) - 0.2j)
    assert first_contact(path(0.5, 0.34, wheel_rad=0.34, direction=-1.0), outline, right, -1.0).aside_m < -0.14


def test_points_beside_a_long_path_are_found_in_its_last_piece_too():
    outline = Outline(0.45, 0.13, 0.19)
    pole = complexes(np.array([2.9, 2.91, 2.92]) + 0.18j)
    assert first_contact(path(1.0, 0.0), outline, pole).travel_m == pytest.approx(2.9 - 0.45, abs=0.06)
    assert first_contact(path(1.0, 0.0), outline, complexes(pole + 0.03j)).travel_m == math.inf


def test_grip_limits_the_curvature():
    assert abs(path(4.0, 0.34, wheel_rad=0.34, turning_mps2=7.84).curvature_per_m).max() == pytest.approx(0.49)
