"""Which points are my wall: gaps, dead ends, glass, narrow places, and the mirror."""

import math

import numpy as np
import pytest

from tests.runtime.control.scans import see
from wallride.runtime.control.wall_following.followed_wall import bridge_glass, choose_wall, outline, side_view
from wallride.runtime.control.wall_following.wall_fit import WallLine
from wallride.sim.world.beams import LidarSettings, true_ranges_m
from wallride.sim.world.place import World
from wallride.sim.world.pose import Pose, Twist
from wallride.sim.world.segments import SegmentGeometry
from wallride.sim.world.worlds import load_world

LIDAR = LidarSettings(noise_std_m=0.0)


def seen_in(walls, pose=None, side="left", silent=None):
    """What is seen among walls (list of segments, or a world's name); `silent` = (from_deg, to_deg) without echo."""
    here = Pose(0.0, 0.0, 0.0)
    if isinstance(walls, str):
        world = load_world(walls, side=side)
    else:
        world = World("", SegmentGeometry(np.array(walls, np.float64)), here)
    ranges_m = true_ranges_m(world, pose or here, Twist(), LIDAR)
    if silent is not None:
        bearing = np.linspace(-135, 135, 1081)
        ranges_m[(bearing >= silent[0]) & (bearing <= silent[1])] = np.nan
    return side_view(see(np.where(ranges_m < 30, ranges_m, np.nan)), side)


def wall_of(seen, ball_m=1.0, expected=None, desired_m=1.0):
    wall = choose_wall(seen, ball_m, expected, desired_m)
    assert wall is not None
    return wall


def wall_points(seen, desired_m=1.0):
    wall = wall_of(seen, desired_m)
    return seen.x_m[wall.beams], seen.y_m[wall.beams]


def bridged(seen):
    wall = wall_of(seen)
    assert wall.line is not None
    return bridge_glass(seen, wall)


def test_the_far_wall_of_a_room_is_not_mine():
    _, y_m = wall_points(seen_in("straight"))
    assert y_m.min() > 0.99


def test_the_front_wall_of_an_inside_corner_belongs_to_it():
    x_m, y_m = wall_points(seen_in("inside_corner", Pose(6.0, 0.0, 0.0)))
    assert x_m.max() == pytest.approx(2.0, abs=0.01)
    assert y_m.min() < -2.0


def test_a_dead_end_does_not_join_left_and_right_wall():
    assert wall_points(seen_in("dead_end", Pose(4.0, 0.0, 0.0)))[1].min() > 0.99


def test_a_narrow_door_is_part_of_the_wall_and_a_wide_one_ends_it():
    narrow = [(-5, 1, 1, 1), (2, 1, 9, 1)]
    wide = [(-5, 1, 1, 1), (2.8, 1, 9, 1)]
    assert wall_points(seen_in(narrow))[0].max() > 2.5
    assert wall_points(seen_in(wide))[0].max() < 1.01


def test_a_small_ball_fits_through_a_door_that_stops_a_big_one():
    door = [(-5, 0.5, 0.8, 0.5), (2.0, 0.5, 9, 0.5)]
    assert wall_points(seen_in(door), 1.0)[0].max() > 2.0
    assert wall_points(seen_in(door), 0.5)[0].max() < 0.81


def test_a_wall_behind_is_not_mine_however_early_it_is_seen():
    walls = [(-2.5, 3, -2.5, 0.4), (-0.5, 1, 9, 1)]
    x_m, y_m = wall_points(seen_in(walls))
    assert x_m.min() > -0.6
    assert y_m == pytest.approx(1.0, abs=1e-3)


def test_nothing_beside_the_car_is_no_wall():
    assert choose_wall(seen_in([(2, -1, 2, 0.1)]), 1.0, None, 1.0) is None
    assert choose_wall(seen_in([(-5, 9, 9, 9)]), 1.0, None, 1.0) is None


@pytest.mark.parametrize("name", ["inside_corner", "outside_corner", "doorway"])
def test_the_right_side_is_the_left_side_in_a_mirror(name):
    left = wall_points(seen_in(name, Pose(5.0, 0.0, 0.1)))
    right = wall_points(seen_in(name, Pose(5.0, 0.0, -0.1), side="right"))
    for ours, theirs in zip(left, right, strict=True):
        assert theirs == pytest.approx(ours, abs=1e-6)


def test_the_outline_is_smooth_thin_and_on_the_wall():
    rng = np.random.default_rng(2)
    x_m = np.linspace(-1.0, 3.0, 400, dtype=np.float64)
    places_m = outline(x_m, 1.0 + rng.normal(0.0, 0.02, 400), np.arange(400))
    assert 45 <= places_m.size <= 130
    assert places_m.real[[0, -1]] == pytest.approx([-1, 3])
    assert places_m.imag.std() < 0.012
    straight = outline(x_m, 0.0 * x_m + 1.0, np.arange(400))
    assert np.diff(straight.real).max() < 0.1
    assert straight.imag == pytest.approx(1.0)


