"""The rolling-ball follower: its path, its law, what it learns, what it does without a wall, and whole drives."""

import math
from dataclasses import replace

import numpy as np
import pytest

from drivers.api import MotorState, Scan
from runtime.control.perception.geometry import Places
from runtime.control.perception.noise_bias import (
    FIRST_NOISE_M,
    MAX_ROUGHNESS_M,
    learn_bias_m,
    learn_noise_m,
    roughness_m,
)
from runtime.control.perception.view import PerceptionCache
from runtime.control.vehicle import CarSettings
from runtime.control.wall_following.ball import LANE_SHARE, BallFollower, half_ahead_m
from runtime.control.wall_following.ball_drive import SLIPPING_SHARE
from runtime.control.wall_following.ball_law import (
    ARC_M,
    ARC_S,
    BENT_PER_M,
    MAX_SLOPE_RAD,
    ROUGH_KD_SHARE,
    STRAIGHT_PER_M,
    TURN_AHEAD_S,
    TURN_M,
    TURN_S,
    Aim,
    Steered,
    approach_rad,
    look_aheads_m,
    pursuit_steering,
    turn_share,
)
from runtime.control.wall_following.ball_path import RADII_M, Ball, BallPath, bend_of, circles_met, roll_ball, roll_path
from runtime.control.wall_following.ball_settings import BallSettings
from runtime.control.wall_following.followed_wall import (
    FollowedWall,
    SideView,
    around,
    choose_wall,
    side_view,
    wall_side,
)
from runtime.control.wall_following.no_wall_policy import FADE_PER_SCAN, Lost
from runtime.control.wall_following.prediction import (
    MAX_WIRE_S,
    WIRE_S,
    Predictor,
    Shift,
    SteeringHistory,
    in_flight,
    learn_wire_delay,
    to_wire_s,
)
from runtime.control.wall_following.speed_profile import speed_limit_mps
from runtime.control.wall_following.wall_fit import CLEAN_INLIERS, WallLine
from sim.car.vehicle import VehicleSettings
from sim.lab.courses.walls import case_of
from sim.lab.limits import limit_m
from sim.virtual.closed_loop import Case, drive
from sim.world.beams import LidarSettings, true_ranges_m
from sim.world.place import World
from sim.world.pose import Pose, Twist
from sim.world.segments import SegmentGeometry
from sim.world.worlds import load_world

CAR = CarSettings()
STEP_RAD = math.radians(0.25)
MOTOR = MotorState(0.0, 0.0, 0.0, 0.0, 11.1, 0.0, 0.0, 30.0, "", timed_out=False, killed=False)
NOTHING_M = np.full(1081, np.nan, np.float32)


def scan_of(ranges_m, number=0, late_s=0.0):
    stamp_s = 0.025 * number
    ranges_m = np.where(np.isfinite(ranges_m), ranges_m, np.nan).astype(np.float32)
    return Scan(stamp_s, stamp_s + late_s, -540 * STEP_RAD, STEP_RAD, 0.02, 30.0, ranges_m, number)


def scan_in(name, x_m=0.0, y_m=0.0, yaw_rad=0.0, side="left", number=0, late_s=0.0):
    world = load_world(name, side=side)
    mirror = 1 if side == "left" else -1
    pose = Pose(x_m, mirror * y_m, mirror * yaw_rad)
    return scan_of(true_ranges_m(world, pose, Twist(), LidarSettings(noise_std_m=0.0)), number, late_s)


def follower(**changes):
    return BallFollower(BallSettings(**changes), CAR, PerceptionCache(CAR))


def wall_m(distance_m, heading_rad=0.0, from_m=-2.0, to_m=5.0):
    along = np.arange(from_m, to_m, 0.05)
    cos, sin = math.cos(heading_rad), math.sin(heading_rad)
    places_m: Places = np.empty(along.size, np.complex128)
    places_m.real, places_m.imag = along * cos - distance_m * sin, along * sin + distance_m * cos
    return places_m


