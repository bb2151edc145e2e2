"""The swept safety: darkness, a covered lidar, and driving backward."""

import math

import numpy as np
import pytest

from tests.runtime.control.safety.swept_scenes import FRONT_M, Car, judge, wall_at, world
from tests.runtime.control.scans import CAR, see
from tests.runtime.in_earnest import judged
from wallride.runtime.control.perception.visibility.no_return_regions import find_dark_regions
from wallride.sim.virtual.devices import BEAMS


def darkened(left_m, right_m, half=60):
    return np.repeat([right_m, math.nan, left_m], [540 - half, 2 * half, BEAMS - 540 - half])


def test_an_enclosed_dark_patch_limits_the_speed():
    verdict = judge(darkened(2.0, 2.0), 3.0, speed_mps=3.0)
    assert (verdict.forward_mps, verdict.reason) == (1.0, "no information ahead")


@pytest.mark.parametrize(("left_m", "right_m"), [(9.0, 9.0), (2.0, 9.0), (9.0, 2.0)])
def test_the_dark_end_of_a_corridor_or_a_corner_does_not(left_m, right_m):
    car = Car()
    for half in range(1, 60, 5):  # it comes into view
        ranges_m = darkened(left_m, right_m, half=half)
        ranges_m[480:600] = np.where(np.isfinite(ranges_m[480:600]), 28.0, np.nan)
        car.look(ranges_m, speed_mps=3.0)
    assessment = car.look(darkened(left_m, right_m), speed_mps=3.0)
    assert judged(assessment, 3.0, 0.0).forward_mps == math.inf


def test_a_third_of_the_window_must_be_dark():
    for dark_beams, dark in ((20, False), (30, True)):
        ranges_m = np.full(BEAMS, 2.0)
        ranges_m[540 : 540 + dark_beams] = np.nan
        assert find_dark_regions(see(ranges_m), 0.0, 3.0) == dark


def test_where_the_lidar_does_not_look_nothing_is_dark():
    ranges_m = np.full(BEAMS, 2.0)
    ranges_m[300:700] = np.nan
    dark = [find_dark_regions(see(ranges_m), toward_rad, 3.0) for toward_rad in (-3.0, 0.0, 3.0)]
    assert dark == [False, True, False]


def test_a_covered_lidar_stops_the_car():
    verdict = judge(np.full(BEAMS, math.nan), 1.0)
    assert (verdict.forward_mps, verdict.reason) == (0.0, "the lidar sees almost nothing: uncover or clean it")


def test_backs_slowly_out_of_anything():
    verdict = judge(world(wall_at(FRONT_M + 0.02)), -1.0)
    assert (verdict.reverse_mps, verdict.forward_mps) == (0.5, math.inf)


def test_what_is_seen_behind_stops_it():
    behind = world((-0.2, -0.6, -0.2, -0.36), (-0.2, 0.36, -0.2, 0.6))
    assert judge(behind, -0.5).reverse_mps == 0.5
    close = Car().look(world((-0.15, 0.19, 0.3, 0.19)))
    assert judged(close, -0.5, -0.34).reverse_mps == 0.0  # the nose swings into the wall on the left


def test_a_corner_that_swings_to_a_wall_beside_keeps_half_of_the_room():
    """Within the margin beside a wall it backs straight; a car on a floor of 0.5 touched one with its rear corner."""
    car, beside = Car(), world((-4.0, CAR.half_width_m + 0.015, 4.0, CAR.half_width_m + 0.015))
    for _ in range(24):
        car.look(beside, speed_mps=1.0, moved_m=0.05)
    standing = car.look(beside)
    assert judged(standing, -0.4, 0.0).reverse_mps == 0.5
    assert judged(standing, -0.4, -0.34).reverse_mps == 0.0  # the nose
    assert judged(standing, -0.4, 0.34).reverse_mps == 0.0  # the tail, where only the memory sees
    assert judged(standing, -0.4, 0.34).reason == "wall behind"


def test_half_a_metre_without_seeing_and_no_more():
    car = Car()
    for _ in range(9):
        assessment = car.look(world(), speed_mps=-0.4, moved_m=-0.05)
        assert judged(assessment, -0.5, 0.0).reverse_mps > 0
    car.look(world(), speed_mps=-0.4, moved_m=-0.05)
    assessment = car.look(world(), speed_mps=0.0, moved_m=-0.05)
    assert judged(assessment, -0.5, 0.0).reverse_mps == 0.0
    assert judged(assessment, -0.5, 0.0).reason == "backed far enough without seeing"
    assessment = car.look(world(), speed_mps=0.4, moved_m=0.3)
    assert judged(assessment, -0.5, 0.0).reverse_mps > 0


def test_what_was_passed_is_remembered_behind():
    """A box that was beside the car while it drove by is where its tail goes when it backs to the left."""
    car = Car()
    for step in range(12):
        x_m = 0.6 - 0.1 * step
        car.look(world((x_m, 0.25, x_m + 0.25, 0.25)), speed_mps=1.0, moved_m=0.1)
    assessment = car.look(world(), speed_mps=0.0)
    assert judged(assessment, -0.5, 0.34).measure < 0.25
    assert judged(assessment, -0.5, -0.34).measure == math.inf
    assert judged(Car().look(world()), -0.5, 0.34).measure == math.inf
