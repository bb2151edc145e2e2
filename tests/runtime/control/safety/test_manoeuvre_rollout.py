"""What the rollouts of an emergency foresee."""

import math
from itertools import pairwise

import numpy as np
import pytest

from tests.runtime.control.safety.manoeuvre_scenes import (
    GRIPS_MPS2,
    LOCK_RAD,
    box,
    outcomes_for,
    rolled,
    situation,
    start,
)
from tests.runtime.control.scans import CAR
from wallride.runtime.control.safety.emergency_manoeuvre import Manoeuvre
from wallride.runtime.control.safety.manoeuvre_rollout import STEP_S, distance_m, slide
from wallride.runtime.control.vehicle import GRAVITY_MPS2
from wallride.sim.car.vehicle import SpeedDemand, Vehicle, VehicleSettings
from wallride.sim.world.pose import Pose


@pytest.mark.parametrize("grip_mps2", GRIPS_MPS2)
@pytest.mark.parametrize("brake_mps2", [0.0, 1.2, 3.0, 4.5])
def test_braking_and_turning_share_one_grip(grip_mps2, brake_mps2):
    """Kamm's circle: at the limit the path bends by what the brake leaves, v r <= sqrt(G^2 - b^2)."""
    path = rolled(LOCK_RAD, brake_mps2, grip_mps2, speed_mps=4.0)
    turns_mps2 = [
        state.speed_mps * (later.course_rad - state.course_rad) / STEP_S
        for state, later in pairwise(path)
        if later.speed_mps > 1.5
    ]
    left_mps2 = math.sqrt(grip_mps2**2 - brake_mps2**2)
    assert max(turns_mps2) <= 1.02 * left_mps2
    assert max(turns_mps2) > 0.55 * left_mps2
    slowed_mps = path[5].speed_mps - path[30].speed_mps
    assert slowed_mps >= 0.99 * brake_mps2 * 25 * STEP_S


@pytest.mark.parametrize("grip_mps2", GRIPS_MPS2)
@pytest.mark.parametrize("speed_mps", [1.2, 1.5, 1.8])
def test_a_bend_at_full_lock_runs_as_wide_as_the_simulated_car(speed_mps, grip_mps2):
    """The front axle is softer than the rear one: with equal axles the bend was 2 to 6 % too tight."""
    vehicle = Vehicle(VehicleSettings(grip_mu=grip_mps2 / GRAVITY_MPS2))
    vehicle.place(Pose(0.0, 0.0, 0.0), speed_mps=speed_mps)
    for _ in range(150):
        vehicle.step(STEP_S, SpeedDemand(speed_mps), LOCK_RAD)
    state = rolled(LOCK_RAD, 0.0, grip_mps2, past_rad=np.full(30, LOCK_RAD), speed_mps=speed_mps)[10]
    assert state.ahead_mps == pytest.approx(vehicle.speed_mps, abs=0.05)
    assert state.yaw_radps / state.ahead_mps == pytest.approx(vehicle.yaw_rate_radps / vehicle.speed_mps, rel=0.017)


def test_a_brake_of_the_whole_grip_locks_the_wheels_straight_on():
    for brake_mps2 in (GRIPS_MPS2[1], 8.0, math.inf):
        path = rolled(LOCK_RAD, brake_mps2, GRIPS_MPS2[1])
        assert path[-1].middle_m.imag == 0.0
        stopped_m = path[-1].middle_m.real - CAR.wheelbase_m / 2
        assert stopped_m == pytest.approx(3.0 * 0.05 + 9.0 / (2 * GRIPS_MPS2[1]), abs=0.02)


def test_locked_wheels_go_on_along_the_course_and_the_car_turns_a_little_more():
    past_rad = np.full(30, 0.2)
    path = rolled(0.2, math.inf, past_rad=past_rad)
    begun = path[6]
    assert begun.yaw_radps > 1.0
    assert path[-1].course_rad == begun.course_rad
    assert begun.heading_rad < path[-1].heading_rad < begun.heading_rad + 0.4


