"""The steering and speed of the rolling-ball law."""

import math
from dataclasses import replace

import numpy as np
import pytest

from tests.runtime.control.wall_following.ball_scenes import MOTOR, along, arc, follower, scan_in, scan_of
from wallride.runtime.control.wall_following.ball_drive import SLIPPING_SHARE
from wallride.runtime.control.wall_following.ball_law import (
    ARC_M,
    ARC_S,
    BENT_PER_M,
    MAX_SLOPE_RAD,
    ROUGH_KD_SHARE,
    STRAIGHT_PER_M,
    TURN_AHEAD_S,
    TURN_M,
    TURN_S,
    approach_rad,
    look_aheads_m,
    turn_share,
)
from wallride.runtime.control.wall_following.ball_path import RADII_M
from wallride.runtime.control.wall_following.speed_profile import speed_limit_mps
from wallride.sim.world.beams import LidarSettings, true_ranges_m
from wallride.sim.world.place import World
from wallride.sim.world.pose import Pose, Twist
from wallride.sim.world.segments import SegmentGeometry


def off(path, heading_rad):
    """The line of all places at one heading from the point that is (x, y) from the car, on one side of it."""

    def way(r_m):
        x_m, y_m = path
        cos, sin = math.cos(heading_rad), math.sin(heading_rad)
        ahead_m = -(x_m * cos + y_m * sin) + math.sqrt(r_m * r_m - (x_m * sin - y_m * cos) ** 2)
        return math.atan2(y_m + ahead_m * sin, x_m + ahead_m * cos)

    return way


def kinked(ahead_m, turn_rad):
    """Straight on, and from so far ahead on at another heading."""
    return lambda r_m: 0.0 if r_m <= ahead_m else off((ahead_m, 0.0), turn_rad)(r_m)


def rounded(ahead_m):
    """Straight on, and from so far ahead on an arc to the left of 1 m: the way round an outside corner."""
    centre_m = math.hypot(ahead_m, 1.0)

    def way(r_m):
        if r_m <= ahead_m:
            return 0.0
        cos = (r_m * r_m + centre_m * centre_m - 1.0) / (2 * r_m * centre_m)
        return math.atan2(1.0, ahead_m) - math.acos(cos) if cos <= 1.0 else None

    return way


@pytest.mark.parametrize("speed_mps", [1.0, 2.0, 3.0])
def test_an_outside_corner_that_the_car_has_not_come_to_is_not_steered_for(speed_mps):
    here_m, *_, near_m = look_aheads_m(0.4, 0.3, speed_mps)
    for ahead_m in np.arange(here_m, 1.5, 0.05):
        steering_rad = along(rounded(ahead_m), speed_mps)[3]
        assert -0.001 <= steering_rad < 0.1 * (1.0 + speed_mps)  # a fast car's servo has to begin
        if ahead_m > near_m:
            assert steering_rad == pytest.approx(0.0, abs=1e-9)
    assert along(rounded(0.0), speed_mps)[3] > 0.3


def test_an_inside_corner_is_turned_for_where_the_tightest_turn_begins_and_not_sooner():
    for turn_rad in (0.6, 1.0, math.pi / 2):
        begins_m = (TURN_M + TURN_S) * math.tan(turn_rad / 2) + TURN_AHEAD_S
        assert along(kinked(begins_m + 0.35, -turn_rad))[3] == pytest.approx(0.0, abs=0.01)
        assert along(kinked(begins_m - 0.15, -turn_rad))[3] < -0.3


def test_a_bend_of_a_few_degrees_is_no_corner():
    assert turn_share(RADII_M, tuple(kinked(0.4, -0.14)(r_m) for r_m in RADII_M), (True,) * 10, 1.0) == 0.0
    assert turn_share(RADII_M, tuple(kinked(0.2, -0.5)(r_m) for r_m in RADII_M), (True,) * 10, 1.0) == 1.0


def test_no_corner_is_looked_for_beyond_a_gap_in_the_path():
    crosses = (True, True, False, *(True,) * 7)
    bearing_rad = tuple(kinked(0.9, -1.2)(r_m) for r_m in RADII_M)
    assert turn_share(RADII_M, bearing_rad, (True,) * 10, 1.0) > 0.0
    assert turn_share(RADII_M, bearing_rad, crosses, 1.0) == 0.0


def test_the_car_heads_no_farther_towards_the_wall_than_the_path_at_the_long_look_ahead():
    """A niche: the path leads 0.4 rad to the wall here, and is back on the straight way 0.7 m ahead."""
    assert along(lambda r_m: 0.4 if r_m < 0.65 else 0.0)[1] == pytest.approx(0.1)
    assert along(lambda r_m: 0.4)[1] == pytest.approx(0.4)


