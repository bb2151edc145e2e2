"""The follower's knowledge of its own motion, of delays and of noise."""

import math
from dataclasses import replace

import numpy as np
import pytest

from tests.runtime.control.scans import CAR
from tests.runtime.control.wall_following.ball_scenes import MOTOR, follower, scan_in
from wallride.runtime.control.perception.noise_bias import (
    FIRST_NOISE_M,
    MAX_ROUGHNESS_M,
    learn_bias_m,
    learn_noise_m,
    roughness_m,
)
from wallride.runtime.control.perception.view import ViewCache
from wallride.runtime.control.wall_following.ball_law import approach_rad
from wallride.runtime.control.wall_following.ball_path import Ball, roll_path
from wallride.runtime.control.wall_following.followed_wall import FollowedWall, around, choose_wall, side_view
from wallride.runtime.control.wall_following.prediction import (
    MAX_WIRE_S,
    WIRE_S,
    Predictor,
    Shift,
    SteeringHistory,
    in_flight,
    learn_wire_delay,
    to_wire_s,
)
from wallride.runtime.control.wall_following.wall_fit import CLEAN_INLIERS, WallLine


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
    assert in_flight(knowing.answers.told, knowing.answers.wire, 9.0) == []  # never displayed: another driver steers


def test_the_bias_of_the_nearest_of_many_noisy_points_is_learnt_while_it_is_credible():
    assert learn_bias_m(0.0, 1.0, 0.96) == pytest.approx(0.004)
    for line_m, nearest_m in ((1.0, 0.8), (1.0, 1.1), (math.nan, 0.96)):
        assert learn_bias_m(0.004, line_m, nearest_m) == 0.004


@pytest.mark.parametrize(("inliers", "learns"), [(100, True), (CLEAN_INLIERS, False)])
def test_it_is_learnt_from_clean_lines_only_and_makes_the_ball_smaller(inliers, learns):
    """So the ball rolls at the wanted distance from the wall, and not from its nearest points."""
    seen = side_view(ViewCache(CAR).see(scan_in("straight")), "left")
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
    seen = side_view(ViewCache(CAR).see(scan_in("straight")), "left")
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