def test_the_wheels_turn_as_fast_as_the_servo_and_not_before_the_latency():
    late, soon = (rolled(LOCK_RAD, 0.0, latency_s=latency_s) for latency_s in (0.2, 0.05))
    assert late[20].heading_rad == 0.0 < soon[20].heading_rad
    assert soon[7].yaw_radps < 0.5 * soon[16].yaw_radps


def test_the_brake_that_is_on_already_goes_on_for_the_latency():
    assert rolled(0.0, 0.0, braked_mps2=4.0)[5].speed_mps == pytest.approx(3.0 - 4.0 * 0.05)
    assert rolled(0.0, 0.0)[5].speed_mps == 3.0


def test_the_past_is_felt():
    """A car whose wheels have been turned for 0.1 s rotates already; one whose wheels turn now does not yet."""
    turned = rolled(0.0, 0.0, past_rad=np.concatenate([np.zeros(20), np.full(10, 0.3)]))
    assert turned[0].yaw_radps > 1.0
    assert rolled(0.0, 0.0)[0].yaw_radps == 0.0


@pytest.mark.parametrize("speed_mps", [0.5, 1.0, 2.0])
def test_a_slow_car_turns_on_the_circle_of_its_wheels(speed_mps):
    path = rolled(LOCK_RAD, 0.0, past_rad=np.full(30, LOCK_RAD), speed_mps=speed_mps)
    turned_rad = path[60].heading_rad - path[10].heading_rad
    way_m = sum(state.speed_mps for state in path[10:60]) * STEP_S
    assert turned_rad / way_m == pytest.approx(math.tan(LOCK_RAD) / CAR.wheelbase_m, rel=0.15)


@pytest.mark.parametrize("gap_m", [0.1, 0.3, 0.7, 2.0])
def test_a_slide_hits_with_what_the_floor_leaves_of_the_speed(gap_m):
    begins = rolled(0.0, math.inf)[0]
    impact_mps, room_m = slide(start(), begins, box(gap_m, 0.6), GRIPS_MPS2[0], 0.04)
    left = 9.0 - 2 * GRIPS_MPS2[0] * (gap_m - 0.04)
    assert impact_mps == pytest.approx(math.sqrt(max(0.0, left)))
    assert (room_m == 0.0) == (impact_mps > 0.0)
    assert slide(start(), begins, box(0.3, 0.3, 0.6), GRIPS_MPS2[0], 0.04)[0] == 0.0  # beside its way


def test_a_sliding_car_is_met_at_its_corner_where_it_slides_aslant():
    aslant = rolled(0.0, 0.0)[0]._replace(course_rad=-0.3)
    beside = box(0.2, 0.1, -0.3)
    assert slide(start(), aslant, beside, GRIPS_MPS2[0], 0.0)[0] > 1.5
    assert slide(start(), aslant._replace(course_rad=0.3), beside, GRIPS_MPS2[0], 0.0)[0] == 0.0


def test_the_distance_is_the_third_nearest_points_from_the_outline():
    here = rolled(0.0, 0.0)[0]
    points_m = np.array([0.72 + 0j, 0.62 + 0.1j, 0.55 - 0.1j, 0.5 + 0j])
    assert distance_m(start(), here, points_m) == pytest.approx(0.62 - CAR.front_m)
    assert distance_m(start(), here, points_m[:2]) == math.inf
    corner = np.full(3, CAR.front_m + 0.03 + 1j * (CAR.half_width_m + 0.04))
    assert distance_m(start(), here, corner) == pytest.approx(0.05)


def test_what_is_nearer_than_the_margin_already_is_no_contact_whatever_the_car_does():
    beside = np.linspace(-1.0, 3.0, 200) + 1j * (CAR.half_width_m + 0.03)
    assert outcomes_for(beside)[0].is_free
    toward = situation(beside).predict([Manoeuvre(LOCK_RAD, 0.0), Manoeuvre(-LOCK_RAD, 0.0)])
    assert not toward[0].is_free
    assert toward[1].is_free
