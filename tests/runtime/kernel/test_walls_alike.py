"""Walls, balls along them, and thin things are seen alike."""

import math

import numpy as np
import pytest
from hypothesis import event, given
from hypothesis import strategies as st

from tests.runtime.kernel.sameness import PYTHON, ranges, same
from wallride.runtime.control.wall_following.followed_wall import wall_side


def some_room(seed, beams):
    """Return x_m, y_m and range_m, solid, no_echo of beams that go round a hostile room."""
    rng = np.random.default_rng(seed)
    bearing_rad = np.linspace(2.3, -2.3, beams)
    range_m = np.resize(ranges(seed), beams)
    range_m[~(np.isfinite(range_m) & (range_m > 0.0))] = math.nan
    solid = np.isfinite(range_m) & (rng.random(beams) < rng.choice([0.7, 1.0]))
    return range_m * np.cos(bearing_rad) + 0.27, range_m * np.sin(bearing_rad), range_m, solid, ~np.isfinite(range_m)


@given(
    seed=st.integers(0, 2**32),
    beams=st.sampled_from([1, 9, 60, 400, 1081]),
    gap_m=st.sampled_from([0.3, 0.6, 1.0, 1.6]),
    expected=st.one_of(st.just((math.nan, 0.0)), st.tuples(st.floats(0.1, 3.0), st.floats(-0.8, 0.8))),
    desired_m=st.floats(0.2, 2.0),
)
def test_any_wall_beside_the_car_is_found_alike(compiled, seed, beams, gap_m, expected, desired_m):
    way = wall_side(-2.3, 4.6 / max(beams - 1, 1), beams, "left")
    spans = (way.beside.start, way.beside.stop, way.opposite_from)
    lines = (way.lines.beams, way.lines.rear, way.lines.front)
    given_ = (*some_room(seed, beams), *spans, gap_m, *lines, *expected, desired_m)
    same(compiled, "find_followed_wall", *given_)
    turned = [part[::-1] for part in given_[:5]]  # as a lidar that turns the other way gives them
    turned += [*spans, gap_m, *lines, *expected, desired_m]
    same(compiled, "find_followed_wall", *turned)


def test_a_wall_and_a_line_and_a_narrow_way_were_among_them(compiled):
    way = wall_side(-2.3, 4.6 / 1080, 1081, "left")
    spans = (way.beside.start, way.beside.stop, way.opposite_from)
    lines = (way.lines.beams, way.lines.rear, way.lines.front)
    found = [
        compiled["find_followed_wall"](*some_room(seed, 1081), *spans, 1.0, *lines, math.nan, 0.0, 1.0)
        for seed in range(300)
    ]
    assert 20 < sum(one is None for one in found) < 250
    walls = [one for one in found if one is not None]
    assert sum(line is not None for _, line, _, _ in walls) > 20
    assert sum(room_m < 1.0 for _, _, room_m, _ in walls) > 5


def behind_glass(silent, echoes, wall_m, seed):
    """Return the arguments of `wall_beside` for a straight wall with a gap, through which some beams see farther."""
    rng = np.random.default_rng(seed)
    way = wall_side(-2.3, 4.6 / 1080, 1081, "left")
    distance_m, heading_rad = wall_m
    range_m = distance_m / np.maximum(np.sin(way.bearing_rad - heading_rad), 0.05) + rng.normal(0.0, 0.01, 1081)
    gap = slice(*silent)
    range_m[gap] = np.where(rng.random(silent[1] - silent[0]) < echoes, range_m[gap] + 1.0, math.nan)
    no_echo = np.isnan(range_m)
    x_m, y_m = range_m * np.cos(way.bearing_rad), range_m * np.sin(way.bearing_rad)
    spans = (way.beside.start, way.beside.stop, way.opposite_from)
    lines = (way.lines.beams, way.lines.rear, way.lines.front)
    return (x_m, y_m, range_m, ~no_echo, no_echo, *spans, 0.6, *lines, math.nan, 0.0, 1.0)


@given(
    first=st.integers(200, 500),
    beams=st.integers(2, 260),
    echoes=st.floats(0.0, 0.4),
    wall_m=st.tuples(st.floats(0.5, 1.5), st.floats(-0.2, 0.2)),
    seed=st.integers(0, 2**32),
)
def test_any_pane_of_glass_is_found_alike(compiled, first, beams, echoes, wall_m, seed):
    given_ = behind_glass((first, first + beams), echoes, wall_m, seed)
    found = same(compiled, "find_followed_wall", *given_)
    event("glass" if found is not None and found[3] >= 0 else "none")


@pytest.mark.parametrize("echoes", [0.0, 0.15, 0.2, 0.25])
def test_glass_with_some_echoes_is_glass_alike(compiled, echoes):
    panes = []
    for seed in range(40):
        given_ = behind_glass((330, 480), echoes, (1.0, 0.0), seed)
        found = same(compiled, "find_followed_wall", *given_)
        panes.append(found[3] >= 0)
    assert {0.0: all(panes), 0.15: any(panes), 0.2: any(panes), 0.25: not all(panes)}[echoes]


RADII_M = tuple(np.linspace(0.3, 3.0, 10).tolist())
PLACE = st.tuples(st.floats(-1.0, 1.0), st.floats(-1.0, 1.0), st.floats(-4.0, 4.0))


