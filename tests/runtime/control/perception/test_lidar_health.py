"""Dirt is learnt per metre moved, masked while that is safe, refused beyond, and said in words."""

import math

import numpy as np
import pytest

from tests.runtime.control.scans import BEARING_RAD, CAR, MIDDLE, scan_of
from wallride.drivers.api import MotorState, Scan
from wallride.runtime.control.perception.lidar_health import LidarHealth
from wallride.runtime.control.perception.lidar_health_settings import LidarHealthSettings
from wallride.runtime.control.perception.view import ViewCache
from wallride.runtime.control.perception.window_dirt import (
    beside_echoes,
    patches,
    runs,
    runs_longer_than,
    runs_with,
    stands_out,
)
from wallride.sim.virtual.devices import BEAMS, STEP_RAD


def beam(bearing_deg):
    return MIDDLE + round(bearing_deg * 4)


def room():
    return np.full(BEAMS, 3.0)


def motor(distance_m, steering_rad=0.0):
    return MotorState(0.0, 1.0, distance_m, steering_rad)


class Drive:
    """Moves a lidar past scans, 5 cm each."""

    def __init__(self):
        self.health = LidarHealth(LidarHealthSettings(), 0.33)
        self.eyes = ViewCache(CAR)
        self.distance_m = 0.0

    def go(self, ranges_m, way_m, steering_rad=0.0, noise_m=0.02, range_max_m=30.0):
        rng = np.random.default_rng(4)
        for _ in range(round(way_m / 0.05) or 1):
            self.distance_m += 0.05 if way_m else 0.0
            view = self.eyes.see(scan_of(ranges_m + rng.normal(0, noise_m, BEAMS), to_m=range_max_m))
            self.health.update(view, motor(self.distance_m, steering_rad))
        return self.health


def masked(health):
    """Return the beams that are ignored, as a range where there is no gap between them."""
    assert health.mask is not None
    beams = np.flatnonzero(health.mask).tolist()
    whole = range(beams[0], beams[-1] + 1)
    return whole if beams == list(whole) else beams


def dirty(*patches_deg, range_m=0.2):
    ranges_m = room()
    for first, last in patches_deg:
        ranges_m[beam(first) : beam(last) + 1] = range_m
    return ranges_m


def test_dirt_is_masked_after_a_metre_and_a_half_and_said_in_words():
    drive = Drive()
    assert drive.go(dirty((-96.25, -93.5)), 1.4).mask is None
    health = drive.go(dirty((-96.25, -93.5)), 0.4)
    assert masked(health) == range(beam(-96.25), beam(-93.5) + 1)
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
    health = drive.go(room(), 2.0)
    assert (health.mask, health.words) == (None, ())


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
    assert (health.mask, health.ceiling_mps, health.reason) == (None, 1.0, "dirty window: clean the lidar")


@pytest.mark.parametrize(("width_deg", "is_masked"), [(2.75, True), (3.25, False)])
def test_ahead_a_gap_of_three_degrees_is_the_most(width_deg, is_masked):
    health = Drive().go(dirty((20, 20 + width_deg)), 3.0)
    assert (health.mask is not None, health.ceiling_mps == math.inf) == (is_masked, is_masked)


def test_a_quarter_of_the_window_dirty_refuses():
    health = Drive().go(dirty(*[(at, at + 10) for at in range(-130, 120, 30)]), 3.0)
    assert (health.ceiling_mps, health.reason) == (0.0, "too much dirt: clean the lidar")


def test_almost_no_echo_stops_at_once_and_is_forgiven_at_once():
    drive = Drive()
    ranges_m = np.full(BEAMS, math.nan)
    ranges_m[:100] = 3.0
    health = drive.go(ranges_m, 0.0)
    assert health.ceiling_mps == 0.0
    assert "almost no beam" in health.words[0]
    ranges_m[: round(0.36 * BEAMS)] = 3.0  # a real hall: 64 % without an echo
    assert drive.go(ranges_m, 0.0).ceiling_mps == math.inf


