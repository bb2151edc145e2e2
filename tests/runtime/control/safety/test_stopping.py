"""Stopping distances against the table of the control reference, and their inverse."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from wallride.runtime.control.perception.sliding_speed import SlidingSpeed
from wallride.runtime.control.safety.stopping import (
    brake_beside_turning_mps2,
    speed_to_stop_within_mps,
    stopping_distance_m,
)
from wallride.runtime.control.vehicle import GRAVITY_MPS2


@pytest.mark.parametrize(
    ("mu", "reaction_s", "expected_m"),
    [
        (0.5, 0.10, (0.202, 0.608, 1.217, 2.031)),
        (0.8, 0.05, (0.114, 0.355, 0.723, 1.219)),
        (1.0, 0.00, (0.051, 0.204, 0.459, 0.815)),
    ],
)
def test_stopping_distances_of_the_reference(mu, reaction_s, expected_m):
    for speed_mps, distance_m in zip((1, 2, 3, 4), expected_m, strict=True):
        assert stopping_distance_m(speed_mps, reaction_s, mu * GRAVITY_MPS2) == pytest.approx(distance_m, abs=1.1e-3)


@given(st.floats(0.01, 10), st.floats(0, 0.5), st.floats(0.5, 12))
def test_the_fastest_speed_just_stops(distance_m, reaction_s, brake_mps2):
    speed_mps = speed_to_stop_within_mps(distance_m, reaction_s, brake_mps2)
    assert stopping_distance_m(speed_mps, reaction_s, brake_mps2) == pytest.approx(distance_m, rel=1e-6)


@pytest.mark.parametrize("distance_m", [0.0, -0.1, -5.0])
def test_no_way_no_speed(distance_m):
    assert speed_to_stop_within_mps(distance_m, 0.1, 5.0) == 0.0


def test_braking_and_turning_share_the_grip():
    assert brake_beside_turning_mps2(2.0, 0.0, 8.0) == 8.0
    assert brake_beside_turning_mps2(2.0, -1.2, 8.0) == pytest.approx(6.4)  # 4.8 aside: 3-4-5
    assert brake_beside_turning_mps2(4.0, 0.5, 8.0) == 0.0
    assert brake_beside_turning_mps2(4.0, 0.9, 8.0) == 0.0  # more than there is


ROLLS_MPS2, SLIDES_MPS2 = GRAVITY_MPS2, 0.5 * GRAVITY_MPS2


def told(*reports):
    """Return the speed after reports of the wheels, one every 0.1 s from 0 s on."""
    speed = SlidingSpeed(ROLLS_MPS2, SLIDES_MPS2)
    for number, wheels_mps in enumerate(reports):
        speed.update(wheels_mps, 0.1 * number)
    return speed


def test_locked_wheels_do_not_stop_a_car_at_once():
    speed = SlidingSpeed(ROLLS_MPS2, SLIDES_MPS2)
    assert speed.update(3.0, 10.0) == 3.0
    assert speed.update(0.0, 10.1) == pytest.approx(3.0 - 0.4905)
    assert speed.slides
    assert speed.update(None, 10.2) == pytest.approx(3.0 - 2 * 0.4905)
    assert speed.update(2.5, 10.225) == 2.5
    assert speed.update(0.0, 11.3) == 0.0


def test_wheels_that_are_as_fast_as_the_car_roll_again():
    assert not told(3.0, 0.0, 2.5).slides


def test_a_car_that_rolls_is_believed_however_hard_it_brakes():
    speed = told(3.0)
    assert speed.update(3.0 - 0.95 * ROLLS_MPS2 * 0.1, 0.1) == pytest.approx(3.0 - 0.95 * 0.981)
    assert not speed.slides


def test_two_reports_between_two_scans_are_a_fall_of_twice_the_time():
    """A motor controller reports 50 times a second, and a lidar scans 40 times: 7 m/s2 is no slide."""
    speed = told(5.42)
    assert speed.update(5.14, 0.025, 0.04) == 5.14
    assert not speed.slides
    assert speed.update(4.0, 0.05, 0.04) > 5.0, "but locked wheels fall faster"
    assert speed.slides


def test_a_gap_in_the_reports_hides_no_slide():
    speed = told(3.0)
    speed.update(2.0, 0.025, 5.0)
    assert speed.slides


def test_wheels_that_come_back_slowly_are_not_believed_before_they_are_as_fast():
    speed = told(3.0, 0.2)
    assert speed.update(0.9, 0.2) == pytest.approx(3.0 - 0.2 * SLIDES_MPS2)  # they are dragged, not rolling
    assert speed.slides


def test_once_locked_the_wheels_have_to_be_as_fast_as_the_car():
    speed = told(3.0, 0.0)
    assert speed.update(1.8, 0.2) == pytest.approx(3.0 - 0.2 * SLIDES_MPS2)  # for rolling wheels a possible fall
    assert speed.slides


def test_locked_wheels_in_reverse():
    speed = told(-1.0)
    assert speed.update(0.0, 0.05) == pytest.approx(-1.0 + 0.24525)


def test_a_clock_that_stands_or_jumps_back_lowers_nothing():
    speed = SlidingSpeed(ROLLS_MPS2, SLIDES_MPS2)
    speed.update(2.0, 5.0)
    assert speed.update(0.0, 5.0) == 2.0
    assert speed.update(0.0, 4.0) == 2.0


def test_another_floor_while_sliding():
    speed = told(3.0, 0.0)
    speed.tune(ROLLS_MPS2, 1.0)
    assert speed.update(0.0, 0.2) == pytest.approx(3.0 - 0.4905 - 0.1)
