"""Obstacles that cross slowly before a driving car, whose odometry knows its heading badly: scan matching tells."""

import math

import numpy as np
import pytest

from tests.runtime.control.corridor_following.course_scenes import report
from wallride.runtime.control.perception.motion.own_motion import MatchedOdometry
from wallride.runtime.control.perception.obstacles.moving_obstacles import MovingObstacles
from wallride.runtime.control.perception.odometry import OdometryState
from wallride.runtime.control.perception.view import ViewCache
from wallride.runtime.control.tyres import Tyres
from wallride.runtime.control.vehicle import CarSettings
from wallride.sim.virtual.closed_loop import ROUGH_BEAMS, as_scan
from wallride.sim.world.beams import scan
from wallride.sim.world.obstacles import ConstantMotion, Obstacle, ObstacleWorld, Round, StandingObstacle
from wallride.sim.world.pose import Pose, Twist
from wallride.sim.world.worlds import load_world

CAR = CarSettings()
SCAN_S = 0.025


def drive(
    *, walking_mps, speed_mps=3.0, drift_radps=0.0, scans=40, world="corridor", learns=True, locks_at=None, radius_m=0.2
):
    """Return, per scan, the predicted points; the odometry turns by drift_radps although the car drives straight on.

    The object stands 5 m ahead and 0.6 m to the left, and walks to the right. locks_at: scan from which the wheels are
    locked and the odometry stands, while the car slides on.
    """
    from_s = 0.0 if walking_mps else 99.0
    walker = Obstacle(
        Round(radius_m), StandingObstacle(Pose(5.0, 0.6, 0.0)), ConstantMotion(0.0, -walking_mps, from_s, 99)
    )
    scene = ObstacleWorld(load_world(world, side="left"), (walker,))
    movers, odometry = MovingObstacles(), MatchedOdometry(Tyres(CAR.wheelbase_m, 0.8, 4.7, 5.5))
    eyes, rng, predicted = ViewCache(CAR), np.random.default_rng(5), []
    for step in range(scans):
        now_s = step * SCAN_S
        pose = Pose(speed_mps * now_s, 0.0, 0.0)
        scene.update(now_s, pose, speed_mps)
        reported_mm = scan(scene, pose, Twist(speed_mps), now_s, rng, ROUGH_BEAMS)
        view = eyes.see(as_scan(reported_mm, ROUGH_BEAMS, now_s, step))
        locked = locks_at is not None and step > locks_at
        told_s, told_mps = (locks_at * SCAN_S, 0.0) if locked else (now_s, speed_mps)
        motor = report(now_s, told_mps, speed_mps * told_s, math.atan(CAR.wheelbase_m * drift_radps / speed_mps))
        motion = odometry.look(now_s, motor)
        wheels = OdometryState(speed_mps=told_mps, yaw_rate_radps=0.0 if locked else drift_radps)
        predicted.append(movers.update(view, wheels, now_s, lambda motion=motion: motion, sliding=locked))
        if learns:
            odometry.learn(view, lost=locked)
    return predicted


def first_seen_s(predicted):
    return next((step * SCAN_S for step, points in enumerate(predicted) if points.size), math.inf)


@pytest.mark.parametrize("walking_mps", [0.5, 0.74])
def test_a_slow_crosser_before_a_fast_car_is_seen_within_half_a_second(walking_mps):
    assert first_seen_s(drive(walking_mps=walking_mps)) <= 0.4
    assert first_seen_s(drive(walking_mps=walking_mps, learns=False)) == math.inf, "by odometry alone it is not"


@pytest.mark.parametrize("drift_radps", [-0.3, 0.3])
def test_a_standing_object_does_not_move_with_the_error_of_the_heading(drift_radps):
    assert first_seen_s(drive(walking_mps=0.0, drift_radps=drift_radps)) == math.inf


@pytest.mark.parametrize("drift_radps", [-0.3, 0.3])
def test_a_slow_crosser_is_seen_in_spite_of_an_error_of_the_heading(drift_radps):
    assert first_seen_s(drive(walking_mps=0.7, drift_radps=drift_radps)) <= 0.5


def test_what_crosses_still_does_while_the_wheels_are_locked():
    predicted = drive(walking_mps=0.9, locks_at=18)
    assert all(points.size for points in predicted[19:30])


def test_a_wide_object_is_seen_to_move_with_scan_matching_only():
    assert first_seen_s(drive(walking_mps=0.9, radius_m=0.45, speed_mps=1.0)) < math.inf
    assert first_seen_s(drive(walking_mps=0.9, radius_m=0.45, speed_mps=1.0, learns=False)) == math.inf