def test_the_way_back_to_a_straight_wall_is_no_corner():
    for error_m in (-0.2, 0.2):
        place = (-error_m * math.sin(0.1), error_m * math.cos(0.1))
        assert along(off(place, 0.1), error_m=error_m)[1] == pytest.approx(0.1)


def aimed(off_rad=0.0, bend=0.0):
    """The aim beside a line that the ball's bearing contradicts by some angle; the points say 0.1, the line 0.02."""
    near_rad = 0.05 + math.asin(0.02 / 0.7) + off_rad
    return along(lambda _: near_rad, error_m=0.1, line=(0.05, 0.02), bend=bend)


def test_beside_a_straight_wall_its_line_is_steered_by():
    assert aimed(0.05)[:3] == pytest.approx((0.02, 0.05, 1.0))


@pytest.mark.parametrize("change", [{"off_rad": 0.13}, {"off_rad": -0.13}, {"bend": 0.17}, {"bend": -0.17}])
def test_where_the_ball_or_the_bend_says_otherwise_the_ball_is_steered_by(change):
    error_m, _, straight, _ = aimed(**change)
    assert (error_m, straight) == (0.1, 0.0)
    assert aimed(bend=(STRAIGHT_PER_M + BENT_PER_M) / 2)[2] == pytest.approx(0.5)
    assert aimed(0.09)[0] == pytest.approx(0.06)


def test_near_the_path_the_approach_is_straight_in_the_error_and_farther_off_an_arc():
    bend = 1 / (ARC_M + ARC_S * 2.0)
    assert approach_rad(0.05, 2.0, 1.5) == pytest.approx(0.075)
    assert approach_rad(-0.05, 2.0, 1.5) == pytest.approx(-0.075)
    joint_rad = math.asin(bend / 1.5)
    along_m = np.arange(0.0, 0.6, 1e-4) + joint_rad / 1.5
    headings = np.array([approach_rad(size_m, 2.0, 1.5) for size_m in along_m])
    assert headings[0] == pytest.approx(joint_rad)
    # On the arc the heading turns by the curvature per metre of way: d(cos h) = -c de.
    assert np.diff(np.cos(headings)) == pytest.approx(-bend * 1e-4, rel=1e-3)


def test_the_approach_is_never_backwards_and_a_fast_car_approaches_more_gently():
    assert approach_rad(9.0, 1.0, 3.0) == MAX_SLOPE_RAD
    assert approach_rad(-9.0, 4.0, 3.0) == -MAX_SLOPE_RAD
    headings = [approach_rad(0.5, speed_mps, 3.0) for speed_mps in (1.0, 2.0, 3.0, 4.0)]
    assert headings == sorted(headings, reverse=True)
    assert approach_rad(0.1, 1.0, 0.2) == pytest.approx(0.02)
    assert approach_rad(0.1, 1.0, 0.0) == 0.0


def beside_line(error_m, heading_rad, speed_mps):
    """The steering beside a tracked straight line."""
    place = (-error_m * math.sin(heading_rad), error_m * math.cos(heading_rad))
    line = (heading_rad, error_m)
    return along(off(place, heading_rad), speed_mps, error_m=error_m, line=line, kp=9.0)[3]


def test_a_faster_car_steers_less_for_the_same_so_that_it_needs_the_same_time():
    assert beside_line(0.01, 0.0, 1.0) == pytest.approx(9.0 * 0.01)
    assert beside_line(0.01, 0.0, 3.0) == pytest.approx(1.0 * 0.01)
    assert beside_line(0.0, 0.1, 1.0) == pytest.approx(0.45)
    assert beside_line(0.0, 0.1, 3.0) == pytest.approx(0.15)
    assert beside_line(0.01, 0.1, 0.2) == pytest.approx(beside_line(0.01, 0.1, 1.0))


def test_a_slow_car_is_steered_less_where_the_wall_is_not_straight():
    assert along(lambda _: 0.1)[3] == pytest.approx(ROUGH_KD_SHARE * 4.5 * 0.1)
    assert along(lambda _: 0.1, 3.0)[3] == pytest.approx(4.5 / 3 * 0.1)


@pytest.mark.parametrize("curvature", [-0.25, 0.25, 0.4])
def test_a_car_without_error_in_a_slow_bend_is_told_nearly_the_bends_own_steering(curvature):
    assert arc(curvature, 1.0) == pytest.approx(math.atan(0.33 * curvature), rel=0.12)


def test_a_fast_bend_is_steered_more_than_a_slow_one_as_its_tyres_slip():
    assert arc(0.3, 3.0) > 1.7 * arc(0.3, 1.0)
    assert arc(-0.3, 3.0) < 1.7 * arc(-0.3, 1.0)


