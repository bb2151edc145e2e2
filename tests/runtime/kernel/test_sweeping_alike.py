"""Arcs are swept alike, and the dark is enclosed alike."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from tests.runtime.kernel.sameness import PYTHON, SOME_RAD, same, same_or_refused
from wallride.runtime.control.safety.footprint import PathMotion, arc


@settings(max_examples=300)
@given(
    seed=st.integers(0, 2**32),
    lidar=st.tuples(
        st.floats(-3.2, 3.2), st.sampled_from([-0.1, -0.02, 0.004, 0.02, 0.1, 1e-9, 1e-300, 0.0, math.nan])
    ),
    toward_rad=st.one_of(st.floats(-3.2, 3.2), st.sampled_from([1e300, -1e300, math.nan, math.inf])),
    near_m=st.sampled_from([1.0, 2.0, 3.0, math.nan, math.inf]),
)
def test_any_dark_is_enclosed_alike(compiled, seed, lidar, toward_rad, near_m):
    rng = np.random.default_rng(seed)
    beams = rng.choice([0, 1, 9, 100, 400])
    no_echo, solid = rng.random((2, beams)) < rng.choice([0.03, 0.3, 0.9], (2, 1))
    given_ = (no_echo, solid, rng.choice([0.5, 1.0, 2.5, math.nan], beams), *lidar, toward_rad, near_m)
    same_or_refused(compiled, "find_dark_regions", *given_)


OUTLINE = (0.45, 0.05, 0.2)
MOTION = [2.0, 1.0, 0.1, 0.05, 3.2, 0.33, 4.0, 0.01, 1.0, 3.0]
"""How a car moves that takes its bend wider while it gains speed."""


def assert_swept_alike(compiled, *given_):
    with np.errstate(all="ignore"):
        same_or_refused(compiled, "sweep_arc", *given_)


@settings(max_examples=300)
@given(
    seed=st.integers(0, 2**32),
    points=st.sampled_from([0, 2, 3, 4, 30, 400]),
    way=st.tuples(SOME_RAD, st.floats(-0.5, 6.0)),
    car=st.tuples(
        st.floats(0.0, 8.0), st.sampled_from([1.0, -1.0]), SOME_RAD, st.floats(0.0, 0.3), st.floats(0.0, 9.0)
    ),
    grip=st.tuples(st.sampled_from([0.5, 2.0, 8.0, math.inf]), st.floats(0.0, 0.1), st.floats(-3.0, 3.0)),
    end_mps=st.sampled_from([0.0, 2.0, 8.0]),
)
def test_any_arc_is_swept_alike(compiled, seed, points, way, car, grip, end_mps):
    rng = np.random.default_rng(seed)
    room_m = rng.choice([0.3, 1.0, 3.0, 9.0])
    points_m = rng.uniform(-room_m, room_m, points) + 1j * rng.normal(0.0, rng.choice([0.1, 1.0]), points)
    if points > 4:
        points_m[rng.integers(0, points, 3)] = complex(*rng.choice([math.nan, math.inf, -math.inf, 1.0], 2))
    for places_m in (points_m, np.repeat(points_m, 2)[::2]):
        assert_swept_alike(compiled, *way, places_m, *OUTLINE, *car, 0.33, *grip, end_mps)


WALL = 1.0 + 1j * np.linspace(-0.5, 0.5, 41)


@pytest.mark.parametrize("value", [math.nan, math.inf, -math.inf, 0.0])
@pytest.mark.parametrize("place", range(15))
def test_what_is_no_number_is_swept_alike(compiled, place, value):
    for numbers in ([0.2, 3.0, *OUTLINE, *MOTION], [0.1, 3.0, *OUTLINE, *MOTION[:8], 0.0, 0.0]):
        numbers[place] = value
        assert_swept_alike(compiled, *numbers[:2], WALL, *numbers[2:])


def test_a_standing_car_on_no_floor_is_swept_by_nobody(compiled):
    numbers = [0.2, 3.0, WALL, *OUTLINE, 0.0, *MOTION[1:6], -1.0, *MOTION[7:8], 0.0, 0.0]
    for of in (PYTHON, compiled):
        with pytest.raises(ZeroDivisionError):
            of["sweep_arc"](*numbers)


def test_a_way_without_end_is_swept_by_nobody(compiled):
    for length_m in (1e18, 1e300):
        with pytest.raises(MemoryError):
            compiled["sweep_arc"](0.2, length_m, WALL, *OUTLINE, *MOTION)


PLACES = st.sampled_from([0, 1, 2, 3, 4, 30, 300])


def somewhere(seed, count, room_m=3.0):
    """Return places (count,), some of them no numbers."""
    rng = np.random.default_rng(seed)
    places_m = rng.normal(0.5 * room_m, room_m, count) + 1j * rng.normal(0.0, rng.choice([0.05, 1.0]), count)
    if count > 4 and rng.random() < 0.3:
        places_m[rng.integers(0, count, 2)] = complex(*rng.choice([math.nan, math.inf, 1.0], 2))
    return places_m


@settings(max_examples=200)
@given(
    seed=st.integers(0, 2**32), points=PLACES, motion=st.tuples(st.floats(0.0, 8.0), SOME_RAD), steering_rad=SOME_RAD,
    length_m=st.floats(-0.5, 6.0), direction=st.sampled_from([1.0, -1.0]),
)  # fmt: skip
def test_any_path_is_swept_alike(compiled, seed, points, motion, steering_rad, length_m, direction):
    path = arc(PathMotion(motion[0], direction, motion[1], 0.05, 3.2, 0.33, 4.0, 0.01), steering_rad, length_m)
    poses = path.travel_m, path.place_m, path.heading, path.curvature_per_m
    given_ = (*poses, somewhere(seed, points), *OUTLINE, direction)
    with np.errstate(all="ignore"):
        same(compiled, "sweep_path", *given_)
        room = path.place_m[::3], path.heading[::3], somewhere(seed, points + 3), 0.45, 0.2
        same(compiled, "slide_room_m", *room)


@settings(max_examples=200)
@given(seed=st.integers(0, 2**32), points=PLACES, corners=st.integers(2, 60))
def test_any_place_is_as_far_beside_a_path(compiled, seed, points, corners):
    rng = np.random.default_rng(seed)
    path_m = np.cumsum(rng.choice([0.0, 0.1, 0.2], corners) * np.exp(1j * np.cumsum(rng.normal(0.0, 0.3, corners))))
    given_ = somewhere(seed, points, 1.0), path_m
    with np.errstate(all="ignore"):
        same(compiled, "beside_path_m", *given_)


@settings(max_examples=200)
@given(seed=st.integers(0, 2**32), points=PLACES, border=PLACES, side=st.sampled_from([1.0, -1.0]))
def test_any_border_leaves_the_same_room(compiled, seed, points, border, side):
    course = np.exp(1j * np.random.default_rng(seed).normal(0.0, 0.5, points))
    given_ = somewhere(seed, points), course, somewhere(seed + 1, border), side
    with np.errstate(all="ignore"):
        same(compiled, "free_beside_m", *given_)
    with pytest.raises(ValueError, match="different lengths"):
        compiled["free_beside_m"](np.zeros(points + 1, np.complex128), *given_[1:])


def test_paths_that_are_none_are_refused(compiled):
    one, two, numbers = np.zeros(1, np.complex128), np.zeros(2, np.complex128), np.zeros(2)
    with pytest.raises(ValueError, match="at least two points"):
        compiled["beside_path_m"](two, one)
    with pytest.raises(ValueError, match="different lengths"):
        compiled["slide_room_m"](one, two, np.zeros(3, np.complex128), 0.45, 0.2)
    with pytest.raises(ValueError, match="fewer than three"):
        compiled["slide_room_m"](two, two, two, 0.45, 0.2)
    for poses in ((numbers[:1], two, two, numbers), (numbers[:0], one[:0], one[:0], numbers[:0])):
        with pytest.raises(ValueError, match="no poses, or arrays of different lengths"):
            compiled["sweep_path"](*poses, two, *OUTLINE, 1.0)
