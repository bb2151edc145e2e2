"""How fast a way may be driven: bends, the brake for them, and the end of sight."""

import numpy as np
import pytest

from wallride.runtime.control.corridor_following.way_speed import HIDDEN_PER_M, WayGrip, way_speeds_mps
from wallride.runtime.control.safety.swept_settings import SweptSettings
from wallride.runtime.control.vehicle import GRAVITY_MPS2

GRIP = WayGrip(4.0, 3.0, 6.0)
STEP_M = 0.2
LAST_MPS = (GRIP.lateral_mps2 / HIDDEN_PER_M) ** 0.5


def test_a_long_straight_way_is_driven_at_the_highest_speed():
    speeds = way_speeds_mps(np.zeros(60), STEP_M, 60, GRIP)
    assert speeds[0] == 6.0
    assert speeds[-1] == pytest.approx(LAST_MPS)


def test_the_brake_is_enough_for_the_end_of_sight_and_nothing_counts_beyond_it():
    speeds = np.array(way_speeds_mps(np.zeros(60), STEP_M, 20, GRIP))
    assert speeds[20:] == pytest.approx(np.full(40, LAST_MPS))
    slows_mps2 = (speeds[:-1] ** 2 - speeds[1:] ** 2) / (2 * STEP_M)
    assert slows_mps2.max() == pytest.approx(3.0)
    assert speeds[0] == pytest.approx((LAST_MPS**2 + 2 * 3.0 * STEP_M * 19) ** 0.5), "0.2 m to spare"


def test_a_bend_is_driven_by_its_grip_and_braked_for_with_what_it_leaves():
    curvature = np.zeros(60)
    curvature[20:30] = 1.0
    speeds = np.array(way_speeds_mps(curvature, STEP_M, 60, GRIP))
    assert speeds[20:29] == pytest.approx(np.full(9, 2.0))
    assert speeds[19] < (4.0 + 2 * 3.0 * STEP_M) ** 0.5 + 1e-9
    assert speeds[10] == pytest.approx((4.0 + 2 * 3.0 * STEP_M * 10) ** 0.5, rel=0.02)


def test_a_way_is_braked_for_earlier_than_safety_brakes():
    grip = WayGrip.of(0.8, 6.0)
    assert grip.brake_mps2 < 0.9 * SweptSettings().graded_share * 0.8 * GRAVITY_MPS2


def test_less_grip_is_slower():
    high, low = WayGrip.of(0.8, 6.0), WayGrip.of(0.5, 6.0)
    bend = np.full(30, 0.8)
    assert way_speeds_mps(bend, STEP_M, 30, low)[0] == pytest.approx(
        way_speeds_mps(bend, STEP_M, 30, high)[0] * (0.5 / 0.8) ** 0.5
    )
