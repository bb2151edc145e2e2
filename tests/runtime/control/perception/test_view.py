"""What counts as a thing, and what is dirt, the car itself, noise or nothing."""

import math

import numpy as np
import pytest

from tests.runtime.control.scans import BEARING_RAD, CAR, MIDDLE, scan_of, see
from wallride.runtime.control.perception.view import ViewCache, supported, thin_dirt, trails
from wallride.sim.virtual.devices import BEAMS, STEP_RAD


def room(range_m=5.0):
    return np.full(BEAMS, range_m)


def test_points_are_in_base_link_ahead_of_the_rear_axle():
    view = see(room(2.0))
    assert (view.x_m[MIDDLE], view.y_m[MIDDLE]) == pytest.approx((2.27, 0.0), abs=1e-6)
    left = MIDDLE + 360
    assert (view.x_m[left], view.y_m[left]) == pytest.approx((0.27, 2.0), abs=1e-6)
    assert view.solid.all()


@pytest.mark.parametrize("nothing", [math.nan, math.inf, -math.inf, 0.0, -1.0])
def test_nothing_is_no_information_and_no_thing(nothing):
    ranges_m = room()
    ranges_m[100] = nothing
    view = see(ranges_m)
    assert view.no_echo[100]
    assert np.count_nonzero(view.no_echo) == 1
    assert not view.solid[100]
    assert math.isnan(view.x_m[100])
    assert math.isnan(view.ranges_m[100])


@pytest.mark.parametrize(("together", "seen"), [(1, False), (2, False), (3, True), (4, True)])
def test_a_thing_needs_three_beams(together, seen):
    ranges_m = room()
    ranges_m[500 : 500 + together] = 2.0
    assert see(ranges_m).solid[500] == seen


def test_neighbours_up_to_15_cm_apart_support_each_other():
    assert supported(np.array([2.0, 2.14, 2.0, 2.14])).all()
    assert not supported(np.array([2.0, 2.16, 2.32, 2.48])).any()


def test_what_lies_on_the_car_is_the_car():
    ranges_m = room()
    ranges_m[:30] = 0.1  # right rear: a wheel
    ranges_m[MIDDLE - 20 : MIDDLE + 21] = 0.14  # the bumper is 0.15 m ahead of the lidar
    view = see(ranges_m)
    assert view.own[:30].all()
    assert view.own[MIDDLE]
    assert not view.solid[:30].any()
    assert not view.solid[MIDDLE]
    ranges_m[MIDDLE - 20 : MIDDLE + 21] = 0.2
    assert see(ranges_m).solid[MIDDLE]


CABLE = range(7, 19)
TRAIL_M = [0.207, 0.262, 0.307, 0.408, 0.437, 0.555]
"""A RACECAR's cable at 7 cm, and what its edge made of the wall behind (`t14_safety_gap3s`, scan 74)."""


def cable(ranges_m):
    ranges_m[CABLE.start : CABLE.stop] = 0.07
    return ranges_m


def test_the_trail_from_the_cars_own_part_to_the_wall_is_no_thing():
    ranges_m = cable(room(0.6))
    ranges_m[CABLE.stop : CABLE.stop + 6] = TRAIL_M
    view = see(ranges_m)
    trail = slice(CABLE.start, CABLE.stop + 6)
    assert not view.solid[trail].any()
    assert view.solid[CABLE.stop + 8 :].all()
    assert not see(ranges_m[::-1]).solid[::-1][trail].any(), "on the left as well"


def test_without_the_cars_own_part_a_row_away_from_the_lidar_is_a_thing():
    ranges_m = room(0.6)
    ranges_m[CABLE.stop : CABLE.stop + 6] = TRAIL_M
    assert see(ranges_m).solid[CABLE.stop : CABLE.stop + 6].all()


def test_before_the_cars_shoulders_nothing_is_a_trail():
    ranges_m = room(0.6)
    ranges_m[200:212] = 0.07
    ranges_m[212:218] = TRAIL_M
    assert see(ranges_m).solid[213:218].any()


