"""Walls, thin things and near places are seen alike."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from drivers import twin
from tests.runtime.kernel.sameness import assert_same


@given(
    seed=st.integers(0, 2**32),
    points=st.sampled_from([1, 2, 3, 4, 5, 6, 7, 30, 400]),
    there=st.tuples(st.floats(-1.0, 1.0), st.floats(-1.0, 1.0), st.floats(-4.0, 4.0)),
)
def test_any_wall_is_seen_from_there_alike(compiled, seed, points, there):
    rng = np.random.default_rng(seed)
    x_m, y_m = rng.choice([0.005, 0.05, 1.0]) * rng.normal(1.0, 1.0, (2, points)).cumsum(axis=1)
    wall = np.flatnonzero(rng.random(points) < rng.choice([0.3, 1.0]))
    if not wall.size:
        wall = np.array([points - 1])
    given_ = (x_m, y_m, wall, *there)
    assert_same("wall_around", twin.PLAIN["wall_around"](*given_), compiled["wall_around"](*given_))
    at_once = (x_m, y_m, wall, x_m[wall[0]], y_m[wall[0]], there[2])  # the rear axle in the wall
    assert_same("wall_around", twin.PLAIN["wall_around"](*at_once), compiled["wall_around"](*at_once))


@pytest.mark.parametrize("place", range(3))
def test_a_wall_is_seen_alike_from_where_is_no_number(compiled, place):
    there = [0.1, 0.2, 0.3]
    there[place] = math.nan
    given_ = (np.arange(9.0), np.ones(9), np.arange(9), *there)
    assert_same("wall_around", twin.PLAIN["wall_around"](*given_), compiled["wall_around"](*given_))


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
        thin_m, lonely_m = twin.PLAIN["thin_places"](*given_)
        assert_same("thin_places", (thin_m, lonely_m), compiled["thin_places"](*given_))
    if lonely_m.size:
        before = tuple(thin_m + rng.normal(0.0, 0.02, thin_m.size) for _ in range(4))
        given_ = (lonely_m, before, *pose)
        assert_same("returned", twin.PLAIN["returned"](*given_), compiled["returned"](*given_))


def test_a_lidar_whose_beams_are_one_has_no_thin_places(compiled):
    flags, ranges_m = np.zeros(9, np.bool_), np.ones(9)
    for of, step_rad in ((twin.PLAIN, 0.0), (compiled, 0.0), (twin.PLAIN, math.nan), (compiled, math.nan)):
        with pytest.raises((ValueError, ZeroDivisionError)):
            of["thin_places"](ranges_m, ranges_m, flags, ranges_m, None, -1.0, step_rad, 0.0, 0.0, 0.0)
