"""What a standing car knows of the floor: free where it looked or stood, blocked where something is, else unknown."""

import cmath

import numpy as np
import pytest

from tests.runtime.control.scans import BEARING_RAD, CAR, see
from wallride.runtime.control.perception.obstacles.rear_memory import RememberedView
from wallride.runtime.control.recovery.floor_map import CELL_M, HALF_CELLS, blocked_floor
from wallride.runtime.control.safety.body import Body
from wallride.runtime.control.safety.swept_settings import SweptSettings
from wallride.sim.world.segments import SegmentGeometry, box

BARE = Body(SweptSettings(), CAR).bare
ROOM = SegmentGeometry(np.array([*box(0.0, 0.0, 12.0, 12.0), *box(1.0, 1.2, 0.6, 0.3), *box(-0.6, -1.0, 0.4, 0.4)]))


def view(at, yaw_rad=0.0, surroundings=ROOM, told=None):
    """A view from a place of base_link, perhaps told to be from another one."""
    lidar = at + CAR.lidar_x_m * cmath.rect(1.0, yaw_rad)
    ranges_m = surroundings.cast(lidar.real, lidar.imag, BEARING_RAD + yaw_rad)
    return RememberedView(see(ranges_m), at if told is None else told, yaw_rad)


def result(steps):
    """What a generator returns, and how many slices it took."""
    slices = 0
    while True:
        try:
            next(steps)
        except StopIteration as end:
            return end.value, slices
        slices += 1


def floor(*kept):
    return result(blocked_floor(list(kept), BARE))[0]


def blocked_at(blocked, place_m):
    return bool(blocked[round(place_m.imag / CELL_M) + HALF_CELLS, round(place_m.real / CELL_M) + HALF_CELLS])


def test_what_nobody_ever_saw_is_not_free():
    blocked, _ = floor(view(0j))
    assert not blocked_at(blocked, 1.0 + 0j)
    assert blocked_at(blocked, -0.8 + 0j), "the lidar does not look behind"
    assert not blocked_at(blocked, -0.1 + 0j), "where the car itself stands"


def test_what_was_seen_on_the_way_here_is_known():
    blocked, _ = floor(view(-1.5 + 0j), view(-0.8 + 0j), view(0j))
    assert not blocked_at(blocked, -0.8 + 0j)
    assert blocked_at(blocked, -0.6 - 0.8j), "the side of the box that only earlier views show"


def test_what_left_is_free_where_this_scan_looks_and_remembered_where_it_does_not():
    with_things = SegmentGeometry(np.array([*ROOM.segments_m, *box(1.2, 0.0, 0.3, 0.3), *box(-0.7, 0.0, 0.2, 0.2)]))
    blocked, _ = floor(view(-1.5 + 0j, surroundings=with_things), view(0j))
    assert not blocked_at(blocked, 1.05 + 0j)
    assert blocked_at(blocked, -0.8 + 0j)


@pytest.mark.parametrize("slid_m", [0.12, 0.28])
def test_a_view_that_a_slide_has_put_too_near_is_laid_where_it_belongs(slid_m):
    before = [view(-1.0 - slid_m + 0j, told=-1.0 + 0j), view(-0.5 - slid_m + 0j, told=-0.5 + 0j)]
    _, laid = floor(*before, view(0j))
    found_m = [one.place_m for one in laid]
    assert found_m == pytest.approx([-1.0 - slid_m, -0.5 - slid_m, 0.0], abs=1.5 * CELL_M)
    assert laid[-1].view is not laid[0].view


def test_between_bare_walls_the_odometry_is_believed():
    corridor = SegmentGeometry(np.array([[-40.0, 1.0, 40.0, 1.0], [-40.0, -1.0, 40.0, -1.0]]))
    _, laid = floor(view(-1.0 + 0j, surroundings=corridor), view(0j, surroundings=corridor))
    assert laid[0].place_m == pytest.approx(-1.0, abs=1e-9)


def test_the_work_comes_in_slices():
    _, slices = result(blocked_floor([view(-0.1 * back + 0j) for back in range(9, -1, -1)], BARE))
    assert slices == 9
