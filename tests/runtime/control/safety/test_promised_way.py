"""What a car can drive of a promised path."""

import numpy as np
import pytest

from tests.runtime.control.safety.promise_scenes import way
from wallride.runtime.control.safety.promised_way import (
    CANNOT_STEER,
    MAX_GAP_M,
    NO_GRIP,
    NOT_HERE,
    TOO_SHORT,
    PromisedWay,
    Roadworthy,
    Unbelievable,
    way_of,
)

CAR = Roadworthy(3.0, 0.163, 0.05, 3.2, 0.33, 0.34, 7.85, 0.023, 4.0)


def made(places_m, speed_mps=3.0, car=CAR, look_m=4.0):
    return way_of(places_m, np.full(places_m.size, speed_mps), car, look_m)


def test_a_path_becomes_poses_every_6_cm_and_goes_on_with_its_last_bend():
    places_m, _ = way(99.0, reach_m=3.0)
    found = made(places_m, look_m=4.2)
    assert isinstance(found, PromisedWay)
    assert found.promised_m == pytest.approx(3.0, abs=0.01)
    assert found.path.travel_m[-1] >= 4.2
    circle = np.abs(found.path.place_m - 2j)
    assert circle == pytest.approx(2.0, abs=0.02)
    assert found.path.curvature_per_m == pytest.approx(0.5, abs=0.02)
    assert np.abs(np.diff(found.path.place_m)) == pytest.approx(0.06, abs=0.002)


def test_the_nose_points_inward_by_the_slip():
    found = made(way(99.0)[0])
    assert isinstance(found, PromisedWay)
    assert np.angle(found.path.heading / found.course) == pytest.approx(9.0 * 0.5 * 0.023, abs=0.01)


def test_a_path_that_begins_beside_the_car_or_across_it_is_not_its_own():
    places_m, _ = way()
    assert made(places_m + 0.1j) == Unbelievable(NOT_HERE)
    assert made(places_m * np.exp(0.6j)) == Unbelievable(NOT_HERE)
    assert isinstance(made(places_m + 0.03j), PromisedWay)


def test_the_part_that_is_behind_the_car_is_left_out():
    places_m, _ = way(0.0, bend_per_m=0.001)
    found = made(places_m - 0.35, car=CAR._replace(wheel_rad=0.0))
    assert isinstance(found, PromisedWay)
    assert found.promised_m == pytest.approx(9.0 - 0.35, abs=0.01)


def test_a_path_behind_the_car_is_too_short():
    assert made(way(0.0, bend_per_m=0.001, reach_m=1.0)[0] - 0.95) == Unbelievable(TOO_SHORT)


def test_no_wheels_steer_more_than_they_can_or_turn_faster_than_the_servo():
    assert made(way(99.0, bend_per_m=1.4)[0], speed_mps=1.0, car=CAR._replace(speed_mps=1.0)) == Unbelievable(
        CANNOT_STEER
    )
    assert made(way(99.0, bend_per_m=-0.3)[0]) == Unbelievable(CANNOT_STEER)
    slow = CAR._replace(speed_mps=0.5)
    assert isinstance(made(way(99.0, bend_per_m=1.05)[0], speed_mps=0.5, car=slow), PromisedWay)
    assert made(way(99.0, bend_per_m=1.05)[0], speed_mps=0.5, car=slow._replace(rate_radps=0.05)) == Unbelievable(
        CANNOT_STEER
    )


def test_wheels_that_correct_an_error_may_lead_back_to_the_path():
    straight_m, _ = way(0.0, bend_per_m=0.001)
    fast = CAR._replace(speed_mps=5.8)
    assert isinstance(made(straight_m, 5.8, fast._replace(wheel_rad=0.15)), PromisedWay)
    assert made(straight_m, 5.8, fast._replace(wheel_rad=0.22)) == Unbelievable(CANNOT_STEER)


def test_no_tyres_hold_a_bend_that_is_too_fast():
    fast = CAR._replace(speed_mps=5.0)
    assert made(way(99.0)[0], speed_mps=5.0, car=fast) == Unbelievable(NO_GRIP)


def test_a_promise_of_slower_speeds_is_not_believed_beyond_what_the_motor_brakes():
    places_m, _ = way(0.0, bend_per_m=0.001)
    found = made(places_m, speed_mps=0.1, car=CAR._replace(wheel_rad=0.0))
    assert isinstance(found, PromisedWay)
    braked = np.sqrt(np.maximum(9.0 - 2 * 5.0 * np.maximum(found.path.travel_m - 0.15, 0.0), 0.0))
    assert found.speed_mps == pytest.approx(np.maximum(braked, 0.1), abs=1e-9)


def test_a_promise_of_faster_speeds_is_not_believed_beyond_what_the_motor_gains():
    found = made(way(0.0, bend_per_m=0.001)[0], speed_mps=20.0, car=CAR._replace(wheel_rad=0.0))
    assert isinstance(found, PromisedWay)
    assert found.speed_mps[0] < 3.5


def test_points_may_be_near_or_far_apart():
    places_m, _ = way(99.0)
    fine = np.interp(np.arange(0, 80, 0.2), np.arange(places_m.size), places_m.real) + 1j * np.interp(
        np.arange(0, 80, 0.2), np.arange(places_m.size), places_m.imag
    )
    for points_m in (places_m[::4], fine):
        assert np.abs(np.diff(points_m)).max() < MAX_GAP_M
        found = made(points_m)
        assert isinstance(found, PromisedWay)
        assert found.path.curvature_per_m == pytest.approx(0.5, abs=0.05)
