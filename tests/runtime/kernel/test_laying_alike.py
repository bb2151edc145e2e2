"""Scans are laid over the lines of a map, and over earlier scans, alike: near the truth and far from it."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from tests.runtime.control.localization.rooms import LIDAR_M, corridor, ring
from tests.runtime.control.perception.motion.test_scan_matching import room as in_a_room
from tests.runtime.kernel.sameness import other_lengths_are_refused, same
from wallride.drivers.accelerated import FUNCTIONS
from wallride.runtime.calibration.scan_motion import ReferenceScan
from wallride.runtime.calibration.stop_match import surfaces
from wallride.runtime.control.localization.line_field import field_of_cells
from wallride.runtime.control.localization.pose_filter import PoseFilter, inverse
from wallride.runtime.control.localization.scan_points import AxleMotion, scan_points
from wallride.runtime.control.perception.motion.scan_matching import DRIFT, SLIDE, ScanPose, surfaces_of
from wallride.sim.world.worlds import load_world

PLACES = ((9.6, 0.2, 0.4), (-0.2, 3.0, -1.5), (10.1, 5.6, 3.0))


@pytest.fixture(scope="module")
def seen():
    """Return scans of two rooms, each with the field of its map and the pose from which it was taken."""
    rooms = [(room, field_of_cells(room.cells)) for room in (ring(), corridor())]
    motion = AxleMotion(2.0, 0.05, 0.4)
    return [
        (scan_points(room.scan(pose, noise_m=0.01), complex(LIDAR_M), motion), field, pose)
        for room, field in rooms
        for pose in PLACES
    ]


def arguments(one, off, std):
    """Return the arguments of the C for a scan that is laid beside the pose from which it was taken."""
    points, field, pose = one
    covariance = np.diag(np.square(std))
    covariance[0, 1] = covariance[1, 0] = 0.4 * std[0] * std[1]
    at = tuple((np.array(pose) + off).tolist())
    before = tuple(covariance.ravel().tolist())
    return FUNCTIONS["lay_on_lines"].flat(field, points, at, before, inverse(before))


@settings(max_examples=150)
@given(
    which=st.integers(0, 2 * len(PLACES) - 1),
    off=st.tuples(st.floats(-0.5, 0.5), st.floats(-0.5, 0.5), st.floats(-0.3, 0.3)),
    far_m=st.sampled_from([0.0, 0.0, 3.0, -1e5, 1e9]),
    std=st.tuples(*[st.floats(0.002, 0.5)] * 3),
    beams=st.sampled_from([None, 0, 1, 2, 15]),
)
def test_any_scan_is_laid_alike(compiled, seen, which, off, far_m, std, beams):
    given_ = arguments(seen[which], (off[0] + far_m, *off[1:]), std)
    given_ = (*(row[:beams] for row in given_[:3]), *given_[3:])
    same(compiled, "lay_on_lines", *given_)


def test_a_filter_is_corrected_alike(compared, seen):
    for points, field, (x_m, y_m, yaw_rad) in seen[: len(PLACES)]:
        follower = PoseFilter(field, 0.33)
        follower.place(x_m + 0.05, y_m - 0.04, yaw_rad + 0.03, 0.1, 0.05)
        follower.correct(points)
        assert follower.state[:3].tolist() == pytest.approx((x_m, y_m, yaw_rad), abs=0.02)
    assert compared["lay_on_lines"] == len(PLACES)


@pytest.mark.parametrize("place", [8, 9, 10, 13, 15])
@pytest.mark.parametrize("value", [math.nan, math.inf, 1e300])
def test_what_is_no_number_reads_nothing_outside_of_the_map(compiled, seen, place, value):
    given_ = list(arguments(seen[0], np.zeros(3), (0.1, 0.1, 0.1)))
    given_[place] = value
    laid = compiled["lay_on_lines"](*given_)
    assert sum(laid[2]) <= given_[0].size


def test_a_field_that_is_none_is_refused(compiled, seen):
    given_ = arguments(seen[0], np.zeros(3), (0.1, 0.1, 0.1))
    lines = given_[5].size
    for line in (-1, lines):
        wrong = np.full(given_[3].size, line, np.int32)
        with pytest.raises(IndexError, match=f"no line {line}"):
            compiled["lay_on_lines"](*given_[:3], wrong, *given_[4:])
    other_lengths_are_refused(compiled, "lay_on_lines", given_, (1, 2, 4, 6, 7))
    for rows, columns in ((0, 5), (-1, -1), (2**40, 2**40), (given_[3].size, 2)):
        with pytest.raises(ValueError, match="different lengths"):
            compiled["lay_on_lines"](*given_[:11], rows, columns, *given_[13:])
    for numbers in (8, 10, 30):
        with pytest.raises(TypeError, match="a tuple of 9 numbers"):
            compiled["lay_on_lines"](*given_[:17], (0.0,) * numbers)
    with pytest.raises(ValueError, match="Singular"):
        compiled["lay_on_lines"](*(row[:0] for row in given_[:3]), *given_[3:17], (0.0,) * 9)


@settings(max_examples=150)
@given(
    seed=st.integers(0, 2**32),
    beams=st.sampled_from([0, 1, 2, 180]),
    moves=st.tuples(*[st.sampled_from([0.0, 2.0, -1.0, math.nan])] * 3),
    step_rad=st.sampled_from([0.0, 0.004, 0.03, 1.0]),
    farthest_m=st.sampled_from([15.0, 4.0, 0.0]),
)
def test_any_beams_end_alike(compiled, seed, beams, moves, step_rad, farthest_m):
    random = np.random.default_rng(seed)
    steps_m = random.choice([0.0, 0.0, 0.0, 0.29, 0.31, -0.4, 3.0, -3.0, math.nan, math.inf], beams)
    ranges_m = np.abs(random.choice([0.1, 0.5, 2.0]) + np.cumsum(np.where(np.isfinite(steps_m), steps_m, 0.0)))
    ranges_m = np.where(np.isfinite(steps_m), ranges_m, steps_m).astype(np.float32)
    ahead = np.exp(1j * random.uniform(-2.0, 2.0, beams))
    given_ = ranges_m, ahead, random.random(beams), farthest_m, step_rad, 0.27, -0.02, *moves
    same(compiled, "ends_of_beams", *given_)
    for place in range(3):
        with pytest.raises(ValueError, match="different lengths"):
            compiled["ends_of_beams"](*given_[:place], np.zeros(beams + 1, given_[place].dtype), *given_[place + 1 :])


@given(st.integers(0, 2**32), st.sampled_from([1, 7, 5000]), st.sampled_from([0, 1, 60]))
def test_any_place_is_scored_alike(compiled, seed, cells, beams):
    random = np.random.default_rng(seed)
    nearness = random.random(cells).astype(np.float32)
    given_ = nearness, random.integers(-9, cells + 9, 40), random.integers(-cells, cells + 1, beams)
    same(compiled, "mean_nearness", *given_)
    with pytest.raises(IndexError):
        compiled["mean_nearness"](nearness[:0], *given_[1:])


@pytest.fixture(scope="module")
def views():
    return [in_a_room(pose, seed=seed) for seed, pose in enumerate([(0, 0, 0), (0.3, 0.1, 0.1), (2.0, 0.3, -0.4)])]


@settings(max_examples=150)
@given(
    which=st.tuples(st.integers(0, 2), st.integers(0, 2)),
    guess=st.tuples(st.floats(-0.6, 0.6), st.floats(-0.4, 0.4), st.floats(-3.0, 3.0) | st.floats(-0.3, 0.3)),
    every=st.sampled_from([1, 1, 3, 40, 2000]),
)
def test_any_scan_is_matched_alike(compiled, views, which, guess, every):
    now, before = (views[number] for number in which)
    pose, drift = ScanPose(complex(*guess[:2]), guess[2]), SLIDE if every == 1 else DRIFT
    given_ = FUNCTIONS["match_scan"].flat(now, surfaces_of(before), pose, drift)
    given_ = tuple(one[::every].copy() if isinstance(one, np.ndarray) else one for one in given_)
    given_ = (*given_[:7], given_[7] * every, *given_[8:])
    same(compiled, "match_scan", *given_)


def test_a_scan_with_other_beams_or_no_numbers_is_refused_or_matches_nothing(compiled, views):
    given_ = FUNCTIONS["match_scan"].flat(views[1], surfaces_of(views[0]), ScanPose(0.2 + 0.1j, 0.1), DRIFT)
    assert compiled["match_scan"](*given_) is not None
    other_lengths_are_refused(compiled, "match_scan", given_, (0, 1, 2, 3, 8, 9, 10))
    for place in (4, 5, 6, 7, 11, 12, 13):
        assert compiled["match_scan"](*given_[:place], math.nan, *given_[place + 1 :]) is None


KIND = (-math.pi, math.radians(1.0), 360)


@settings(max_examples=150)
@given(
    pose=st.tuples(st.floats(-0.4, 0.4), st.floats(-0.4, 0.4), st.floats(-0.3, 0.3)),
    guess=st.tuples(st.floats(-0.6, 0.6), st.floats(-0.4, 0.4), st.floats(-3.0, 3.0) | st.floats(-0.3, 0.3)),
    every=st.sampled_from([1, 1, 3, 40, 2000]),
    weight=st.sampled_from([0.01, 5.0]),
    seed=st.integers(0, 2**32),
)
def test_any_points_are_laid_over_a_key_alike(compiled, pose, guess, every, weight, seed):
    world, noise_m = load_world("loop"), np.random.default_rng(seed).normal(0.0, 0.01, (2, KIND[2]))
    bearings_rad = np.array([KIND[0] + KIND[1] * beam for beam in range(KIND[2])])
    rays = np.array([np.cos(bearings_rad), np.sin(bearings_rad)])
    key = surfaces(rays * (world.cast(0.0, 0.0, bearings_rad) + noise_m[0]))
    points_m = rays * (world.cast(pose[0], pose[1], bearings_rad + pose[2]) + noise_m[1])
    given_ = FUNCTIONS["lay_over"].flat(key, points_m[:, ::every], np.array(guess), KIND, weight)
    same(compiled, "lay_over", *given_)


def test_a_key_with_other_beams_or_no_numbers_is_refused_or_moves_nothing(compiled):
    square_m, key = np.ones((2, 9)), ReferenceScan(np.ones((2, 9)), np.ones((2, 9)), np.ones(9, bool))
    given_ = FUNCTIONS["lay_over"].flat(key, square_m, np.zeros(3), (-1.0, 0.25, 9))
    assert np.linalg.norm(compiled["lay_over"](*given_)[1]) > 0.0
    other_lengths_are_refused(compiled, "lay_over", given_, range(7))
    for place in (7, 8, 9, 10, 11):
        assert not compiled["lay_over"](*given_[:place], math.nan, *given_[place + 1 :])[1].any()
    with pytest.raises(ValueError, match="Singular"):
        compiled["lay_over"](*given_[:8], 0.001, *given_[9:12], 0.0)
