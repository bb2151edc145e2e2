"""Dirt is learnt per metre moved, masked while that is safe, refused beyond, and said in words."""

import math

import numpy as np
import pytest

from drivers.api import MotorState, Scan
from runtime.car_settings import CarSettings
from runtime.control.lidar_health import LidarHealth, longest_run, patches, stands_out
from runtime.control.lidar_health_settings import LidarHealthSettings
from runtime.control.perception import Eyes

BEAMS = 1081
STEP_RAD = math.radians(0.25)
MIDDLE = BEAMS // 2


def beam(bearing_deg):
    return MIDDLE + round(bearing_deg * 4)


def room():
    return np.full(BEAMS, 3.0)


def motor(distance_m, steering_rad=0.0):
    return MotorState(0.0, 1.0, distance_m, steering_rad, 12.0, 0.0, 0.0, 20.0, "", timed_out=False, killed=False)


class Drive:
    """Moves a lidar past scans, 5 cm each."""

    def __init__(self):
        self.health = LidarHealth(LidarHealthSettings(), 0.33)
        self.eyes = Eyes(CarSettings())
        self.distance_m = 0.0

    def go(self, ranges_m, way_m, steering_rad=0.0, noise_m=0.02):
        rng = np.random.default_rng(4)
        for _ in range(round(way_m / 0.05) or 1):
            self.distance_m += 0.05 if way_m else 0.0
            noisy = (ranges_m + rng.normal(0, noise_m, BEAMS)).astype(np.float32)
            view = self.eyes.see(Scan(0.0, 0.0, -STEP_RAD * MIDDLE, STEP_RAD, 0.02, 30.0, noisy, 0))
            self.health.update(view, motor(self.distance_m, steering_rad))
        return self.health


def dirty(*patches_deg, range_m=0.2):
    ranges_m = room()
    for first, last in patches_deg:
        ranges_m[beam(first) : beam(last) + 1] = range_m
    return ranges_m


def test_dirt_is_masked_after_a_metre_and_a_half_and_said_in_words():
    drive = Drive()
    assert drive.go(dirty((-96.25, -93.5)), 1.4).mask is None
    health = drive.go(dirty((-96.25, -93.5)), 0.4)
    assert health.mask is not None
    assert np.flatnonzero(health.mask).tolist() == list(range(beam(-96.25), beam(-93.5) + 1))
    assert health.words == ("12 beams around -95 deg are dirty: clean the window",)
    assert health.ceiling_mps == math.inf


def test_a_clean_window_stays_clean():
    health = Drive().go(room(), 5.0)
    assert (health.mask, health.ceiling_mps, health.words) == (None, math.inf, ())


def test_a_parked_car_learns_nothing():
    drive = Drive()
    for _ in range(400):
        health = drive.go(dirty((-96, -93)), 0.0)
    assert health.mask is None


def test_a_wiped_window_is_believed_again():
    drive = Drive()
    assert drive.go(dirty((-96, -93)), 3.0).mask is not None
    assert drive.go(room(), 2.0).mask is None


def test_something_near_that_does_not_keep_its_range_is_no_dirt():
    drive = Drive()
    for range_m in np.random.default_rng(1).uniform(0.05, 0.55, 80):
        health = drive.go(dirty((-96, -93), range_m=range_m), 0.1)
    assert health.mask is None


def test_a_wall_alongside_is_no_dirt():
    ranges_m = room()
    ranges_m[beam(60) : beam(120)] = 0.4
    assert Drive().go(ranges_m, 4.0).mask is None


def spread(width_deg):
    """Seven patches, none of them ahead."""
    return dirty(*[(at, at + width_deg) for at in range(-130, 130, 25) if abs(at) > 50])


def test_much_dirt_is_not_masked_and_slows_the_car():
    health = Drive().go(spread(3.0), 3.0)  # 7 x 13 beams: 8.4 %
    assert health.mask is not None
    assert health.ceiling_mps == math.inf
    health = Drive().go(spread(4.5), 3.0)  # 7 x 19 beams: 12.3 %
    assert health.mask is None
    assert health.ceiling_mps == 1.0
    assert health.reason == "dirty window: clean the lidar"


@pytest.mark.parametrize(("width_deg", "masked"), [(2.75, True), (3.25, False)])
def test_ahead_a_gap_of_three_degrees_is_the_most(width_deg, masked):
    health = Drive().go(dirty((20, 20 + width_deg)), 3.0)
    assert (health.mask is not None) == masked
    assert (health.ceiling_mps == math.inf) == masked


def test_a_quarter_of_the_window_dirty_refuses():
    health = Drive().go(dirty(*[(at, at + 10) for at in range(-130, 120, 30)]), 3.0)
    assert health.ceiling_mps == 0.0
    assert health.reason == "too much dirt: clean the lidar"


def test_almost_no_echo_stops_at_once_and_is_forgiven_at_once():
    drive = Drive()
    ranges_m = np.full(BEAMS, math.nan)
    ranges_m[:100] = 3.0
    health = drive.go(ranges_m, 0.0)
    assert health.ceiling_mps == 0.0
    assert "almost no beam" in health.words[0]
    ranges_m[: round(0.36 * BEAMS)] = 3.0  # a real hall: 64 % without an echo
    assert drive.go(ranges_m, 0.0).ceiling_mps == math.inf


def test_beams_that_stay_dark_while_the_car_turns_are_blind():
    ranges_m = room()
    ranges_m[beam(10) : beam(16)] = math.nan
    straight = Drive().go(ranges_m, 8.0)
    assert straight.words == ()  # a long corridor ahead looks just the same
    turned = Drive().go(ranges_m, 5.0, steering_rad=0.3)
    assert turned.words == ("24 beams around 13 deg see nothing: uncover or clean the window",)
    assert turned.ceiling_mps == 1.0


def test_the_cars_own_parts_are_named_and_harmless():
    ranges_m = room()
    ranges_m[:20] = 0.1
    health = Drive().go(ranges_m, 3.0, noise_m=0.0)
    assert health.words == ("20 beams around -133 deg see the car itself and are ignored",)
    assert health.mask is None  # no need: what lies on the car is no thing anyway
    assert health.ceiling_mps == math.inf


def test_a_changed_lidar_is_learnt_anew():
    drive = Drive()
    drive.go(dirty((-96, -93)), 3.0)
    ranges_m = np.full(541, 3.0, np.float32)
    view = drive.eyes.see(Scan(0.0, 0.0, -math.pi / 2, STEP_RAD, 0.02, 30.0, ranges_m, 0))
    drive.health.update(view, motor(drive.distance_m + 0.2))
    assert drive.health.mask is None


def test_standing_out_needs_both_sides_ten_degrees_away():
    ranges_m = room()
    ranges_m[500:505] = 0.3
    assert np.flatnonzero(stands_out(ranges_m)).tolist() == list(range(500, 505))
    ranges_m[540:545] = 0.4
    assert not stands_out(ranges_m)[500:505].any()
    ranges_m[500:505] = 0.05
    assert stands_out(ranges_m)[500:505].all()


def test_runs_and_patches():
    which = np.array([0, 1, 1, 0, 1, 1, 1, 0], bool)
    assert longest_run(which) == 3
    assert longest_run(np.zeros(4, bool)) == 0
    assert patches(np.zeros(4, bool), np.zeros(4)) == []
    far = np.zeros(40, bool)
    far[[2, 3, 30]] = True
    assert [count for count, _ in patches(far, np.arange(40.0))] == [2, 1]
