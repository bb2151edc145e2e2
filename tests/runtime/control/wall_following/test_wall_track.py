"""The tracked wall: quieter than one scan's line, quick to believe in another wall, and it learns the trim."""

import math

import numpy as np
import pytest

from wallride.runtime.control.wall_following.wall_fit import CLEAN_INLIERS, WallLine
from wallride.runtime.control.wall_following.wall_track import MAX_TRIM_RAD, WallTrack

L_M = 0.33


class Car:
    """Rolls along a wall at y = 1 as a kinematic single-track car whose wheels stand off the middle."""

    def __init__(self, speed_mps=2.0, trim_rad=0.0, noise=0.0, seed=1):
        self.track = WallTrack(L_M)
        self.rng = np.random.default_rng(seed)
        self.y_m, self.yaw_rad = 0.0, 0.0
        self.speed_mps, self.trim_rad, self.noise = speed_mps, trim_rad, noise

    def scan(self, wheel_rad=0.0, inliers=120):
        way_m = self.speed_mps * 0.025
        turn_rad = way_m * math.tan(wheel_rad + self.trim_rad) / L_M
        self.y_m += way_m * math.sin(self.yaw_rad + turn_rad / 2)
        self.yaw_rad += turn_rad
        noise_m, noise_rad = self.rng.normal(0.0, self.noise, 2) if self.noise else (0.0, 0.0)
        self.track.expect(way_m, wheel_rad, self.speed_mps)
        return self.track.correct(WallLine(1.0 - self.y_m + noise_m, -self.yaw_rad + noise_rad, inliers))

    def weave(self, scans, most_rad=0.02):
        """Drive on, holding the wall; yield the tracked line and what is true, line by line."""
        for _ in range(scans):
            wanted_rad = -2.0 * self.yaw_rad - 1.0 * self.y_m - self.trim_rad
            line = self.scan(min(max(wanted_rad, -most_rad - self.trim_rad), most_rad - self.trim_rad))
            yield line.distance_m - (1.0 - self.y_m), line.heading_rad + self.yaw_rad


def test_without_noise_the_line_is_the_line():
    off = np.array(list(Car().weave(40)))
    assert off == pytest.approx(0.0, abs=1e-6)


def test_noise_is_halved():
    off = np.array(list(Car(noise=0.004).weave(400)))[40:]
    assert off[:, 0].std() < 0.5 * 0.004
    assert off[:, 1].std() < 0.5 * 0.004


@pytest.mark.parametrize("trim_rad", [-0.04, 0.03])
@pytest.mark.parametrize("speed_mps", [1.0, 3.0])
def test_the_trim_is_learnt_within_two_seconds(trim_rad, speed_mps):
    car = Car(speed_mps, trim_rad, noise=0.002)
    list(car.weave(80))
    assert car.track.trim_rad == pytest.approx(trim_rad, abs=0.004)


def test_the_trim_is_never_thought_to_be_more_than_can_be():
    car = Car(trim_rad=0.2, speed_mps=1.0)
    for _ in range(60):
        car.scan()
        car.y_m = car.yaw_rad = 0.0
        assert abs(car.track.trim_rad) <= MAX_TRIM_RAD


def test_in_a_bend_and_soon_after_it_the_trim_learns_nothing():
    car = Car(speed_mps=3.0, trim_rad=0.03)
    for _ in range(20):
        car.scan(0.2)
    assert car.track.trim_rad == 0.0
    for _ in range(5):
        car.scan(-0.03)
    assert car.track.trim_rad == 0.0
    for _ in range(60):
        car.scan(-0.03)
    assert car.track.trim_rad == pytest.approx(0.03, abs=0.004)


def test_wheels_that_are_behind_the_wire_are_no_trim():
    """A car that follows its steering one scan late and weaves so fast that the two differ by more than a trim."""
    car = Car(speed_mps=3.0)
    told_rad = turned_rad = 0.0
    for number in range(200):
        turned_rad, told_rad = told_rad, 0.04 * math.sin(number)
        way_m = 0.075
        turn_rad = way_m * math.tan(turned_rad) / L_M
        car.yaw_rad += turn_rad
        car.track.expect(way_m, told_rad, 3.0)
        car.track.correct(WallLine(1.0, -car.yaw_rad, 120))
        assert abs(car.track.trim_rad) < 0.012


def test_the_first_step_from_a_new_line_teaches_no_trim():
    """A line of one scan is off by more than a trim turns the car: two of them fake one of 30 mrad."""
    track = WallTrack(L_M)
    for heading_rad in (0.0, 0.02):
        track.expect(0.075, 0.0, 3.0)
        track.correct(WallLine(1.0, heading_rad, 120))
    assert track.trim_rad == 0.0
    for _ in range(40):
        track.expect(0.075, 0.03, 3.0)  # held straight with turned wheels
        track.correct(WallLine(1.0, 0.02, 120))
    assert track.trim_rad == pytest.approx(-0.03, abs=0.006)


def test_a_wall_that_bends_with_the_car_is_no_trim():
    for straight, learnt_rad in ((True, 0.03), (False, 0.0)):
        track = WallTrack(L_M)
        for _ in range(80):  # the wheels are turned, and the wall stays where it is
            track.expect(0.05, -0.03, 2.0, straight=straight)
            track.correct(WallLine(1.0, 0.0, 120))
        assert track.trim_rad == pytest.approx(learnt_rad, abs=0.004)


def test_a_car_that_slips_in_a_bend_is_believed_where_it_is_seen():
    car = Car(speed_mps=3.0)
    for _ in range(12):
        car.track.expect(0.075, 0.3, 3.0)  # the wheels promise 0.07 rad per scan, the wall turns by 0.04
        car.yaw_rad += 0.04
        line = car.track.correct(WallLine(1.0, -car.yaw_rad, 120))
        assert line is not None
        assert line.heading_rad == pytest.approx(-car.yaw_rad, abs=0.012)


@pytest.mark.parametrize(
    "other", [WallLine(1.2, 0.0, 120), WallLine(0.8, 0.0, 120), WallLine(1.0, 0.2, 120), WallLine(1.0, -0.2, 120)]
)
def test_another_wall_is_taken_at_once_and_leaves_the_trim(other):
    car = Car(trim_rad=0.02, noise=0.001)
    list(car.weave(80))
    trim_rad = car.track.trim_rad
    car.track.expect(0.05, 0.0, 2.0)
    moved = WallLine(other.distance_m - car.y_m, other.heading_rad - car.yaw_rad, 120)
    assert car.track.correct(moved) == moved
    assert car.track.trim_rad == trim_rad


@pytest.mark.parametrize("gone", [None, WallLine(1.0, 0.0, CLEAN_INLIERS)])
def test_no_clean_line_is_nothing_to_track(gone):
    track = WallTrack(L_M)
    assert track.expect(0.05, 0.0, 2.0) is None
    assert track.correct(WallLine(1.0, 0.0, CLEAN_INLIERS + 1)) is not None
    assert track.expect(0.05, 0.0, 2.0) is not None
    assert track.correct(gone) is None
    assert track.expect(0.05, 0.0, 2.0) is None


def test_on_the_other_side_the_trim_is_mirrored_and_the_wall_forgotten():
    car = Car(trim_rad=0.02)
    list(car.weave(80))
    trim_rad = car.track.trim_rad
    car.track.mirror()
    assert car.track.trim_rad == -trim_rad
    assert car.track.expect(0.05, 0.0, 2.0) is None
