"""What is near behind the shoulders is doubted, until it is known for a part of the car or for the world."""

import math

import numpy as np
import pytest

from tests.runtime.control.scans import CAR, SCAN_S, scan_of
from tests.runtime.in_earnest import judged
from wallride.drivers.api import MotorState
from wallride.runtime.control.perception.odometry import OdometryState
from wallride.runtime.control.perception.own_parts import MIN_THROUGH_SCANS, PART_RIM_BEAMS, KnownParts, OwnParts
from wallride.runtime.control.perception.view import ViewCache
from wallride.runtime.control.safety.swept import SweptAssessment, SweptGuard
from wallride.runtime.control.safety.swept_settings import SweptSettings
from wallride.sim.virtual.closed_loop import as_scan
from wallride.sim.world.beams import LidarSettings, scan
from wallride.sim.world.obstacles import Box, ConstantMotion, Obstacle, ObstacleWorld, Round, StandingObstacle
from wallride.sim.world.own_parts import KINDS
from wallride.sim.world.pose import STANDING, Pose
from wallride.sim.world.worlds import load_world

STEP_M = 0.02


class Car:
    """A car that is pushed along beside the things of a world, its wheels turning with it."""

    def __init__(self, own_parts="none", obstacles=(), world="straight", y_m=0.0, seed=1):
        self.lidar = LidarSettings(noise_std_m=0.02, outlier_share=0.02, own_parts=own_parts)
        self.guard = SweptGuard(SweptSettings(), CAR)
        self.scene = ObstacleWorld(load_world(world), obstacles)
        self.rng = np.random.default_rng(seed)
        self.pose = Pose(0.0, y_m, 0.0)
        self.way_m = 0.0
        self.scans = 0
        self.assessment: SweptAssessment

    def look(self, step_m=0.0, wheels_m=None):
        """One scan, after a step; wheels_m: what the wheels say of it."""
        wheels_m = step_m if wheels_m is None else wheels_m
        self.pose = Pose(self.pose.x_m + step_m, self.pose.y_m, 0.0)
        self.way_m += wheels_m
        at_s = SCAN_S * self.scans
        self.scene.update(at_s, self.pose, 0.0)
        reported_mm = scan(self.scene, self.pose, STANDING, at_s, self.rng, self.lidar)
        sweep = as_scan(reported_mm, self.lidar, at_s, self.scans)
        self.assessment = self.guard.look(sweep, MotorState(at_s, wheels_m / SCAN_S, self.way_m, 0.0))
        self.scans += 1
        return self.assessment.view

    def drive(self, way_m, step_m=STEP_M, **how):
        """Go on so far; returns the last view."""
        for _ in range(round(abs(way_m) / STEP_M)):
            view = self.look(math.copysign(step_m, way_m), **how)
        return view


def behind(view, nearer_than_m=0.7):
    """Which beams are behind the shoulders and read so little."""
    return (np.abs(np.degrees(view.bearing_rad)) > 95.0) & (view.ranges_m < nearer_than_m)


def leg(x_m, y_m=0.36):
    return Obstacle(Round(0.06), StandingObstacle(Pose(x_m, y_m, 0.0)))


@pytest.mark.parametrize("kind", KINDS)
def test_no_part_is_solid_from_the_first_scan_on(kind):
    car = Car(kind)
    views = [car.look() for _ in range(60)]  # long enough to see through what is no part
    views += [car.look(STEP_M) for _ in range(60)]
    assert sum(np.count_nonzero(behind(view)) for view in views) > 60
    assert max(np.count_nonzero(view.solid & behind(view)) for view in views) == 0


@pytest.mark.parametrize("kind", KINDS)
def test_parts_are_learnt_on_thirty_centimetres(kind):
    car = Car(kind)
    car.look()
    view = car.drive(0.32)
    own = behind(view) & ~view.own
    if kind == "film":
        own &= view.ranges_m < 0.6  # its rim is a mixture with what is behind
    assert np.count_nonzero(car.guard.perception.own_parts.parts & own) > 0.7 * np.count_nonzero(own)


def test_a_standing_car_learns_no_part():
    car = Car("wide")
    for _ in range(80):
        car.look()
    assert not car.guard.perception.own_parts.parts.any()


def test_a_clean_car_imagines_no_part_beside_walls_and_legs():
    car = Car(y_m=0.6, obstacles=tuple(leg(x_m, -0.3) for x_m in np.arange(0.5, 4.0, 0.37)))
    car.look()
    for _ in range(180):
        car.look(STEP_M)
        assert not car.guard.perception.own_parts.parts.any()


