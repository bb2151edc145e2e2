"""The follower `corridor`: a way between both borders where one is seen, else what `ball` answers."""

import math
from dataclasses import replace

import numpy as np
import pytest

from tests.runtime.control.corridor_following.course_scenes import (
    BEND,
    CAR,
    CORRIDOR,
    CROSSROADS,
    DEAD_END,
    JUNCTION,
    follower,
    perception,
    report,
    returns_in,
    rolled,
    seen_in,
)
from tests.runtime.in_earnest import is_same
from wallride.runtime.control.corridor_following import corridor_follower
from wallride.runtime.control.corridor_following.corridor_settings import CorridorFollowSettings
from wallride.runtime.control.corridor_following.kept_way import FAR_SCANS, OTHER_SCANS, KeptWay
from wallride.runtime.control.corridor_following.marching import STEP_M, course_of
from wallride.runtime.control.corridor_following.way_speed import HIDDEN_PER_M, WayGrip
from wallride.runtime.control.wall_following.ball import BallFollower
from wallride.runtime.control.wall_following.ball_settings import BallSettings
from wallride.sim.world.pose import Pose


def test_a_straight_corridor_is_driven_straight_and_fast():
    last = rolled(follower(), CORRIDOR, speed_mps=4.8)[-1]
    assert last.reason == corridor_follower.DRIVES
    assert abs(last.drive.steering_rad) < 0.02
    assert last.drive.speed_mps > 4.9
    assert last.promise.path_m[:, 0].tolist() == [0.0, 0.0]
    assert last.promise.path_m[0, -1] > 2.0


@pytest.mark.parametrize(("side", "toward"), [("left", 1), ("right", -1)])
def test_at_a_junction_it_takes_the_way_on_the_followed_side(side, toward):
    one = follower(side=side)
    last = rolled(one, JUNCTION, Pose(3.0, 0.0, 0.0))[-1]
    assert last.reason == corridor_follower.DRIVES
    assert toward * one.path_m[1, -1] > 0.5


def test_left_and_right_are_mirror_images():
    left, right = follower(side="left"), follower(side="right")
    by_left = rolled(left, BEND, Pose(2.0, 0.2, 0.0))[-1]
    by_right = rolled(right, replace(BEND, geometry=BEND.geometry.mirrored()), Pose(2.0, -0.2, 0.0))[-1]
    assert by_right.drive.steering_rad == pytest.approx(-by_left.drive.steering_rad, abs=1e-3)
    assert by_right.drive.speed_mps == pytest.approx(by_left.drive.speed_mps, abs=0.02)


def test_in_a_dead_end_it_answers_as_ball_does():
    one, ball = follower(), BallFollower(BallSettings(speed_mps=6.0), CAR, perception().views)
    for by_corridor, by_ball in zip(rolled(one, DEAD_END), rolled(ball, DEAD_END), strict=True):
        assert is_same(by_corridor, replace(by_ball, reason=corridor_follower.BY_BALL))


def test_without_a_motor_it_answers_as_ball_does():
    one = follower()
    rolled(one, CORRIDOR)
    assert one.follow(seen_in(CORRIDOR, stamp_s=0.3, number=12), None).reason == corridor_follower.BY_BALL


def test_the_speed_lets_it_brake_to_the_end_of_sight():
    """The end of sight is beside the inner corner, a metre away from it; from there on a corner is driven."""
    grip = WayGrip.of(0.65, 6.0)
    at_the_corner_mps = rolled(follower(), BEND, Pose(2.6, 0.0, 0.0), speed_mps=3.0)[-1].drive.speed_mps
    before_mps = rolled(follower(), BEND, Pose(0.0, 0.0, 0.0), speed_mps=3.0)[-1].drive.speed_mps
    last_mps = math.sqrt(grip.lateral_mps2 / HIDDEN_PER_M)
    assert at_the_corner_mps < before_mps < math.sqrt(last_mps**2 + 2 * grip.brake_mps2 * 6.0)
    assert before_mps > last_mps


