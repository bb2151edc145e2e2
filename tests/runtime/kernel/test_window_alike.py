"""What is learnt of the window, and what is found, is alike."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from tests.runtime.kernel.sameness import BEAMS, PYTHON, assert_same, other_lengths_are_refused, ranges, same


def window(seed, beams):
    """Return what one scan shows of a window and what is known of it: the arrays that `evidence` wants."""
    rng = np.random.default_rng(seed)
    ranges_m = ranges(seed)[:beams]
    ranges_m[~((ranges_m > 0) & (ranges_m < math.inf))] = math.nan
    near_m = np.where(rng.random(beams) < 0.5, ranges_m + rng.normal(0.0, 0.06, beams), math.nan)
    own, rear = rng.random((2, beams)) < 0.4
    dirt, body, blind = rng.choice([0.0, 1.0, 0.3, 0.6, 0.95, rng.random()], (3, beams))
    return ranges_m, np.isnan(ranges_m), own, rear, near_m, dirt, body, blind


SHARE = st.floats(0.0, 1.0)


@given(
    seed=st.integers(0, 2**32),
    beams=st.sampled_from([0, 1, 40, 41, 81, 161, 200, BEAMS]),
    shares=st.tuples(SHARE, SHARE, st.one_of(st.just(0.0), SHARE)),
)
def test_any_window_is_learnt_alike(compiled, seed, beams, shares):
    known = window(seed, beams)
    for scan_number in range(3):  # each learns on from what was learnt by Python
        given_ = (*window(seed + scan_number // 2, beams)[:4], *known[4:], *shares)
        before = [array.copy() for array in given_[:8]]
        learnt = same(compiled, "weigh_dirt", *given_)
        assert_same("weigh_dirt", tuple(before), given_[:8])
        known = (*known[:4], *learnt)


@pytest.mark.parametrize("place", range(11))
def test_what_is_no_number_is_learnt_alike(compiled, place):
    for value in (math.nan, math.inf, -math.inf):
        given_ = [*window(5, BEAMS), 0.1, 0.3, 0.2]
        if place >= 8:
            given_[place] = value
        elif given_[place].dtype == np.float64:
            given_[place][::3] = value
        else:
            given_[place] = np.repeat(given_[place], 2)[::-2]  # backwards, and not side by side
        with np.errstate(invalid="ignore"):
            same(compiled, "weigh_dirt", *given_)


def test_a_window_of_different_lengths_is_refused(compiled):
    other_lengths_are_refused(compiled, "weigh_dirt", (*window(5, 30), 0.1, 0.3, 0.2), range(8))


LEVELS = np.array([0.0, 0.25, 0.3, 0.31, 0.6, 0.61, 0.95, 0.96, 1.0, math.nan])


@given(
    seed=st.integers(0, 2**32),
    beams=st.sampled_from([0, 1, 2, 40, BEAMS]),
    highest=st.integers(1, LEVELS.size),
    bounds=st.sampled_from([(0.6, 0.3), (0.3, 0.6), (math.nan, 0.3), (0.6, math.nan)]),
)
def test_any_window_is_judged_alike(compiled, seed, beams, highest, bounds):
    rng = np.random.default_rng(seed)
    dirt, body, blind = rng.choice(LEVELS[:highest], (3, beams))
    for doubted in (None, rng.random(beams) < 0.8):
        before = tuple(rng.random((3, beams)) < rng.choice([0.0, 0.05]))
        for _ in range(3):  # the second time nothing has changed, but rows that grow
            given_ = (dirt, body, blind, doubted, before, *bounds)
            found, _ = same(compiled, "find_dirt", *given_)
            before = found or before


def test_findings_of_different_lengths_are_refused(compiled):
    flags = np.zeros(9, np.bool_)
    for place in range(7):
        arrays = [np.zeros(9), np.zeros(9), np.zeros(9), flags, flags, flags, flags]
        arrays[place] = arrays[place][1:]
        with pytest.raises(ValueError, match="different lengths"):
            compiled["find_dirt"](*arrays[:4], tuple(arrays[4:]), 0.6, 0.3)
    for before in (None, (), (flags, flags), (flags, flags, None), [flags, flags, flags]):
        with pytest.raises(TypeError):
            compiled["find_dirt"](*arrays[:3], None, before, 0.6, 0.3)


@given(
    seed=st.integers(0, 2**32),
    beams=st.sampled_from([0, 1, 40, BEAMS]),
    pose=st.tuples(*[st.one_of(st.floats(-50.0, 50.0), st.just(math.nan))] * 3),
)
def test_any_near_places_are_kept_alike(compiled, seed, beams, pose):
    ranges_m, _, solid, *_ = window(seed, beams)
    given_ = (ranges_m * np.cos(np.arange(beams)), ranges_m * np.sin(np.arange(beams)), solid, ranges_m, *pose)
    with np.errstate(invalid="ignore"):
        same(compiled, "find_near_places", *given_)


@settings(max_examples=120, deadline=None)
@given(
    seed=st.integers(0, 2**32),
    places=st.sampled_from([0, 1, 40, 3000]),
    pose=st.tuples(*[st.one_of(st.floats(-5.0, 5.0), st.just(math.nan))] * 5),
    half_view_rad=st.one_of(st.floats(-1.0, 4.0), st.sampled_from([0.0, -1.0, math.nan, math.inf])),
)
def test_any_places_are_behind_alike(compiled, seed, places, pose, half_view_rad):
    rng = np.random.default_rng(seed)
    places_m = rng.normal(0.0, 2.0, places) + 1j * rng.normal(0.0, 2.0, places)
    if places > 1:
        places_m[rng.integers(0, places, 3)] = complex(*rng.choice([math.nan, math.inf, 0.0], 2))
    given_ = (places_m, *pose, half_view_rad)
    with np.errstate(invalid="ignore"):
        same(compiled, "places_behind", *given_)


def test_near_places_of_no_direction_or_of_different_lengths_are_refused(compiled):
    long_m, flags = np.ones(9), np.ones(9, np.bool_)
    for of in (PYTHON, compiled):
        with pytest.raises(ValueError, match="math domain error"):
            of["find_near_places"](long_m, long_m, flags, long_m, 0.0, 0.0, math.inf)
        with pytest.raises(ValueError, match="math domain error"):
            of["places_behind"](long_m + 0j, 0.0, 0.0, math.inf, 0.0, 0.0, 2.0)
    other_lengths_are_refused(compiled, "find_near_places", (long_m, long_m, flags, long_m, 0.0, 0.0, 0.0), range(4))


@settings(max_examples=120, deadline=None)
@given(seed=st.integers(0, 2**32), beams=st.sampled_from([1, 40, BEAMS]), places=st.sampled_from([0, 1, 40, 500]))
def test_any_places_are_seen_again_and_expected_alike(compiled, seed, beams, places):
    rng = np.random.default_rng(seed)
    ranges_m, away_m = rng.uniform(0.2, 1.2, beams), rng.uniform(0.0, 1.2, places)
    rear = np.flatnonzero(rng.random(beams) < rng.choice([0.0, 0.5, 1.0]))
    at_beam = rng.uniform(-6.0, beams + 6.0, places)
    at_beam[::3] = np.round(2.0 * at_beam[::3]) / 2.0
    for some in (away_m, at_beam):
        some[rng.random(places) < 0.05] = math.nan
    given_ = ranges_m, rear, away_m, at_beam
    same(compiled, "seen_again", *given_)
    due = beams, away_m, at_beam
    with np.errstate(invalid="ignore"):
        same(compiled, "expected_m", *due)


def test_places_of_different_lengths_and_beams_that_are_not_there_are_refused(compiled):
    ones, beams = np.ones(9), np.arange(9)
    other_lengths_are_refused(compiled, "seen_again", (ones, beams, ones, ones), (2, 3))
    other_lengths_are_refused(compiled, "expected_m", (9, ones, ones), (1, 2))
    with pytest.raises(ValueError, match="too many beams"):
        compiled["expected_m"](2**31, np.ones(3), np.ones(3))
    for wrong in (-1, 9):
        with pytest.raises(IndexError):
            compiled["seen_again"](ones, beams + wrong, ones, ones)
