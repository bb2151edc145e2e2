"""The path of the rolling ball."""

import math

import numpy as np
import pytest

from tests.runtime.control.wall_following.ball_scenes import places
from wallride.runtime.control.perception.geometry import Places
from wallride.runtime.control.wall_following.ball import LANE_SHARE, half_ahead_m
from wallride.runtime.control.wall_following.ball_path import RADII_M, Ball, BallPath, bend_of, circles_met, roll_ball
from wallride.runtime.control.wall_following.followed_wall import FollowedWall, SideView, around, wall_side
from wallride.runtime.control.wall_following.prediction import Shift


def wall_m(distance_m, heading_rad=0.0, from_m=-2.0, to_m=5.0):
    along = np.arange(from_m, to_m, 0.05)
    cos, sin = math.cos(heading_rad), math.sin(heading_rad)
    places_m: Places = np.empty(along.size, np.complex128)
    places_m.real, places_m.imag = along * cos - distance_m * sin, along * sin + distance_m * cos
    return places_m


def ball_path(places_m, ball_m, more_radii_m=()):
    range_m, bearing_rad, _ = around(places_m, 0.0, 0.0, 0.0)
    radii_m = RADII_M + more_radii_m
    return BallPath(radii_m, *circles_met(range_m, bearing_rad, ball_m, radii_m))


@pytest.mark.parametrize("distance_m", [0.7, 1.0, 1.25])
def test_beside_a_straight_wall_the_path_is_parallel_to_it(distance_m):
    path = ball_path(wall_m(distance_m), 1.0, (0.7, 1.1))
    radius_m = np.array(path.radius_m)
    far = radius_m > 0.5
    assert (radius_m * np.sin(path.bearing_rad))[far] == pytest.approx(distance_m - 1.0, abs=0.005)
    assert np.array(path.crosses)[far].all()


def test_a_circle_that_lies_too_near_as_a_whole_is_no_crossing_and_points_to_the_free_side():
    path = ball_path(wall_m(0.5), 1.0)
    assert path.meets[0]
    assert not path.crosses[0]
    assert path.bearing_rad[0] == pytest.approx(-math.radians(85))


def test_a_circle_that_the_wall_does_not_meet_points_to_the_wall():
    path = ball_path(wall_m(2.0), 1.0)
    assert not path.meets[0]
    assert path.bearing_rad[0] == pytest.approx(math.radians(85))


def test_the_ball_goes_round_an_outside_corner_and_stays_in_an_inside_one():
    outside = ball_path(np.asarray(np.arange(-2.0, 1.0, 0.05) + 1j, np.complex128), 1.0)
    x_m, y_m = places(outside)
    round_it = np.array(outside.crosses) & (x_m > 1.1)
    assert round_it.any()
    assert np.hypot(x_m - 0.95, y_m - 1.0)[round_it] == pytest.approx(1.0, abs=0.03)
    beside, front = np.arange(-2.0, 3.0, 0.05) + 1j, 3.0 + 1j * np.arange(1.0, -3.0, -0.05)
    inside = ball_path(np.concatenate([beside, front]), 1.0)
    x_m, _ = places(inside)
    assert x_m.max() == pytest.approx(2.0, abs=0.02)


def test_the_bend_of_a_straight_path_is_zero_wherever_the_car_stands():
    for distance_m, heading_rad in ((1.0, 0.0), (1.4, 0.3), (0.7, -0.3)):
        path = ball_path(wall_m(distance_m, heading_rad), 1.0)
        assert bend_of(path.radius_m[1:5], path.bearing_rad[1:5]) == pytest.approx(0.0, abs=0.02)


@pytest.mark.parametrize("curvature", [-0.4, -0.2, 0.25, 0.5])
def test_the_bend_of_an_arc_is_its_curvature(curvature):
    bearing = tuple(math.asin(radius_m * curvature / 2) for radius_m in RADII_M)
    assert bend_of(RADII_M[1:5], bearing[1:5]) == pytest.approx(curvature, rel=0.02)


def rolled(x_m, y_m, solid, beams, ball):
    """Roll the ball along these points of a wall without a line."""
    side = wall_side(-2.0, 0.01, x_m.size, "left")
    seen = SideView(side, x_m, y_m, np.hypot(x_m, y_m), solid, ~solid)
    return roll_ball(seen, FollowedWall(beams, None, 1.0, -1), None, Shift(), ball, RADII_M)


@pytest.mark.parametrize(("ends_m", "bends"), [(2.5, True), (0.4, False)])
def test_a_path_that_is_not_all_seen_has_no_bend(ends_m, bends):
    """Along a bent wall it bends; where the wall ends beside the car, the far circles do not meet it."""
    x_m = np.arange(-2.0, ends_m, 0.02)
    y_m = 0.8 + 0.15 * x_m * x_m
    beams = np.arange(x_m.size)
    answer = rolled(x_m, y_m, beams >= 0, beams, Ball(0.0, 0.01, 0.3))
    assert (answer[2] != 0.0) == bends


@pytest.mark.parametrize(("across_m", "seen"), [(0.5, True), (0.5, False), (1.4, True)])
def test_the_path_knows_how_near_it_comes_to_the_other_wall(across_m, seen):
    """A wall at 1 m on the left, then another one on the right; dirt and the car's own parts are no wall."""
    along = np.arange(-1.0, 3.0, 0.02)
    x_m, y_m = np.concatenate((along, along[::-1])), np.repeat([1.0, -across_m], along.size)
    solid = np.arange(x_m.size) < along.size if not seen else np.ones(x_m.size, np.bool_)
    mine = np.arange(along.size)
    answer = rolled(x_m, y_m, solid, mine, Ball(0.0, 0.01, 1.0))
    assert answer[3] == (pytest.approx(across_m, abs=0.02) if seen else math.inf)


def test_what_the_path_goes_through_is_a_wall_with_gaps_and_makes_no_gap_a_way():
    """A lane of 1.2 m has 0.2 m left where the path is 1 m from my wall; among furniture there is nothing left."""
    assert half_ahead_m(1.0, 0.2) == pytest.approx(0.6)
    assert half_ahead_m(1.0, 0.02) == half_ahead_m(1.0, math.inf) == math.inf
    assert not half_ahead_m(1.0, 0.02) < LANE_SHARE