# the path


def ball_path(places_m, ball_m, more_radii_m=()):
    range_m, bearing_rad, _ = around(places_m, 0.0, 0.0, 0.0)
    radii_m = RADII_M + more_radii_m
    return BallPath(radii_m, *circles_met(range_m, bearing_rad, ball_m, radii_m))


def places(path):
    radius_m = np.array(path.radius_m)
    return radius_m * np.cos(path.bearing_rad), radius_m * np.sin(path.bearing_rad)


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


# the law


def along(way, speed_mps=1.0, *, error_m=0.0, line=(math.nan, math.nan), bend=0.0, kp=13.5, kd=4.5):
    """Answer a path that is at the bearing way(r) on the circle of radius r; None where it does not cross it."""
    radii_m = RADII_M + look_aheads_m(0.4, 0.3, speed_mps)
    bearing_rad = [way(r_m) for r_m in radii_m]
    crosses = tuple(rad is not None for rad in bearing_rad)
    path = BallPath(radii_m, tuple(rad or 0.0 for rad in bearing_rad), crosses, crosses)
    return pursuit_steering(path, Aim(error_m, line[0], line[1], bend, speed_mps), Steered(kp, kd, 0.33, 0.0, 0.4))


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


def arc(curvature, speed_mps):
    """The steering of a car without error on an arc."""
    return along(lambda r_m: math.asin(r_m * curvature / 2), speed_mps)[3]


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
    assert speed_mps(0.2, 0.3) < 0.6 * full_mps
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


# what it knows about its own motion


def test_the_car_is_predicted_to_where_the_answer_takes_effect():
    shift = Predictor(0.33, 3.2).shift(0.0, replace(MOTOR, speed_mps=2.0), 0.05 - WIRE_S)
    assert (shift.x_m, shift.y_m, shift.yaw_rad) == pytest.approx((0.1, 0.0, 0.0))
    turning = Predictor(0.33, 1e6).shift(0.0, replace(MOTOR, speed_mps=1.0, steering_rad=0.2), 0.05 - WIRE_S)
    assert turning.yaw_rad == pytest.approx(0.05 * math.tan(0.2) / 0.33)
    trimmed = Predictor(0.33, 1e6).shift(0.0, replace(MOTOR, speed_mps=1.0), 0.05 - WIRE_S, 0.03)
    assert trimmed.yaw_rad == pytest.approx(0.05 * math.tan(0.03) / 0.33)


def test_the_servo_is_known_to_be_slow_and_the_floor_to_be_slippery():
    slow = Predictor(0.33, 3.2)
    motor = replace(MOTOR, speed_mps=1.0, steering_rad=0.34)
    first, second = (slow.shift(stamp_s, motor, 0.03).yaw_rad for stamp_s in (0.0, 0.2))
    assert 0 < first < second
    slipping = Predictor(0.33, 1e6).shift(0.0, replace(MOTOR, speed_mps=4.0, steering_rad=0.34), 0.05 - WIRE_S)
    assert slipping.yaw_rad == pytest.approx(0.05 * 0.8 * 9.81 / 4.0)
    assert slow.shift(1.0, None, 0.05) == Shift()


def test_points_are_seen_from_the_predicted_place():
    range_m, bearing_rad, nearest_m = around(np.array([1.0 + 1.5j, 2.0 + 0.5j]), 1.0, 0.5, math.pi / 2)
    assert nearest_m == pytest.approx(1.0)
    seen = range_m * np.exp(1j * bearing_rad)
    assert seen == pytest.approx(np.array([1.0, -1.0j]))


