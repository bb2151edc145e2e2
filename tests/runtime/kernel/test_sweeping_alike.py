"""Arcs are swept alike, and the dark is enclosed alike."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from tests.runtime.kernel.sameness import PYTHON, SOME_RAD, assert_same


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
    try:
        expected = PYTHON["find_dark_regions"](*given_)
    except (ValueError, OverflowError, ZeroDivisionError) as error:
        with pytest.raises(type(error)):
            compiled["find_dark_regions"](*given_)
    else:
        assert compiled["find_dark_regions"](*given_) is expected


OUTLINE = (0.45, 0.05, 0.2)
MOTION = [2.0, 1.0, 0.1, 0.05, 3.2, 0.33, 4.0, 0.01, 1.0, 3.0]
"""How a car moves that takes its bend wider while it gains speed."""


def assert_swept_alike(compiled, *given_):
    try:
        with np.errstate(all="ignore"):
            expected = PYTHON["sweep_arc"](*given_)
    except (ValueError, OverflowError, ZeroDivisionError) as error:
        with pytest.raises(type(error)):
            compiled["sweep_arc"](*given_)
    else:
        assert_same("sweep_arc", expected, compiled["sweep_arc"](*given_))


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