def test_a_wall_close_beside_counts_from_the_first_scan_on():
    car = Car(y_m=0.7)  # the wall is at 1 m
    for step_m in [0.0] * 3 + [STEP_M] * 40:
        view = car.look(step_m)
        assert np.count_nonzero(view.solid & behind(view)) > 0.9 * np.count_nonzero(behind(view))


def test_a_wall_close_beside_a_car_that_backs_is_no_part_of_it():
    """What comes into view at the ends of the fan was not seen before: that proves nothing."""
    car = Car(y_m=0.7)
    car.look()
    for _ in range(40):
        view = car.look(-STEP_M)
        assert not car.guard.perception.own_parts.parts.any()
    assert np.count_nonzero(view.solid & behind(view)) > 0.9 * np.count_nonzero(behind(view))


@pytest.mark.parametrize("kind", ["none", *KINDS])
def test_a_person_who_comes_beside_the_shoulder_of_a_standing_car_counts(kind):
    walk = ConstantMotion(0.0, 0.8, 1.5, 1.5 + 1.25 / 0.8)
    person = Obstacle(Round(0.12), StandingObstacle(Pose(0.12, -1.6, 0.0)), walk)
    car, empty = Car(kind, obstacles=(person,)), Car(kind)
    for _ in range(160):
        view, without = car.look(), empty.look()
    new = behind(view) & ~behind(without, 0.9)
    assert np.count_nonzero(new) > 50
    assert np.count_nonzero(view.solid & new) > 0.6 * np.count_nonzero(new)
    assert not (without.solid & behind(without)).any()


def test_a_cable_that_swings_to_and_fro_stays_in_doubt():
    """It is away for almost a second at a time: its beams have seen through, but not for long enough."""
    parts, eyes = OwnParts(CAR.lidar_x_m), ViewCache(CAR)
    free_m = np.full(1081, 4.0, np.float32)
    cable_m = free_m.copy()
    cable_m[40:60] = 0.4
    for step in range(400):
        seen_m = cable_m if step % (MIN_THROUGH_SCANS + 9) >= MIN_THROUGH_SCANS - 1 else free_m
        eyes.ignore(None, parts.below_m)
        view = eyes.see(scan_of(seen_m, SCAN_S * step, step))
        assert not view.solid[40:60].any() or seen_m is free_m
        parts.update(view, OdometryState())
    assert parts.below_m is not None
    assert not parts.below_m[70:100].any()


@pytest.mark.parametrize("moved_beams", [-PART_RIM_BEAMS, PART_RIM_BEAMS])
def test_a_part_that_is_bent_aside_by_a_rim_stays_in_doubt(moved_beams):
    """The beams beside it have seen through for two seconds, and what they see then is still the part."""
    parts, eyes = OwnParts(CAR.lidar_x_m), ViewCache(CAR)
    for step in range(90):
        seen_m = np.full(1081, 4.0, np.float32)
        first = 40 if step < 80 else 40 + moved_beams
        seen_m[first : first + 20] = 0.4
        eyes.ignore(None, parts.below_m)
        view = eyes.see(scan_of(seen_m, SCAN_S * step, step))
        assert step == 0 or not view.solid[first : first + 20].any(), step
        parts.update(view, OdometryState())
    assert parts.below_m is not None
    assert not parts.below_m[40 + 20 + PART_RIM_BEAMS + abs(moved_beams) : 100].any()


def test_a_leg_beside_the_rear_wheel_counts_as_soon_as_it_is_seen_to_move():
    car = Car(obstacles=(leg(0.17),))
    view = car.look()
    assert np.count_nonzero(behind(view)) > 20
    assert not (view.solid & behind(view)).any()
    moved_m = [
        STEP_M * (step + 1)
        for step in range(5)
        if np.count_nonzero((view := car.look(STEP_M)).solid & behind(view)) > 10
    ]
    assert moved_m
    assert moved_m[0] <= 0.081


def test_what_was_seen_to_move_still_counts_when_the_car_stops():
    car = Car(obstacles=(leg(0.17),))
    car.look()
    car.drive(0.08)
    for _ in range(20):
        view = car.look()
        assert np.count_nonzero(view.solid & behind(view)) > 0.35 * np.count_nonzero(behind(view)) > 5


def test_another_kind_of_lidar_is_doubted_from_its_first_scan_on():
    car = Car("wide")
    car.look()
    car.lidar = car.lidar.model_copy(update={"beams": 721})
    view = car.look()
    assert behind(view).any()
    assert not (view.solid & behind(view)).any()


