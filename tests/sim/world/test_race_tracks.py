"""Race tracks from a seed: closed, smooth, of the given width, the same for the same seed."""

import math

import numpy as np
import pytest

from wallride.sim.world.pose import CAR
from wallride.sim.world.race_tracks import MIN_INNER_RADIUS_M, MIN_RADIUS_M, POINT_EVERY_M, race_track
from wallride.sim.world.worlds import load_world

SEEDS = range(8)


def walls_of(track):
    segments = track.geometry.segments_m
    half = len(segments) // 2
    return segments[:half], segments[half:]


@pytest.mark.parametrize("width_m", [1.5, 2.2, 3.0])
def test_tracks_are_closed_smooth_and_of_their_width(width_m):
    for seed in SEEDS:
        track = race_track(seed, width_m, 60.0)
        for wall in walls_of(track):
            assert np.allclose(wall[:, 2:], np.roll(wall[:, :2], -1, axis=0))  # each segment ends where the next begins
            heading = np.arctan2(wall[:, 3] - wall[:, 1], wall[:, 2] - wall[:, 0])
            turn = (np.roll(heading, -1) - heading + math.pi) % math.tau - math.pi
            assert np.abs(turn).max() < math.radians(35)
            assert abs(turn.sum()) == pytest.approx(math.tau)
        outer, inner = walls_of(track)
        centre = track.lap.points_m
        for wall in (outer, inner):
            away_m = np.hypot(*(wall[:, :2] - centre).T)
            assert away_m == pytest.approx(width_m / 2)
        middle = [np.hypot(*(np.vstack([outer, inner])[:, :2] - point).T).min() for point in centre[::5]]
        assert min(middle) > 0.93 * width_m / 2


def test_bends_are_wide_enough_for_the_car():
    for seed in SEEDS:
        centre = race_track(seed, 2.2, 50.0).lap.points_m
        step = np.roll(centre, -1, axis=0) - centre
        heading = np.arctan2(step[:, 1], step[:, 0])
        turn = (np.roll(heading, -4) - heading + math.pi) % math.tau - math.pi
        assert 4 * POINT_EVERY_M / np.abs(turn).max() > 0.9 * max(MIN_RADIUS_M, 1.1 + MIN_INNER_RADIUS_M)


def test_the_start_is_on_the_track_beside_the_outer_wall():
    for seed in SEEDS:
        track = race_track(seed)
        assert track.clearance(track.start, CAR) > 0.3
        assert track.wall_distance_m(track.start) == pytest.approx(1.0, abs=0.02)
        progress_m = track.lap.progress_m(track.start.x_m, track.start.y_m)
        assert min(progress_m, track.lap.length_m - progress_m) < 0.05
        assert track.lap.length_m == pytest.approx(50.0, rel=0.01)
        ahead = track.start.ahead(1.0)
        assert 0.5 < track.lap.progress_m(ahead.x_m, ahead.y_m) < 1.5


def test_a_name_is_a_track_and_another_seed_another_one():
    named = load_world("track:seed=7,width=2.5,length=40")
    assert named.name == "track:seed=7,width=2.5,length=40"
    assert np.array_equal(named.outline_m, race_track(7, 2.5, 40.0).outline_m)
    assert not np.array_equal(race_track(8, 2.5, 40.0).outline_m, named.outline_m)
    assert np.array_equal(load_world("track", seed=3).outline_m, load_world("track:seed=3").outline_m)
    right = load_world("track:seed=7", side="right")
    assert right.side == "right"
    assert right.wall_distance_m(right.start, "right") == pytest.approx(1.0, abs=0.02)


@pytest.mark.parametrize(
    ("name", "words"),
    [
        ("track:", "write track:seed=7"),
        ("track:seed=-1", "write track:seed=7"),
        ("track:seed=1.5", "whole number"),
        ("track:width=9", "width must be 1.2 to 6 m"),
        ("track:length=5", "length must be 25 to 400 m"),
        ("track:width=6,length=25", "make it longer or narrower"),
        ("tracks", "no world is called"),
    ],
)
def test_wrong_names_are_told(name, words):
    with pytest.raises(ValueError, match=words):
        load_world(name)
