"""What keeps returning from the same place is there, however thin; what does not is noise."""

import math
from dataclasses import replace

import numpy as np
import pytest

from tests.runtime.control import scans
from tests.runtime.control.scans import CAR, MIDDLE, SCAN_S
from wallride.drivers.api import Scan
from wallride.runtime.control.perception.geometry import ENOUGH_POINTS
from wallride.runtime.control.perception.obstacles.thin_obstacles import SCANS, ThinObstacles
from wallride.runtime.control.perception.odometry import OdometryState
from wallride.runtime.control.perception.view import ViewCache
from wallride.sim.virtual.devices import BEAMS, STEP_RAD


def see(x_m=math.nan, y_m=0.0, wild=(), from_m=0.02):
    """View of a hall of 9 m in which one beam meets something at (x, y) in base_link; wild: (beam, range) more.

    from_m: the nearest distance that the lidar measures.
    """
    ranges_m = np.full(BEAMS, 9.0)
    if not math.isnan(x_m):
        dx = x_m - CAR.lidar_x_m
        ranges_m[MIDDLE + round(math.atan2(y_m, dx) / STEP_RAD)] = math.hypot(dx, y_m)
    for beam, range_m in wild:
        ranges_m[beam] = range_m
    return scans.see(ranges_m, from_m=from_m)


def watch(places, pose=lambda _: OdometryState()):
    """Return the points after these places, one each scan, base_link; None: not seen."""
    faint = ThinObstacles()
    for step, place in enumerate(places):
        points = faint.update(see(*place) if place else see(), pose(step), step * SCAN_S)
    return points


def test_one_beam_in_five_scans_is_a_thing_of_five_points():
    points = watch([(3.0, 0.1)] * SCANS)
    assert points.size == SCANS
    assert points.real == pytest.approx(3.0, abs=0.01)
    assert points.imag == pytest.approx(0.1, abs=0.01)


def test_four_scans_are_too_few():
    assert watch([(3.0, 0.1)] * (SCANS - 1)).size == 0


def test_it_may_be_missed_once_but_not_twice():
    pole = (3.0, 0.1)
    assert watch([pole, None, pole, pole, pole]).size == SCANS - 1
    assert watch([pole, None, pole, None, pole]).size == 0
    assert watch([pole, pole, pole, pole, None]).size == 0


def by_beams(hits):
    """Return the points after scans with these returns, (beam, range) each."""
    faint = ThinObstacles()
    for step, wild in enumerate(hits):
        points = faint.update(see(wild=wild), OdometryState(), step * SCAN_S)
    return points


ONE, OTHER = (545, 3.0), (590, 3.0)


@pytest.mark.parametrize(
    "hits",
    [
        [[ONE], [OTHER], [ONE], [OTHER], [ONE, OTHER]],
        [[], [], [ONE, (547, 3.0)], [], [ONE, (547, 3.0)]],
        [[*((beam, 1.5) for beam in range(500, 545)), (545, 1.75), (546, 2.0)]] * SCANS,
        [[ONE, (546, 3.0), (547, 3.0)]] * SCANS,
    ],
    ids=["two poles", "two returns of one scan", "the edge of a wall", "what three beams meet, others see"],
)
def test_what_is_no_thin_thing(hits):
    assert by_beams(hits).size == 0


def test_noise_of_the_distance_is_allowed_and_none_aside():
    nearer_and_farther = [(3.0, 0.0), (3.05, 0.0), (2.96, 0.0), (3.03, 0.0), (2.99, 0.0)]
    assert watch(nearer_and_farther).size == SCANS
    assert watch([(3.0, 0.05 * step) for step in range(SCANS)]).size == 0
    assert watch([(3.0 - 0.11 * step, 0.0) for step in range(SCANS)]).size == 0
    assert watch([(3.0, 0.06 * (step % 2)) for step in range(SCANS)]).size == 0
    assert watch([(3.0 + 0.115 * (step % 2), 0.0) for step in range(SCANS)]).size == 0


def test_from_a_car_that_drives_a_bend_it_is_one_place():
    def pose(step):
        return OdometryState(0.1 * step, 0.02 * step, 0.03 * step)

    def from_there(step):
        at = pose(step)
        seen = (complex(3.0, 0.5) - complex(at.x_m, at.y_m)) * complex(math.cos(at.yaw_rad), -math.sin(at.yaw_rad))
        return seen.real, seen.imag

    points = watch([from_there(step) for step in range(SCANS)], pose)
    assert points.size == SCANS
    assert abs(points - complex(*from_there(SCANS - 1))).max() < 0.03


def test_wild_beams_make_no_thing():
    """Two hours of scans with 2 % wild beams would take too long: the same number of wild beams in fewer scans."""
    faint, rng, found = ThinObstacles(), np.random.default_rng(2), 0
    for step in range(400):
        wild = [(int(beam), float(rng.uniform(0.02, 10.0))) for beam in rng.integers(0, 1081, 22)]
        found += faint.update(see(wild=wild), OdometryState(), step * SCAN_S).size
    assert found == 0


def test_near_far_and_beside_it_is_left_to_three_beams():
    assert watch([(0.27 + 0.7, 0.0)] * SCANS).size == 0
    assert watch([(0.27 + 5.1, 0.0)] * SCANS).size == 0
    assert watch([(1.0, 2.0)] * SCANS).size == 0


def test_after_a_hole_in_the_scans_it_begins_anew():
    faint = ThinObstacles()
    for step in range(SCANS):
        assert faint.update(see(3.0, 0.0), OdometryState(), step * SCAN_S).size == (SCANS if step == SCANS - 1 else 0)
    assert faint.update(see(3.0, 0.0), OdometryState(), SCANS * SCAN_S + 0.2).size == 0


