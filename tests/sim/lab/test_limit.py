"""The physical limit beside the values that another simulator's search found."""

import math
from functools import partial

import numpy as np
import pytest

from benchmarks.lab.limits import MUS, SPEEDS_MPS, driven_mean_error_m
from wallride.sim.car.vehicle import VehicleSettings
from wallride.sim.lab.courses.walls import ALL_COURSES, COURSES, case_of, limit_task
from wallride.sim.lab.limit import SCAN_S, SteeringProblem, Task, _scan_weights, best_steering, least_mean_error_m
from wallride.sim.lab.limits import FILE, key, limit_m
from wallride.sim.world.pose import Pose

REFERENCE_M = {
    "t1": {1.0: 0.091, 2.0: 0.118, 3.0: 0.174},
    "t2": {1.0: 0.038, 2.0: 0.038, 3.0: 0.050, 4.0: 0.049},
    "t3": {1.0: 0.035, 2.0: 0.040, 3.0: 0.047, 4.0: 0.052},
    "t4": {1.0: 0.091, 2.0: 0.119, 3.0: 0.174, 4.0: 0.257},
    "t5": {1.0: 0.021, 2.0: 0.022, 3.0: 0.034, 4.0: 0.074},
}
"""Limits that another simulator's search found, mu 0.8 (design notes, section 3)."""
WALL = ((-5.0, 1.0, 55.0, 1.0),)


def task(distance_m=1.0, toward_rad=0.0, speed_mps=1.0, **changes):
    return Task(WALL, Pose(0.0, 1.0 - distance_m, toward_rad), speed_mps, **{"way_m": 6.0, **changes})


@pytest.mark.parametrize(("name", "speed_mps"), [(name, speed) for name in ("t1", "t4") for speed in REFERENCE_M[name]])
def test_the_long_approaches_agree_with_the_reference(name, speed_mps):
    assert limit_m(name, speed_mps, 0.8) == pytest.approx(REFERENCE_M[name][speed_mps], rel=0.1)


@pytest.mark.parametrize(
    ("name", "speed_mps"), [(name, speed) for name in ("t2", "t3", "t5") for speed in REFERENCE_M[name]]
)
def test_elsewhere_it_is_no_more_than_a_tenth_above_the_reference(name, speed_mps):
    reference_m = REFERENCE_M[name][speed_mps]
    assert 0.6 * reference_m < limit_m(name, speed_mps, 0.8) < 1.1 * reference_m


def test_mirrored_starts_have_the_same_limit():
    for speed_mps in SPEEDS_MPS[:3]:
        assert limit_m("t1", speed_mps, 0.8) == pytest.approx(limit_m("t4", speed_mps, 0.8), abs=0.002)
        assert limit_m("t2", speed_mps, 0.8) == pytest.approx(limit_m("t3", speed_mps, 0.8), abs=0.002)


def test_the_file_is_what_the_search_finds():
    found_m = least_mean_error_m(limit_task("t2", 3.0, 0.5))
    assert found_m == pytest.approx(limit_m("t2", 3.0, 0.5), abs=2e-4)


def test_the_whole_vehicle_comes_near_the_constant_speed_limit():
    short = task(1.3, 0.0, 4.0, way_m=3.0)
    assert least_mean_error_m(short) == pytest.approx(driven_mean_error_m(short), rel=0.05)


def test_nothing_to_do_costs_nothing_and_a_worse_start_costs_more():
    assert least_mean_error_m(task()) == 0.0
    assert least_mean_error_m(task(0.8, way_m=3.0)) < least_mean_error_m(task(0.6, way_m=3.0))


def test_what_counts_is_the_error_at_the_scans_and_the_first_one_is_at_the_start():
    weights = _scan_weights(60, 0.1)
    assert weights.sum() == pytest.approx(1.0)
    assert weights[0] == pytest.approx((1 + 0.75 + 0.5 + 0.25) / 240)
    assert weights[1:-1] == pytest.approx(4 / 240)
    away = task(0.8, -0.1)  # nothing is done about it: 0.2 m less 0.1 per metre of way
    errors_m = np.abs(0.2 - np.sin(0.1) * np.arange(0.0, 6.0, SCAN_S))
    assert SteeringProblem(away).cost(SteeringProblem(away).straight()) == pytest.approx(errors_m.mean(), abs=5e-4)


def test_less_grip_a_slower_servo_and_a_delay_cost():
    turn = partial(task, 1.4, speed_mps=4.0, way_m=3.0)
    plain_m = least_mean_error_m(turn())
    for worse in (
        {"vehicle": VehicleSettings(grip_mu=0.4)},
        {"vehicle": VehicleSettings(steering_rate_radps=0.5)},
        {"delay_s": 0.2},
    ):
        assert least_mean_error_m(turn(**worse)) > 1.01 * plain_m


def test_the_steering_found_keeps_stop_and_rate():
    hard = task(1.5, -0.35, 2.0)
    steering_rad = np.array([0.0, *best_steering(hard)[1]])
    assert np.abs(steering_rad).max() <= 0.34 + 1e-6
    assert np.abs(np.diff(steering_rad)).max() <= 3.2 * 0.1 / 2.0 + 1e-6
    assert np.abs(steering_rad).max() > 0.3  # it is a hard task: it uses what it has


def test_no_way_without_contact_is_no_limit():
    assert math.isnan(least_mean_error_m(task(0.4, 0.6, 4.0)))


def test_every_standard_cell_is_in_the_file():
    text = FILE.read_text()
    missing = [key(n, v, mu) for n in COURSES for v in SPEEDS_MPS for mu in MUS if f'"{key(n, v, mu)}"' not in text]
    assert not missing


def test_variants_share_the_clean_limit():
    assert limit_m("t1 dirty", 1.0, 0.8) == limit_m("t1 rough", 1.0, 0.8) == limit_m("t1", 1.0, 0.8)


@pytest.mark.parametrize("side", ["left", "right"])
@pytest.mark.parametrize("scenario", ALL_COURSES)
def test_every_course_starts_free_and_beside_its_wall(scenario, side):
    case = case_of(scenario, 1.0, 0.8, side, 0)
    assert case.start is not None
    assert case.world.clearance(case.start) > 0.1
    assert (case.truth or case.world).wall_distance_m(case.start, side) < 1.6
