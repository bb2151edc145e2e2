"""Track of one object: how soon its speed is known, and what counts as motion."""

import numpy as np
import pytest

from tests.runtime.control.scans import SCAN_S, see
from wallride.runtime.control.perception.obstacles.obstacle_track import (
    MAX_SPEED_MPS,
    MotionBounds,
    ObstacleTrack,
    ScanLook,
)
from wallride.sim.virtual.devices import BEAMS

BOUNDS = MotionBounds(0.4, 0.3, 0.0, (0.2, 8), (0.1, 6), 1.0)
LOOK = ScanLook(see(np.full(BEAMS, 9.0)), 0j, 1 + 0j)
"""A hall whose walls are 9 m away: every place before them is free."""


def track_of(speeds_mps, *, at_m=3 - 0.5j, width_m=0.3, noise_m=0.0, bounds=BOUNDS, look=LOOK):
    """Return the track of an object with these velocities (complex), one per scan, judged at every scan."""
    rng = np.random.default_rng(1)
    place_m, track = at_m, None
    half_m = 0.5j * width_m
    for number, speed_mps in enumerate(speeds_mps):
        place_m += speed_mps * SCAN_S
        seen_m = place_m + complex(*rng.normal(0.0, noise_m, 2))
        edges_m = seen_m - half_m, seen_m + half_m
        if track is None:
            track = ObstacleTrack.begin(seen_m, edges_m, number * SCAN_S, look)
        else:
            track.add(seen_m, edges_m, number * SCAN_S, look)
        track.judge(look, abs(seen_m), bounds)
    return track


def test_the_speed_of_a_new_object_is_known_after_a_fifth_of_a_second():
    assert abs(track_of([0.8j] * 9, noise_m=0.005).velocity_mps - 0.8j) < 0.1


def test_what_crosses_moves_and_what_goes_away_does_not():
    assert track_of([0.8j] * 10).moves
    assert track_of([-0.8j] * 10, at_m=3 + 0.5j).moves
    assert not track_of([0.8 + 0j] * 40).moves


def test_what_comes_nearer_has_to_show_more():
    assert track_of([-0.8 + 0j] * 16, at_m=4 + 0j).moves
    assert not track_of([-0.8 + 0j] * 8, at_m=4 + 0j).moves, "0.16 m are no way yet"
    assert not track_of([-0.35 + 0j] * 60, at_m=4 + 0j).moves


@pytest.mark.parametrize(("speed_mps", "scans"), [(0.25j, 60), (1.0j, 5)])
def test_too_slow_or_too_short_is_no_motion(speed_mps, scans):
    assert not track_of([speed_mps] * scans).moves


def test_a_sway_by_a_few_centimetres_is_no_motion():
    assert not track_of([0.6j if (step // 4) % 2 else -0.6j for step in range(60)]).moves


def test_once_it_moves_half_of_the_speed_is_enough():
    begun = [0.8j] * 12
    assert track_of(begun + [0.2j] * 40).moves
    assert not track_of([0.2j] * 52).moves
    assert not track_of(begun + [0j] * 40).moves, "who stops is no longer expected elsewhere"


def test_who_turns_back_is_soon_seen_to_cross_again():
    """The way out must not count against the way back."""
    assert track_of([0.8j] * 40 + [-0.8j] * 14, at_m=3 - 0.5j).moves


def test_two_legs_of_a_table_have_to_show_more_than_a_person():
    assert track_of([0.8j] * 8).moves
    assert not track_of([0.8j] * 8, width_m=0.05).moves
    assert track_of([0.8j] * 13, width_m=0.05).moves


def test_too_wide_or_too_fast_is_something_else():
    assert not track_of([0.8j] * 12, width_m=1.2).moves
    assert not track_of([(MAX_SPEED_MPS + 0.5) * 1j] * 12).moves


def test_the_error_of_the_heading_grows_with_the_distance():
    turning = MotionBounds(0.4, 0.3, 0.3, (0.2, 8), (0.1, 6), 1.0)
    assert track_of([0.8j] * 12, at_m=1 - 0.5j, bounds=turning).moves
    assert not track_of([0.8j] * 12, at_m=4 - 0.5j, bounds=turning).moves


def test_the_way_is_measured_from_a_place_of_the_last_second():
    creeps, sways = [0.03j] * 400, [0.5j] * 5
    assert not track_of(creeps + sways).moves


def test_a_place_that_was_occupied_before_or_still_is_shows_no_motion():
    ranges_m = np.full(BEAMS, 9.0)
    ranges_m[480:600] = 2.73  # a wall 3 m before the rear axle
    wall = ScanLook(see(ranges_m), 0j, 1 + 0j)
    assert track_of([0.8j] * 12, at_m=3 - 0.2j, width_m=0.2).moves
    assert not track_of([0.8j] * 12, at_m=3 - 0.2j, width_m=0.2, look=wall).moves