def test_noise_does_not_make_it_weave():
    steering_rad = [one.drive.steering_rad for one in rolled(follower(), CORRIDOR, scans=60, noise_m=0.02)[10:]]
    assert np.abs(steering_rad).max() < 0.02


def test_the_near_part_of_the_way_stays_as_it_is():
    one, paths = follower(), []
    for k in range(20):
        one.follow(seen_in(BEND, Pose(0.05 * k, 0.1, 0.0), 0.025 * k, k, 0.02), report(0.025 * k, 2.0, 0.05 * k))
        paths.append((one.path_m[0] + 0.05 * k) + 1j * (one.path_m[1] + 0.1))
    before, after = paths[-2:]
    near = (before.real > 0.05 * 20) & (before.real < 0.05 * 20 + 0.5)
    off_m = np.abs(before[near][:, None] - after).min(axis=1)
    assert off_m.max() < 0.01


def test_the_same_scans_are_answered_alike():
    first, again = (rolled(follower(), BEND, Pose(1.0, 0.2, 0.1), scans=20, noise_m=0.02) for _ in range(2))
    for one, other in zip(first, again, strict=True):
        assert one.drive == other.drive
        assert one.promise is other.promise is None or (one.promise.path_m == other.promise.path_m).all()


def test_another_side_begins_a_new_way():
    one = follower(side="left")
    rolled(one, JUNCTION, Pose(3.0, 0.0, 0.0))
    one.tune(CorridorFollowSettings(side="right", speed_mps=6.0))
    for k in range(12, 30):
        one.follow(seen_in(JUNCTION, Pose(3.55, 0.0, 0.0), 0.025 * k, k), report(0.025 * k, 0.0, 0.55))
    assert one.path_m[1, -1] < -0.5


def test_after_a_standstill_it_follows_the_wall_for_some_metres():
    one, reasons, way_m = follower(), [], 0.0
    for k in range(250):
        speed_mps = 0.0 if k < 30 else 2.0
        way_m += 0.025 * speed_mps
        answer = one.follow(seen_in(CORRIDOR, Pose(way_m, 0.0, 0.0), 0.025 * k, k), report(0.025 * k, speed_mps, way_m))
        reasons.append((way_m, answer.reason))
    assert reasons[15][1] == corridor_follower.DRIVES  # it has not stood for long yet
    assert {reason for at_m, reason in reasons[22:] if at_m < corridor_follower.WALL_M} == {corridor_follower.BY_BALL}
    assert reasons[-1][1] == corridor_follower.DRIVES


def gaps_of(kept, returns, scans):
    straight_m = STEP_M * np.arange(40, dtype=np.float64).astype(np.complex128)
    return [kept._gap(returns, straight_m, course_of(straight_m)) for _ in range(scans)]


@pytest.mark.parametrize(("x_m", "scans"), [(3.0, OTHER_SCANS), (0.5, FAR_SCANS)], ids=["near", "far"])
def test_another_gap_is_taken_only_once_it_has_come_first_for_some_scans(x_m, scans):
    returns = returns_in(CROSSROADS, Pose(x_m, 0.0, 0.0))
    found = gaps_of(KeptWay(), returns, scans)
    own, first = found[0][0], returns.gaps[0]
    assert own is not None
    assert own != first
    assert found == [(own, True)] * (scans - 1) + [(first, False)]


def test_a_gap_that_is_measured_less_wide_is_kept_for_some_scans():
    returns = returns_in(CROSSROADS, Pose(3.0, 0.0, 0.0))
    own = gaps_of(KeptWay(), returns, 1)[0][0]
    others = tuple(gap for gap in returns.gaps if gap > own)
    found = gaps_of(KeptWay(), replace(returns, gaps=others), OTHER_SCANS)
    assert found == [(own, True)] * (OTHER_SCANS - 1) + [(others[0], False)]
    assert gaps_of(KeptWay(), replace(returns, gaps=others, kept=others), 1) == [(others[0], True)]