@pytest.mark.parametrize("aside_m", [0.17, 0.25, 0.4])
def test_a_wall_beside_the_cars_own_part_is_still_a_wall(aside_m):
    wall_m = np.where(BEARING_RAD < -0.5, aside_m / np.maximum(-np.sin(BEARING_RAD), 1e-3), 5.0)
    noisy_m = wall_m + np.random.default_rng(6).normal(0.0, 0.01, BEAMS)
    view = see(cable(noisy_m))
    assert np.count_nonzero(view.solid[CABLE.stop : CABLE.stop + 40]) >= 37
    rim = [CABLE.start - 1, CABLE.start - 2, CABLE.stop, CABLE.stop + 1]
    assert trails(cable(wall_m), np.array(CABLE)) == rim


def smudge(beams, range_m, at=300):
    ranges_m = room()
    ranges_m[at : at + beams] = range_m
    return ranges_m, at


def ignored(ranges_m):
    near = ranges_m < 0.6
    return set(thin_dirt(ranges_m, near, STEP_RAD).tolist())


@pytest.mark.parametrize(
    ("beams", "range_m", "is_dirt"),
    [(8, 0.3, True), (10, 0.3, False), (3, 0.61, False)],
    ids=["10.5 mm", "a pole of 13 mm", "far away"],
)
def test_a_near_thing_thinner_than_12_mm_is_dirt(beams, range_m, is_dirt):
    ranges_m, at = smudge(beams, range_m)
    assert np.flatnonzero(~see(ranges_m).solid).tolist() == (list(range(at, at + beams)) if is_dirt else [])


def test_dirt_stands_out_on_both_sides():
    ranges_m, at = smudge(8, 0.3)
    ranges_m[at + 8 :] = 0.41  # a wall only 11 cm behind it on the left
    assert not ignored(ranges_m)
    ranges_m[at + 8 :] = 0.43
    assert ignored(ranges_m) == set(range(at, at + 8))


def test_silence_beside_dirt_counts_as_far():
    ranges_m, at = smudge(8, 0.3)
    ranges_m[at + 8 : at + 20] = math.nan
    ranges_m[at - 12 : at] = math.nan
    assert ignored(ranges_m) == set(range(at, at + 8))


@pytest.mark.parametrize("at", [0, BEAMS - 8])
def test_at_an_end_of_the_fan_only_the_other_side_counts(at):
    ranges_m, at = smudge(8, 0.3, at)
    assert ignored(ranges_m) == set(range(at, at + 8))


def test_a_wild_beam_does_not_cut_a_pole_into_two_smudges():
    ranges_m, at = smudge(13, 0.3)
    ranges_m[at + 6] = 4.0
    assert not ignored(ranges_m)
    assert see(ranges_m).solid[at + 3]


def test_learnt_dirt_is_ignored_where_it_reads_near_and_only_there():
    eyes = ViewCache(CAR)
    ranges_m, at = smudge(30, 0.3)
    dirty = np.zeros(BEAMS, bool)
    dirty[at : at + 30] = True
    assert eyes.see(scan_of(ranges_m)).solid[at + 15]
    eyes.ignore(dirty)
    view = eyes.see(scan_of(ranges_m))
    assert not view.solid[at : at + 30].any()
    assert view.dirty is dirty
    ranges_m[at : at + 30] = 0.85
    assert not eyes.see(scan_of(ranges_m)).solid[at : at + 30].any()  # the rim of a smudge
    ranges_m[at : at + 30] = 0.95
    ranges_m[900:950] = 0.5
    assert eyes.see(scan_of(ranges_m)).solid[at + 15]
    ranges_m[at : at + 30] = 0.3
    eyes.ignore(None)
    assert eyes.see(scan_of(ranges_m)).solid[at + 15]


def test_one_scan_is_seen_once():
    eyes, scan = ViewCache(CAR), scan_of(room())
    assert eyes.see(scan) is eyes.see(scan)
    assert eyes.see(scan_of(room())) is not eyes.see(scan)