def test_a_sensor_of_little_range_may_see_less_of_a_room_before_it_counts_as_covered():
    """A wall at 3.9 m fills 25 of 270 degrees of a sensor that sees 4 m."""
    ranges_m = np.full(BEAMS, math.nan)
    ranges_m[beam(78) : beam(103)] = 3.9
    assert Drive().go(ranges_m, 0.0, range_max_m=4.0).ceiling_mps == math.inf
    assert Drive().go(ranges_m, 0.0, range_max_m=10.0).ceiling_mps == 0.0
    ranges_m[beam(85) : beam(103)] = math.nan
    assert Drive().go(ranges_m, 0.0, range_max_m=4.0).ceiling_mps == 0.0


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
    assert health.words == ("20 beams around -133 deg see the car itself, or dirt, and are ignored",)
    assert (health.mask, health.ceiling_mps) == (None, math.inf)  # no need: what lies on the car is no thing anyway


def test_a_changed_lidar_is_learnt_anew():
    drive = Drive()
    drive.go(dirty((-96, -93)), 3.0)
    ranges_m = np.full(541, 3.0, np.float32)
    view = drive.eyes.see(Scan(0.0, 0.0, -math.pi / 2, STEP_RAD, 0.02, 30.0, ranges_m, 0))
    drive.health.update(view, motor(drive.distance_m + 0.2))
    assert drive.health.mask is None


def test_standing_out_needs_both_sides_ten_or_fifteen_degrees_away():
    ranges_m = room()
    ranges_m[500:505] = 0.3
    smudge = set(range(500, 505))
    assert stands_out(ranges_m).tolist() == sorted(smudge)
    ranges_m[540:545] = 0.4
    assert smudge <= set(stands_out(ranges_m)), "two smudges may lie ten degrees apart"
    ranges_m[540:565] = 0.4
    assert not smudge & set(stands_out(ranges_m))
    ranges_m[500:505] = 0.05
    assert smudge <= set(stands_out(ranges_m))


def test_runs_and_patches():
    which = np.array([0, 1, 1, 0, 1, 1, 1, 0], bool)
    assert runs(which) == [(1, 3), (4, 7)]
    assert runs_longer_than(which, 2).tolist() == [False] * 4 + [True] * 3 + [False]
    assert runs_with(which, np.array([0, 0, 1, 0, 0, 0, 0, 0], bool)).tolist() == [False, True, True] + [False] * 5
    assert runs(np.zeros(4, bool)) == []
    assert patches(np.zeros(4, bool), np.zeros(4)) == []
    far = np.zeros(40, bool)
    far[[2, 3, 30]] = True
    assert [count for count, _ in patches(far, np.arange(40.0))] == [2, 1]


def test_a_wide_smudge_at_the_rear_is_masked_before_anything_else():
    """As on a real car: 13 degrees at the left rear, wider than the ten degrees that its middle is compared with."""
    drive = Drive()
    assert drive.go(dirty((122, 135), range_m=0.55), 0.6).mask is None
    health = drive.go(dirty((122, 135), range_m=0.55), 0.4)
    assert masked(health) == range(beam(122), BEAMS)
    assert health.words == ("53 beams around 129 deg see the car itself, or dirt, and are ignored",)


def test_a_part_of_the_car_is_known_after_a_third_of_a_metre():
    drive = Drive()
    assert drive.go(dirty((122, 135), range_m=0.35), 0.2).mask is None
    assert drive.go(dirty((122, 135), range_m=0.35), 0.25).mask is not None


def test_a_part_of_the_car_that_answers_now_and_then_is_masked_all_the_same():
    """As on another real car: between the returns of a black part, silence. Silence ahead is no such thing."""
    drive, silent = Drive(), dirty((122, 135), (60, 62), range_m=math.nan)
    for _ in range(60):
        drive.go(dirty((122, 135), (60, 62), range_m=0.3), 0.05)
        health = drive.go(silent, 0.15)
    assert masked(health) == range(beam(122), BEAMS)