def test_the_outline_of_a_few_points_is_themselves():
    places_m = outline(np.linspace(0.0, 2.0, 5), np.full(5, 1.0), np.arange(5))
    assert places_m.tolist() == [0 + 1j, 0.5 + 1j, 1 + 1j, 1.5 + 1j, 2 + 1j]


def test_a_silent_gap_between_two_pieces_of_one_line_is_glass():
    seen = seen_in([(-5, 1, 9, 1)], silent=(20, 70))
    filled = bridged(seen)
    assert filled is not None
    assert filled.imag == pytest.approx(1.0, abs=1e-3)
    assert 0.6 < filled.real.min() < 0.8
    assert 2.5 < filled.real.max() < 3.2
    assert np.diff(filled.real).max() < 0.1


def test_an_opening_that_returns_beams_stays_open():
    opening = [(-5, 1, 0.6, 1), (0.6, 1, 0.6, 5), (0.6, 5, 3.2, 5), (3.2, 5, 3.2, 1), (3.2, 1, 9, 1)]
    assert bridged(seen_in(opening)) is None
    assert bridged(seen_in(opening, silent=(64, 73))) is None  # not even where its edge is dark


def test_silence_without_a_wall_beyond_is_no_glass():
    seen = seen_in([(-5, 1, 1, 1)])
    assert bridged(seen) is None


def test_silence_wider_than_any_pane_is_no_glass():
    seen = seen_in([(-5, 1, 0.3, 1), (5.2, 1, 6.5, 1)])
    assert bridged(seen) is None


@pytest.mark.parametrize(("right_m", "expected_m"), [(0.6, 0.8), (0.97, 1.0), (3.0, 1.0)])
def test_the_ball_is_never_wider_than_the_way(right_m, expected_m):
    seen = seen_in([(-5, 1, 9, 1), (-5, -right_m, 9, -right_m)])
    assert wall_of(seen).room_m == pytest.approx(expected_m, abs=0.01)


def test_without_a_line_the_wish_stands():
    """A short piece beside the car is a wall, and no line; the other side is as near as on a narrow way."""
    wall = wall_of(seen_in([(0.2, 0.5, 0.25, 0.5), (-5, -0.5, 9, -0.5)]), desired_m=1.3)
    assert wall.line is None
    assert wall.room_m == 1.3


def test_a_line_that_is_expected_is_found_as_well_as_by_a_vote():
    seen = seen_in([(-5, 1, 9, 1), (-5, -3, 9, -3)])
    lines = wall_of(seen).line, wall_of(seen, expected=WallLine(1.02, 0.01, 100)).line
    for line in lines:
        assert line is not None
        assert (line.distance_m, line.heading_rad) == pytest.approx((1.0, 0.0), abs=1e-3)


NARROW = [(-5, 0.6, 20, 0.6), (1, -0.6, 20, -0.6), (1, -0.6, 1, -5), (-5, -0.6, -1, -0.6)]
"""A corridor 1.2 m wide with a side way to the right just ahead of the car."""


def test_the_other_wall_of_a_narrow_corridor_is_not_mine():
    _, y_m = wall_points(seen_in(NARROW))
    assert y_m.min() > 0.5, "the ball is thicker than the corridor and would take both walls for one"


@pytest.mark.parametrize("turned_deg", [-20, -12])
def test_nor_is_it_where_the_car_is_turned_away_from_mine(turned_deg):
    """Its far end is then seen on my side of the heading; a ball rolled round it lies beyond it."""
    turned = np.exp(1j * math.radians(turned_deg))
    x_m, y_m = wall_points(
        seen_in([(-5, 0.45, 20, 0.45), (0, -0.5, 20, -0.5)], Pose(0.0, 0.0, float(np.angle(turned))))
    )
    assert ((x_m + 1j * y_m) * turned).imag.min() > 0.4


@pytest.mark.parametrize("turned_deg", [-40, -20, 0, 20, 40])
def test_a_gap_in_the_front_wall_still_belongs_to_it(turned_deg):
    front = [(-5, 1, 3, 1), (3, 1, 3, 0.4), (3, -0.4, 3, -4)]
    turned = np.exp(1j * math.radians(turned_deg))
    x_m, y_m = wall_points(seen_in(front, Pose(0.0, 0.0, math.radians(turned_deg))))
    assert ((x_m + 1j * y_m) * turned).imag.min() < -0.5, "the ball does not fit through, so it must not roll into it"