def test_the_follower_looks_ahead_by_its_latency_and_by_the_age_of_a_late_scan():
    motor = replace(MOTOR, speed_mps=2.0)
    at = {"name": "straight", "yaw_rad": 0.2}
    prompt = follower(latency_s=0.0).follow(scan_in(**at), motor).error_m
    usual = follower(latency_s=0.05).follow(scan_in(**at), motor).error_m  # the way to the wire comes on top of both
    late = follower(latency_s=0.0).follow(scan_in(late_s=0.1, **at), motor).error_m
    assert usual - prompt == pytest.approx(-0.1 * math.sin(0.2), abs=2e-3)
    assert late - prompt == pytest.approx(-0.2 * math.sin(0.2), abs=2e-3)


def heard(wire_s, told, polls=200, poll_s=0.02, scan_s=0.025):
    """Return the wire delay that `SteeringHistory` learns of a motor told each answer wire_s after its scan."""
    answers = SteeringHistory(100.0)
    scans = 0
    for poll in range(polls):
        now_s = poll * poll_s
        while scans * scan_s <= now_s:
            answers.said(scans * scan_s, told(scans))
            scans += 1
        arrived = math.floor((now_s - wire_s) / scan_s + 1e-9)
        if arrived >= 0:
            answers.wire = learn_wire_delay(answers.told, answers.wire, now_s, told(arrived))
    return answers


@pytest.mark.parametrize("wire_s", [0.0, 0.013, 0.04, 0.06, 0.11])
def test_the_way_to_the_wire_is_measured_by_when_the_motor_shows_an_answer(wire_s):
    assert to_wire_s(heard(wire_s, lambda scan: 1e-3 * scan).wire) == pytest.approx(wire_s, abs=0.008)


def test_steady_wheels_strangers_and_very_old_answers_tell_nothing_about_the_wire():
    assert to_wire_s(heard(0.06, lambda _: 0.1).wire) == WIRE_S
    assert to_wire_s(heard(MAX_WIRE_S + 0.05, lambda scan: 1e-3 * scan).wire) == WIRE_S
    stranger = SteeringHistory(100.0)
    stranger.said(0.0, 0.1)
    stranger.wire = learn_wire_delay(stranger.told, stranger.wire, 0.1, 0.2)
    assert to_wire_s(stranger.wire) == WIRE_S
    assert in_flight(stranger.told, stranger.wire, 0.0) == []


def test_the_limiter_before_the_wire_is_reckoned_with():
    answers = SteeringHistory(3.2)
    answers.said(0.0, 0.34)
    answers.said(0.025, 0.34)
    answers.wire = learn_wire_delay(answers.told, answers.wire, 0.05, 0.08)
    assert to_wire_s(answers.wire) == pytest.approx(0.0375)
    assert [angle_rad for _, angle_rad in in_flight(answers.told, answers.wire, 0.05)] == pytest.approx([0.16])


def test_answers_on_their_way_to_the_wire_are_part_of_the_motion():
    plain, knowing = Predictor(0.33, 1e6), Predictor(0.33, 1e6)
    for number in range(4):
        knowing.answers.said(0.025 * number, 0.05 * number)
    motor = replace(MOTOR, stamp_s=0.08, speed_mps=1.0, steering_rad=0.05)  # the second one: 30 to 55 ms to the wire
    expected = knowing.shift(0.08, motor, 0.03).yaw_rad
    assert to_wire_s(knowing.answers.wire) == pytest.approx(0.0425)
    assert expected > 2 * plain.shift(0.08, motor, 0.03).yaw_rad > 0
    assert in_flight(knowing.answers.told, knowing.answers.wire, 9.0) == []  # nobody shows them: somebody else drives


def test_the_bias_of_the_nearest_of_many_noisy_points_is_learnt_while_it_is_credible():
    assert learn_bias_m(0.0, 1.0, 0.96) == pytest.approx(0.004)
    for line_m, nearest_m in ((1.0, 0.8), (1.0, 1.1), (math.nan, 0.96)):
        assert learn_bias_m(0.004, line_m, nearest_m) == 0.004