def test_what_was_seen_before_the_shoulder_counts_behind_it():
    car = Car(obstacles=(leg(0.7),))
    car.look()
    counted = []
    for _ in range(30):
        view = car.look(STEP_M)
        if np.count_nonzero(behind(view)) > 10:
            counted.append(np.count_nonzero(view.solid & behind(view)) / np.count_nonzero(behind(view)))
    assert len(counted) > 5
    assert min(counted) > 0.7


BESIDE = Obstacle(Box(0.05, 0.05), StandingObstacle(Pose(0.16, -0.23, 0.0)))
"""A car that backs with its wheels turned left swings its nose into this, at the right of its middle."""


def backs(car):
    """Whether it may back out for a while with its wheels turned left."""
    car.look()
    view = car.look()
    assert not (view.solid & behind(view)).any()
    assert judged(car.assessment, 1.0, 0.0).forward_mps == math.inf
    return judged(car.assessment, -0.4, 0.34).measure > 0.3


def test_a_car_that_backs_out_heeds_what_is_in_doubt():
    assert backs(Car())
    assert not backs(Car(obstacles=(BESIDE,)))


def test_its_own_parts_do_not_keep_a_car_from_backing_out_once_they_are_known():
    car = Car(obstacles=(BESIDE,))
    view = car.look()
    seen = np.flatnonzero(behind(view, 0.4)).tolist()
    known = KnownParts(view.scan.angle_min_rad, view.scan.angle_step_rad, 1081, tuple((beam, 0.23) for beam in seen))
    car.guard.perception.own_parts.remember(known)
    assert backs(car)


def test_no_part_is_tracked_as_a_person():
    for kind in KINDS:
        car = Car(kind, world="cluttered")
        for _ in range(120):
            view = car.look(0.05)
            tracks = [track.place_m for track in car.guard.perception.movers._tracks if track.scans >= 8]
            pose = car.guard.perception.odometry.pose
            near = [place for place in tracks if abs(place - complex(pose.x_m + CAR.lidar_x_m, pose.y_m)) < 0.6]
            assert [place for place in near if place.real < pose.x_m + 0.2] == [], (kind, view.scan.sequence)


def test_parts_that_are_remembered_are_known_in_the_first_scan():
    taught = Car("mounts")
    taught.look()
    taught.drive(0.4)
    known = taught.guard.perception.own_parts.known
    assert known is not None
    assert len(known.ranges_m) > 30
    car = Car("mounts", seed=7)
    car.guard.perception.own_parts.remember(known)
    car.look()
    assert np.count_nonzero(car.guard.perception.own_parts.parts) == len(known.ranges_m)
    car.drive(0.6)
    assert np.count_nonzero(car.guard.perception.own_parts.parts) >= 0.9 * len(known.ranges_m)


def test_parts_that_are_gone_are_forgotten():
    taught = Car("wide")
    taught.look()
    taught.drive(0.4)
    car = Car()
    car.guard.perception.own_parts.remember(taught.guard.perception.own_parts.known)
    car.look()
    before = car.guard.perception.own_parts.changes
    car.drive(4.0)
    assert not car.guard.perception.own_parts.parts.any()
    assert car.guard.perception.own_parts.changes > before


def test_parts_of_another_kind_of_lidar_are_not_used():
    parts = OwnParts(CAR.lidar_x_m)
    parts.remember(KnownParts(math.radians(-135.0), math.radians(0.5), 541, ((5, 0.3),)))
    car = Car()
    car.guard.perception.own_parts = parts
    car.look()
    assert not parts.parts.any()


def test_wheels_that_turn_while_the_scene_stands_teach_nothing():
    """Wheels up on a bench, whose edge is near on both sides: no dirt and no part of the car."""
    shelves = tuple(
        Obstacle(Box(0.12, 0.12), StandingObstacle(Pose(0.27 + x, y, 0.0)))
        for x, y in ((0.5, 0.0), (0.35, 0.35), (0.35, -0.35), (-0.25, 0.5), (-0.25, -0.5), (0.0, 0.5))
    )
    car = Car(world="cluttered", obstacles=shelves)
    for _ in range(300):
        car.look(0.0, wheels_m=0.03)
    assert car.assessment.window.forward_mps == math.inf
    assert car.guard.perception.health.mask is None
    assert not car.guard.perception.own_parts.parts.any()


def test_a_car_that_drives_is_not_taken_for_one_that_stands():
    for world in ("straight", "corridor", "cluttered", "loop"):
        car = Car("mounts", world=world)
        for _ in range(60):
            car.look(0.04)
            assert not car.guard.perception.scene_motion.stands, world