@given(
    seed=st.integers(0, 2**32),
    points=st.sampled_from([1, 2, 3, 4, 5, 6, 7, 30, 400]),
    there=PLACE,
    line=st.sampled_from([(math.nan, 0.0), (1.0, 0.1), (0.3, -0.4)]),
    noise=st.tuples(st.floats(-0.02, 0.12), st.floats(1e-4, 0.1)),
    desired_m=st.floats(0.1, 2.0),
    glass=st.booleans(),
)
def test_a_ball_is_rolled_along_any_wall_alike(compiled, seed, points, there, line, noise, desired_m, glass):
    rng = np.random.default_rng(seed)
    x_m, y_m = rng.choice([0.005, 0.05, 1.0]) * rng.normal(1.0, 1.0, (2, points)).cumsum(axis=1)
    wall = np.flatnonzero(rng.random(points) < rng.choice([0.3, 1.0]))
    if not wall.size:
        wall = np.array([points - 1])
    solid = rng.random(points) < 0.8
    wall = wall[: rng.integers(1, wall.size + 1)]
    pane = rng.normal(1.0, 1.0, 7) + 1j * rng.normal(1.0, 1.0, 7) if glass else None
    radii_m = (*RADII_M, *rng.uniform(0.3, 2.0, 2).tolist())
    at_once = (x_m[wall[0]], y_m[wall[0]], there[2])  # the rear axle in the wall
    for place in (there, at_once):
        given_ = (x_m, y_m, solid, wall, pane, *place, *line, *noise, desired_m, radii_m)
        same(compiled, "roll_ball", *given_)


@given(seed=st.integers(0, 2**32), beams=st.integers(1, 200), noise_m=st.floats(1e-4, 0.2))
def test_the_noise_is_learnt_alike(compiled, seed, beams, noise_m):
    rng = np.random.default_rng(seed)
    x_m, y_m = rng.normal(0.0, rng.choice([0.01, 1.0]), (2, 200))
    given_ = (noise_m, x_m, y_m, np.sort(rng.choice(200, beams, replace=False)))
    same(compiled, "learn_noise_m", *given_)


@pytest.mark.parametrize("of", range(3))
@pytest.mark.parametrize("at", [0, 50, 99])
def test_a_noise_that_is_no_number_is_learnt_alike(compiled, of, at):
    numbers = [np.array([0.01]), np.linspace(-1.0, 1.0, 100), np.ones(100)]
    numbers[of][min(at, numbers[of].size - 1)] = math.nan
    given_ = (float(numbers[0][0]), *numbers[1:], np.arange(100))
    same(compiled, "learn_noise_m", *given_)


@pytest.mark.parametrize("radii_m", [RADII_M, RADII_M[:5]])
@pytest.mark.parametrize("place", range(8))
@pytest.mark.filterwarnings("ignore:invalid value")
def test_a_ball_is_rolled_alike_where_something_is_no_number(compiled, place, radii_m):
    numbers = [0.1, 0.2, 0.3, 1.0, 0.05, 0.01, 0.01, 1.0]
    numbers[place] = math.nan
    given_ = (np.arange(9.0), np.ones(9), np.arange(9) < 8, np.arange(4), None, *numbers, radii_m)
    same(compiled, "roll_ball", *given_)


@given(
    seed=st.integers(0, 2**32),
    beams=st.sampled_from([0, 3, 8, 9, 40, 300]),
    lidar=st.tuples(st.floats(-3.2, 3.2), st.sampled_from([-0.1, -0.02, 0.004, 0.0044, 0.1, 1e-9, 3.0])),
    pose=st.tuples(st.floats(-50.0, 50.0), st.floats(-50.0, 50.0), st.floats(-4.0, 4.0)),
)
def test_any_thin_places_are_found_alike(compiled, seed, beams, lidar, pose):
    rng = np.random.default_rng(seed)
    ranges_m = rng.choice([0.9, 1.0, 1.2, 2.0, 2.1, 4.9, 5.0, 9.0, math.nan], beams, p=[0.05] * 7 + [0.6, 0.05])
    solid, dirty = rng.random((2, beams)) < 0.2
    x_m, y_m = ranges_m * np.cos(np.arange(beams)), ranges_m * np.sin(np.arange(beams))
    for known in (None, dirty):
        given_ = (x_m, y_m, solid, ranges_m, known, *lidar, *pose)
        thin_m, lonely_m = same(compiled, "find_thin_places", *given_)
    if lonely_m.size:
        before = tuple(thin_m + rng.normal(0.0, 0.02, thin_m.size) for _ in range(4))
        given_ = (lonely_m, before, *pose)
        same(compiled, "find_returning", *given_)


def test_a_lidar_whose_beams_are_one_has_no_thin_places(compiled):
    flags, ranges_m = np.zeros(9, np.bool_), np.ones(9)
    for of, step_rad in ((PYTHON, 0.0), (compiled, 0.0), (PYTHON, math.nan), (compiled, math.nan)):
        with pytest.raises((ValueError, ZeroDivisionError)):
            of["find_thin_places"](ranges_m, ranges_m, flags, ranges_m, None, -1.0, step_rad, 0.0, 0.0, 0.0)