@pytest.mark.parametrize(("inliers", "learns"), [(100, True), (CLEAN_INLIERS, False)])
def test_it_is_learnt_from_clean_lines_only_and_makes_the_ball_smaller(inliers, learns):
    """So the ball rolls at the wanted distance from the wall, and not from its nearest points."""
    seen = side_view(PerceptionCache(CAR).see(scan_in("straight")), "left")
    found = choose_wall(seen, 1.0, None, 1.0)
    assert found is not None
    wall = FollowedWall(found.beams, WallLine(1.05, 0.0, inliers), 1.0, -1)
    ball = roll_path(seen, wall, Shift(), Ball(0.01, 0.1, 1.0), ())
    assert ball.bias_m == pytest.approx(0.01 + 0.1 * 0.04 if learns else 0.01, abs=1e-4)
    alone = roll_path(seen, FollowedWall(wall.beams, None, 1.0, -1), Shift(), Ball(0.0, 0.1, 1.0 - ball.bias_m), ())
    assert ball.path.bearing_rad == pytest.approx(alone.path.bearing_rad)


NORMAL_M = 0.954
"""The median difference of two numbers with the standard deviation 1."""


@pytest.mark.parametrize("noise_m", [0.002, 0.01, 0.04])
@pytest.mark.parametrize("step_m", [0.0, 0.05])
def test_the_noise_is_learnt_from_beam_to_beam_whatever_the_wall_is_made_of(noise_m, step_m):
    """A wall that every tenth beam sees jump by 5 cm, as one drawn in cells, has hardly more noise."""
    rng = np.random.default_rng(4)
    beams, learnt_m = np.arange(200), FIRST_NOISE_M
    bearing_rad = math.pi / 2 + 0.0044 * (beams - 100)
    for _ in range(60):
        range_m = 1.0 + rng.normal(0.0, noise_m, 200) + step_m * (beams // 10 % 2)
        learnt_m = learn_noise_m(learnt_m, range_m * np.cos(bearing_rad), range_m * np.sin(bearing_rad), beams)
    assert learnt_m == pytest.approx(NORMAL_M * noise_m, rel=0.3)


def test_too_few_beams_tell_no_noise():
    few = np.arange(19)
    assert learn_noise_m(0.02, np.linspace(-1, 1, 19), np.ones(19), few) == 0.02


def test_what_sticks_out_of_a_wall_is_wall_and_no_noise():
    """The car keeps its distance from the nearest part: the ball is made smaller by what is noise only."""
    assert roughness_m(0.03, 0.0186) == pytest.approx(0.03 - 3.6 * 0.0186**1.5)
    assert roughness_m(0.008, 0.0186) == 0.0
    assert roughness_m(0.1, 0.0186) == MAX_ROUGHNESS_M
    seen = side_view(PerceptionCache(CAR).see(scan_in("straight")), "left")
    wall = choose_wall(seen, 1.0, None, 1.0)
    assert wall is not None
    smooth, rough = (roll_path(seen, wall, Shift(), Ball(0.02, noise_m, 1.0), ()) for noise_m in (0.1, 1e-4))
    assert smooth.rough_m == 0.0
    assert rough.rough_m == pytest.approx(rough.bias_m, abs=1e-4)
    assert all(far < near for far, near in zip(rough.path.bearing_rad, smooth.path.bearing_rad, strict=True))


def test_an_arc_that_turns_the_way_the_path_does_has_less_left_for_the_approach():
    """Too near to a wall that bends away: the arc back has to outdo the path's bend, so the car turns back sooner."""
    assert approach_rad(-0.4, 2.0, 1.5, 0.2) == pytest.approx(-approach_rad(0.4, 2.0, 1.5, -0.2))
    assert abs(approach_rad(-0.4, 2.0, 1.5, 0.2)) < abs(approach_rad(-0.4, 2.0, 1.5))
    assert approach_rad(0.4, 2.0, 1.5, 0.2) == approach_rad(0.4, 2.0, 1.5)
    assert approach_rad(-0.4, 2.0, 1.5, 5.0) == pytest.approx(approach_rad(-0.4, 2.0, 1.5, 0.33), rel=0.03)


# without a wall


def test_slow_fades_the_last_steering_and_says_so():
    law = follower(speed_mps=3.0)
    steered = law.follow(scan_in("straight", y_m=-0.1), None).drive.steering_rad
    for number in (1, 2, 3):
        answer = law.follow(scan_of(NOTHING_M, number), MOTOR)
        assert answer.drive.steering_rad == pytest.approx(steered * (1 - FADE_PER_SCAN) ** number)
        assert answer.drive.speed_mps == 0.5
        assert answer.reason.startswith("no wall")
        assert math.isnan(answer.distance_m)
        assert math.isnan(answer.error_m)


def test_a_slow_wish_is_not_sped_up_by_losing_the_wall():
    assert follower(speed_mps=0.3).follow(scan_of(NOTHING_M), MOTOR).drive.speed_mps == 0.3


def test_stop_asks_for_a_stop():
    assert follower(no_wall="stop").follow(scan_of(NOTHING_M), MOTOR).drive is None


@pytest.mark.parametrize(("side", "sign"), [("left", 1), ("right", -1)])
def test_search_turns_towards_the_wanted_side_for_so_many_metres(side, sign):
    law = follower(no_wall="search", side=side, search_at_most_m=1.0)
    moving = replace(MOTOR, speed_mps=0.5)
    answers = [law.follow(scan_of(NOTHING_M, number), moving) for number in range(100)]
    assert answers[0].drive.speed_mps == 0.5
    assert 0.1 < sign * answers[0].drive.steering_rad < 0.34
    searched = [answer.drive is not None for answer in answers]
    assert sum(searched) == pytest.approx(1.0 / (0.5 * 0.025), abs=2)
    assert not any(searched[85:])
    assert "given up" in answers[-1].reason


def test_a_found_wall_ends_the_search_and_the_next_one_is_as_long():
    lost = Lost("search", 0.5, 1.0, 0.18)
    assert lost.drive(0.9)[0] is not None
    lost.found(0.1)
    assert lost.drive(0.9)[0] is not None
    assert lost.drive(0.2)[0] is None


# whole drives (closed loop; noise 0.02 m, 2 % wild beams)


def driven(name, speed_mps, mu=0.8, side="left", way_m=9.0, start=None, seed=1, noise_m=0.02, rolling=True, **car):
    lidar = LidarSettings(noise_std_m=noise_m, outlier_share=0.02)
    world = load_world(name, side=side)
    case = Case(
        world, start or world.start, speed_mps if rolling else 0.0, side=side, distance_m=way_m, duration_s=40.0,
        vehicle=VehicleSettings(grip_mu=mu, **car), lidar=lidar, seed=seed,
        truth=load_world("straight", side=side) if name == "doorway" else None,
    )  # fmt: skip
    run = drive(case, follower(speed_mps=speed_mps, side=side), None)
    assert run.contact is None
    assert run.distance_m >= way_m
    return run


@pytest.mark.parametrize("speed_mps", [1.0, 3.0])
def test_it_settles_on_the_wanted_distance_and_stays_within_a_centimetre(speed_mps):
    start = load_world("straight").start_at(distance_m=0.5, toward_wall_rad=math.radians(20))
    error_m = driven("straight", speed_mps, start=start).error_m
    assert np.abs(error_m[80:]).max() < 0.05
    assert np.abs(error_m[-30:]).max() < 0.01


@pytest.mark.parametrize(
    ("name", "speed_mps", "mu", "way_m", "mean_m"),
    [
        ("inside_corner", 1.0, 0.8, 12.0, 0.03),
        ("inside_corner", 4.0, 0.5, 12.0, 0.12),
        ("outside_corner", 4.0, 0.8, 12.0, 0.02),
        ("doorway", 3.0, 0.8, 12.0, 0.006),
        ("u_turn", 4.0, 0.8, 17.0, 0.05),
        ("u_turn_inner", 2.0, 0.8, 14.0, 0.02),
        ("curved", 2.0, 0.8, 20.0, 0.015),
    ],
)
def test_it_gets_round_without_a_corner_rule(name, speed_mps, mu, way_m, mean_m):
    run = driven(name, speed_mps, mu, side="right" if speed_mps > 2 else "left", way_m=way_m, rolling=False)
    assert np.abs(run.error_m).mean() < mean_m


@pytest.mark.parametrize("side", ["left", "right"])
def test_a_badly_centred_steering_is_learnt_away(side):
    error_m = driven("straight", 2.0, way_m=12.0, trim_rad=0.03, side=side).error_m
    assert np.abs(error_m[-80:]).max() < 0.005


def test_more_noise_does_not_move_the_car():
    error_m = driven("straight", 2.0, way_m=16.0, noise_m=0.05).error_m
    assert abs(error_m[-120:].mean()) < 0.01


@pytest.mark.parametrize("speed_mps", [1.0, 2.0, 3.0])
@pytest.mark.parametrize("name", ["t2", "t4"])
def test_the_way_to_the_wall_is_nearly_the_shortest_there_is(name, speed_mps):
    run = drive(case_of(name, speed_mps, 0.8, "left", 1), follower(speed_mps=speed_mps), None)
    assert np.abs(run.error_m).mean() < 1.2 * limit_m(name, speed_mps, 0.8)


def test_the_loop_is_driven_fast_on_a_good_floor_and_without_contact_on_a_slippery_one():
    world = load_world("loop")
    assert world.lap is not None
    for mu in (0.8, 0.5):
        case = Case(world, distance_m=1.6 * world.lap.length_m, vehicle=VehicleSettings(grip_mu=mu), seed=3)
        run = drive(case, follower(speed_mps=4.0), None)
        assert run.contact is None
        if mu == 0.8:
            assert np.abs(run.error_m).mean() < 0.04
            late = run.time_s > 2.0
            assert run.speed_mps[late, 0].mean() > world.lap.length_m / 9.6


@pytest.mark.parametrize("name", ["t2", "t4", "t5"])
def test_a_rough_car_follows_nearly_as_well_as_a_clean_one(name):
    clean, rough = (
        np.abs(drive(case_of(name + how, 2.0, 0.8, "right", 1), follower(speed_mps=2.0, side="right"), None).error_m)
        for how in ("", " rough")
    )
    assert rough.mean() < 1.4 * clean.mean()
    assert rough[-30:].mean() < 0.015


def test_another_side_mirrors_what_was_learnt_about_the_steering():
    law = follower(speed_mps=2.0)
    drive(case_of("t2 rough", 2.0, 0.8, "left", 1), law, None)
    learnt_rad = law._track.trim_rad
    assert learnt_rad == pytest.approx(0.03, abs=0.004)
    law.tune(BallSettings(side="right", speed_mps=2.0))
    assert law._track.trim_rad == -learnt_rad
    law.tune(BallSettings(side="right", speed_mps=1.0))
    assert law._track.trim_rad == -learnt_rad


@pytest.mark.parametrize("side", ["left", "right"])
def test_the_line_it_tells_of_is_where_the_car_is_now_even_before_a_corner(side):
    """The wall is at 1 m; the error is that of the wall ahead, which is nearer, and of where the car will soon be."""
    moving = replace(MOTOR, speed_mps=3.0)
    told = follower(side=side).follow(scan_in("inside_corner", x_m=7.3, yaw_rad=0.1, side=side), moving)
    sign = 1 if side == "left" else -1
    assert told.line_m == pytest.approx(1.0, abs=0.02)
    assert told.angle_rad == pytest.approx(-sign * 0.1, abs=0.02)
    assert told.distance_m < 0.9