def test_a_wild_beam_in_a_pole_does_not_hide_it():
    """Three beams make it a thing; when one of them is wild, the other two know it from the scans before."""
    whole = [(545, 1.4), (546, 1.4), (547, 1.4)]
    points = by_beams([whole] * (SCANS - 1) + [[(545, 1.4), (546, 6.0), (547, 1.4)]])
    assert points.size == 2 + 3 * (SCANS - 1)
    assert abs(points - (CAR.lidar_x_m + 1.4)).max() < 0.06


@pytest.mark.parametrize("range_m", [0.8, 0.9, 1.4, 2.2])
@pytest.mark.parametrize("beams", [3, 4, 5])
def test_whichever_beam_of_a_thin_thing_is_wild_enough_of_it_is_left(beams, range_m):
    whole = [(540 + beam, range_m) for beam in range(beams)]
    for wild in range(beams):
        faint = ThinObstacles()
        for step in range(SCANS + 1):  # wild in the last two scans
            hit = [(beam, 6.0 if step >= SCANS - 1 and beam == 540 + wild else at_m) for beam, at_m in whole]
            view = see(wild=hit)
            points = faint.update(view, OdometryState(), step * SCAN_S)
        there = np.count_nonzero(view.solid & (view.ranges_m < 3.0)) + points.size
        assert there >= ENOUGH_POINTS, f"beam {wild} of {beams}"


def test_a_beam_that_is_known_to_be_dirty_makes_no_thing():
    """Seen from a car that stands, what is on the window keeps returning from the same place as well."""
    dirty = np.zeros(1081, np.bool_)
    dirty[545] = True
    found = {}
    for known in (None, dirty):
        faint = ThinObstacles()
        for step in range(SCANS):
            view = replace(see(wild=[(545, 1.2)]), dirty=known)
            points = faint.update(view, OdometryState(), step * SCAN_S)
        found[known is None] = points.size
    assert found == {True: SCANS, False: 0}


FEW_RAD = math.radians(1.0)


def see_few(hits):
    """View of a hall of 9 m by a lidar of 1 degree; hits: (x, y) in base_link, each hit by the beam nearest to it."""
    ranges_m = np.full(360, 9.0, np.float32)
    for x_m, y_m in hits:
        dx = x_m - CAR.lidar_x_m
        ranges_m[180 + round(math.atan2(y_m, dx) / FEW_RAD)] = math.hypot(dx, y_m)
    return ViewCache(CAR).see(Scan(0.0, 0.0, -math.pi, FEW_RAD, 0.02, 12.0, ranges_m, 0))


def approach(pole, ways_m, missed=()):
    """Points of each scan of a lidar of 10 Hz and few beams while the car drives these ways toward a pole; base_link.

    missed: numbers of scans in which another thing is seen instead.
    """
    faint, found = ThinObstacles(), []
    for number, way_m in enumerate(ways_m):
        at = (pole[0] - way_m, pole[1]) if number not in missed else (3.5, -1.0)
        found.append(faint.update(see_few([at]), OdometryState(way_m), number * 0.025))
    return found


def test_with_few_beams_a_confirmed_pole_is_held_until_the_car_is_at_it():
    ways_m = [0.1 * number for number in range(16)]
    found = approach((2.0, 0.05), ways_m)
    for way_m, points in zip(ways_m[SCANS - 1 :], found[SCANS - 1 :], strict=True):
        assert points.size >= ENOUGH_POINTS
        assert points.real == pytest.approx(2.0 - way_m, abs=0.05)


def test_a_lidar_that_is_blind_before_the_bumper_holds_it_too_however_fine_its_beams():
    """An A3 at 0.15 m: half of the distances of a pole are none, the rest is as thin as dirt."""
    found = {}
    for from_m in (0.06, 0.15):
        faint = ThinObstacles()
        for number in range(16):
            way_m = 0.1 * number
            points = faint.update(see(2.0 - way_m, 0.05, from_m=from_m), OdometryState(way_m), number * SCAN_S)
        found[from_m] = points.size >= ENOUGH_POINTS
    assert found == {0.06: False, 0.15: True}


def test_a_held_pole_may_be_missed_once_and_is_forgotten_after_the_second_time():
    ways_m = [0.1 * number for number in range(16)]
    assert approach((2.0, 0.05), ways_m, missed={14})[14].size >= ENOUGH_POINTS
    assert approach((2.0, 0.05), ways_m, missed={14, 15})[15].size == 0
    assert approach((2.0, 0.05), ways_m, missed={13})[15].size >= ENOUGH_POINTS


def test_nothing_is_held_that_was_never_confirmed():
    assert approach((1.1, 0.05), [0.0] * 10)[-1].size  # beyond FROM_M: confirmed where it stands
    assert all(not points.size for points in approach((0.9, 0.05), [0.0] * 10))


def test_of_two_held_poles_each_is_held_by_its_own_returns():
    faint = ThinObstacles()
    for number in range(SCANS):
        both = faint.update(see_few([(1.3, 0.2), (1.3, -0.2)]), OdometryState(), number * 0.025)
    assert {bool(y_m > 0) for y_m in both.imag} == {True, False}
    for number in range(SCANS, SCANS + 2):
        one = faint.update(see_few([(0.95, 0.2)]), OdometryState(0.35), number * 0.025)
    assert one.size >= ENOUGH_POINTS
    assert (one.imag > 0.0).all()
