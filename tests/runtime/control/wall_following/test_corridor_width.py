"""How much room there is for the wanted distance, and what is remembered of it where corridors meet."""

import numpy as np
import pytest

from tests.tiers import slow
from wallride.runtime.control.wall_following.corridor_width import ALONG_RAD, WIDENS_PER_M, Room
from wallride.runtime.control.wall_following.wall_fit import WallLine
from wallride.sim.car.vehicle import VehicleSettings
from wallride.sim.lab import laws
from wallride.sim.virtual.closed_loop import Case, drive
from wallride.sim.world.place import World
from wallride.sim.world.pose import Pose
from wallride.sim.world.segments import SegmentGeometry, chain

HERE = Pose(0.0, 0.0, 0.0)
WALL = WallLine(0.8, 0.0, 100)
NARROW_M, OPEN_M = 0.8, 1.0
"""What a scan has room for, of 1 m."""


def in_a_corridor():
    """A room after a corridor of 1.6 m, and what it keeps there."""
    room = Room()
    for _ in range(30):
        narrow_m = room.beside_m(WALL, NARROW_M, 1.0, 0.05)
    return room, narrow_m


def test_in_the_open_there_is_room_for_all_that_is_wanted():
    room = Room()
    assert room.within_m(1.0) == 1.0
    assert room.beside_m(WALL, OPEN_M, 1.0, 0.05) == 1.0
    assert room.within_m(1.0) == 1.0


def test_between_narrow_walls_it_is_half_of_the_width_and_known_for_the_next_scan():
    room, narrow_m = in_a_corridor()
    assert narrow_m == pytest.approx(0.8, abs=0.01)
    assert room.within_m(1.0) == pytest.approx(0.8, abs=0.01)
    assert room.within_m(0.5) == 0.5


def test_where_the_other_wall_ends_it_widens_with_the_way_until_all_is_wanted_again():
    room, narrow_m = in_a_corridor()
    for metre in (0.5, 1.0, 1.5):
        assert room.beside_m(WALL, OPEN_M, 1.0, 0.5) == pytest.approx(narrow_m + WIDENS_PER_M * metre)
    room.beside_m(None, OPEN_M, 1.0, 0.2)
    assert room.within_m(1.0) < 1.0
    room.beside_m(WALL, OPEN_M, 1.0, 1.0)
    assert room.within_m(2.0) == 2.0  # nothing is left of it: who wants more may have it at once


def test_a_car_that_stands_or_backs_does_not_forget():
    room, narrow_m = in_a_corridor()
    assert room.beside_m(WALL, OPEN_M, 1.0, 0.0) == narrow_m
    assert room.beside_m(WALL, OPEN_M, 1.0, -0.5) == pytest.approx(narrow_m + 0.5 * WIDENS_PER_M)


def test_a_pole_beside_the_car_narrows_while_it_is_there_and_is_not_remembered():
    room = Room()
    for moved_m in [0.0, 0.0] + 20 * [0.05]:
        assert room.beside_m(WALL, NARROW_M, 1.0, moved_m) < 0.85
        assert room.within_m(1.0) == 1.0
    assert room.beside_m(WALL, OPEN_M, 1.0, 0.05) == 1.0
    assert room.within_m(1.0) == 1.0


def test_the_width_beside_a_line_across_the_way_counts_for_one_scan_only():
    room = Room()
    across = WallLine(0.7, -ALONG_RAD - 0.3, 10)
    for _ in range(30):
        assert room.beside_m(across, NARROW_M, 1.0, 0.05) < 0.95
    assert room.within_m(1.0) == 1.0


@pytest.mark.parametrize(("side", "desired_m"), [("left", 0.6), ("right", 1.0), *slow(("left", 1.0), ("right", 0.6))])
def test_the_car_turns_into_a_corridor_as_narrow_as_its_own(desired_m, side):
    near, far = chain([(-5, 0.83), (6, 0.83), (6, 20)]), chain([(7.58, 20), (7.58, 0.83), (30, 0.83)])
    world = World("", SegmentGeometry(np.array([*near, *far, *chain([(-5, -0.83), (30, -0.83)])])), HERE)
    world = world if side == "left" else world.mirrored()
    follower, guard = laws.build("ball", side, desired_m, 2.0)
    done = drive(Case(world, desired_m=desired_m, distance_m=14.0, vehicle=VehicleSettings()), follower, guard)
    assert done.contact is None
    assert not [stop for stop in done.stops if stop.from_s > 0.0]
    assert 6.2 < done.pose[-1, 0] < 7.5
    assert abs(done.pose[-1, 1]) > 5.0