@pytest.mark.parametrize("error_m", [-0.1, -0.05, 0.05, 0.1])
@pytest.mark.parametrize("yaw_rad", [-0.05, 0.05])
def test_the_answer_is_kp_on_the_error_and_kd_on_the_heading(error_m, yaw_rad):
    answer = follower(kp=0.4, kd=0.8).follow(scan_in("straight", y_m=-error_m, yaw_rad=yaw_rad), None)
    assert answer.drive.steering_rad == pytest.approx(0.4 * error_m - 0.8 * yaw_rad, abs=0.003)
    assert answer.error_m == pytest.approx(error_m, abs=1e-3)
    assert answer.distance_m == pytest.approx(1.0 + error_m, abs=1e-3)


def test_steering_stays_within_what_the_car_can_do():
    assert follower().follow(scan_in("straight", y_m=0.5, yaw_rad=0.3), None).drive.steering_rad == -0.34
    assert follower().follow(scan_in("straight", y_m=-0.7, yaw_rad=-0.3), None).drive.steering_rad == 0.34


@pytest.mark.parametrize("name", ["inside_corner", "outside_corner", "l_turn", "curved"])
def test_the_right_side_is_the_left_side_in_a_mirror(name):
    left, right = follower(side="left", speed_mps=3.0), follower(side="right", speed_mps=3.0)
    for number in range(5):
        at = {"x_m": 4.0 + 0.1 * number, "y_m": 0.1, "yaw_rad": 0.05, "number": number}
        motor = replace(MOTOR, speed_mps=2.0, steering_rad=0.1)
        ours = left.follow(scan_in(name, **at), motor)
        theirs = right.follow(scan_in(name, side="right", **at), replace(motor, steering_rad=-0.1))
        assert theirs.drive.steering_rad == pytest.approx(-ours.drive.steering_rad, abs=2e-3)
        assert theirs.drive.speed_mps == pytest.approx(ours.drive.speed_mps, rel=0.02)
        assert theirs.angle_rad == pytest.approx(-ours.angle_rad, abs=1e-3)


def test_a_narrow_way_is_driven_in_its_middle():
    answer = follower(desired_distance_m=1.4).follow(scan_in("corridor"), None)
    assert answer.error_m == pytest.approx(0.0, abs=0.02)


def test_the_requested_speed_is_a_ceiling():
    fast = replace(MOTOR, speed_mps=2.0)
    assert follower(speed_mps=1.0).follow(scan_in("straight"), MOTOR).drive.speed_mps == 1.0
    before_corner = follower(speed_mps=4.0).follow(scan_in("inside_corner", x_m=6.0), fast).drive.speed_mps
    on_straight = follower(speed_mps=4.0).follow(scan_in("straight"), fast).drive.speed_mps
    assert before_corner < 2.5 < on_straight
    careless = follower(speed_mps=4.0, speed_profile=False).follow(scan_in("inside_corner", x_m=6.0), fast)
    assert careless.drive.speed_mps == 4.0


def test_a_car_that_slides_nearer_with_its_wheels_turned_away_goes_slower():
    fast = replace(MOTOR, speed_mps=2.0)

    def speed_mps(y_m, yaw_rad):
        return follower(speed_mps=4.0).follow(scan_in("straight", y_m=y_m, yaw_rad=yaw_rad), fast).drive.speed_mps

    full_mps = speed_limit_mps(0.34, 0.33, 0.65)
    assert speed_mps(0.2, 0.3) == pytest.approx(speed_limit_mps(0.34, 0.33, 0.65 * SLIPPING_SHARE))
    assert speed_mps(0.2, 0.3) < 0.8 * full_mps
    assert speed_mps(-0.2, -0.6) == pytest.approx(full_mps)  # too far away, and coming nearer: as it should be
    assert speed_mps(0.5, -0.1) == pytest.approx(full_mps)  # too near, but leaving
    assert speed_mps(0.06, -0.01) > full_mps  # the wheels could do more


def test_a_narrow_way_is_driven_more_carefully():
    def before_the_corner_mps(right_m):
        walls = [(-5, 1, 2.2, 1), (2.2, 1, 2.2, -9), (-5, -right_m, 1, -right_m)]
        world = World("", SegmentGeometry(np.array(walls, np.float64)), Pose(0.0, 0.0, 0.0))
        ranges_m = true_ranges_m(world, Pose(0.0, 0.0, 0.0), Twist(), LidarSettings(noise_std_m=0.0))
        law = follower(speed_mps=4.0, speed_profile=True, look_ahead_m=0.4)
        return law.follow(scan_of(ranges_m), replace(MOTOR, speed_mps=1.0)).drive.speed_mps

    assert before_the_corner_mps(0.7) < before_the_corner_mps(1.2)