def test_what_the_car_passes_is_not_taken_for_a_part_of_it():
    """A post of 10 cm, half a metre beside the car's way, between others: it moves along the beams."""
    drive = Drive()
    for step in range(120):
        ranges_m = room()
        x_m = 1.0 - (0.05 * step) % 2.0
        at_deg, away_m = math.degrees(math.atan2(-0.3, x_m)), math.hypot(x_m, 0.3)
        half_deg = math.degrees(0.05 / away_m)
        ranges_m[max(0, beam(at_deg - half_deg)) : max(0, beam(at_deg + half_deg))] = away_m
        assert drive.go(ranges_m, 0.05).mask is None


@pytest.mark.parametrize("side", [1, -1])
def test_the_wall_beside_the_tail_is_not_taken_for_a_part_of_the_car(side):
    """However long the car follows it at the same distance: a wall goes on beside the shoulders."""
    aside = np.maximum(side * np.sin(BEARING_RAD), 0.05)
    assert Drive().go(np.minimum(0.17 / aside, 3.0), 6.0).mask is None


def test_the_cars_own_parts_take_nothing_from_the_view_ahead():
    """A sixth of all beams see its rack or dirt, but of those that look where it drives only a thirteenth."""
    health = Drive().go(dirty((-135, -120), (120, 135), (-90, -82), (82, 90), range_m=0.3), 2.0)
    assert health.mask is not None
    assert health.ceiling_mps == math.inf


def test_the_blurred_rim_of_a_smudge_belongs_to_it():
    """The rim lets some of the wall behind through: it is near in one scan of two."""
    drive, sharp = Drive(), dirty((60, 63))
    blurred = dirty((58, 65))
    for _ in range(30):
        drive.go(blurred, 0.1)
        health = drive.go(sharp, 0.1)
    assert (masked(health)[0], masked(health)[-1]) == (beam(58), beam(65))
    for _ in range(60):
        health = drive.go(sharp, 0.1)
    assert masked(health) == range(beam(60), beam(63) + 1), "nothing left of the rim"


def test_what_is_too_wide_to_be_ignored_ahead_does_not_unmask_the_rest():
    health = Drive().go(dirty((20, 26), (-120, -116)), 3.0)
    assert masked(health) == range(beam(-120), beam(-116) + 1)
    assert health.ceiling_mps == 1.0


def test_in_the_open_darkness_says_nothing_about_the_window():
    drive = Drive()
    for edge_deg in [*range(-40, 41, 4), *range(40, -41, -4)] * 4:  # the car turns to and fro, 2.7 degrees a step
        ranges_m = np.full(BEAMS, math.nan)
        ranges_m[beam(edge_deg) :] = 3.0  # a wall; nothing at all on the right
        assert drive.go(ranges_m, 0.05, steering_rad=0.3).words == ()


def test_darkness_counts_only_beside_what_is_seen():
    dark = np.ones(400, np.bool_)
    dark[:100] = False
    beside = beside_echoes(dark)
    assert beside[:130].all()
    assert not beside[160:].any()


WIDELY = tuple((first_deg, first_deg + 8) for first_deg in range(-100, 100, 24))


def test_a_car_refused_for_dirt_is_let_go_when_it_was_wiped():
    drive = Drive()
    health = drive.go(dirty(*WIDELY), 3.0)
    assert (health.ceiling_mps, health.reason) == (0.0, "too much dirt: clean the lidar")
    for number in range(160):
        ranges_m = dirty(*WIDELY) if number < 80 else room()
        health.update(drive.eyes.see(scan_of(ranges_m, 10 + 0.025 * number)), motor(drive.distance_m))
        assert (health.ceiling_mps == 0.0) or number > 100
    assert health.ceiling_mps == math.inf
