"""A path is driven along and a wall tracked alike."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from tests.runtime.kernel.sameness import ANGLE, PYTHON, same
from wallride.runtime.control.wall_following.wall_track import START

RADII = tuple(np.linspace(0.3, 3.0, 10).tolist())
YES_OR_NO = st.lists(st.booleans(), min_size=13, max_size=13)
ANY_OR_ALL = st.one_of(YES_OR_NO, st.just([True] * 13))


@given(
    bearing_rad=st.lists(ANGLE, min_size=13, max_size=13),
    meets=ANY_OR_ALL,
    crosses=ANY_OR_ALL,
    left_out=st.integers(0, 10),
    look_m=st.tuples(st.floats(0.2, 1.5), st.floats(0.3, 3.0)),
    error_m=st.floats(-2.0, 5.0),
    line=st.one_of(st.just((math.nan, math.nan)), st.tuples(st.floats(-0.5, 0.5), st.floats(-2.0, 2.0))),
    bend_per_m=st.floats(-2.0, 2.0),
    speed_mps=st.floats(-1.0, 8.0),
    gains=st.tuples(st.floats(0.0, 9.0), st.floats(0.0, 9.0)),
    trim_rad=st.floats(-0.06, 0.06),
    mu=st.sampled_from([0.3, 0.9, math.inf]),
)
def test_any_path_is_driven_along_alike(
    compiled, bearing_rad, meets, crosses, left_out, look_m, error_m, line, bend_per_m, speed_mps, gains, trim_rad, mu
):
    radii_m = (*RADII, look_m[0], 2 * look_m[0], look_m[1])
    path = tuple(tuple(part[left_out:]) for part in (radii_m, bearing_rad, meets, crosses))
    given_ = (*path, error_m, *line, bend_per_m, speed_mps, *gains, 0.33, trim_rad, 0.34, 3.0, mu)
    same(compiled, "drive_along_ball", *given_)


CLEAR = (True,) * 13
TURNED_AWAY = [-0.5, math.nan, math.nan, 0.02, 1.5, 4.0, 2.0, 0.33, 0.01, 0.34, 3.0, 0.65]
"""From error_m on: far too near, and steering as far away as it can."""


def test_a_slipping_car_is_slowed_alike(compiled):
    path = ((*RADII, 0.4, 0.8, 0.7), (0.1,) * 10 + (-1.2, -1.2, -1.2), CLEAR, CLEAR)
    given_ = (*path, *TURNED_AWAY)
    answer = same(compiled, "drive_along_ball", *given_)
    nearer_by_the_line = (*path, -0.04, *TURNED_AWAY[1:])
    assert answer[2] == PYTHON["drive_along_ball"](*nearer_by_the_line)[2] == -0.34
    assert answer[3] < 0.8 * compiled["drive_along_ball"](*nearer_by_the_line)[3]


@pytest.mark.parametrize("place", range(12))
@pytest.mark.parametrize("line", [(0.1, 0.2), (math.nan, math.nan)])
@pytest.mark.parametrize("error_m", [0.3, -0.5])
def test_what_is_no_number_is_driven_along_alike(compiled, place, line, error_m):
    numbers = [error_m, *line, *TURNED_AWAY[3:]]
    numbers[place] = math.nan
    given_ = ((*RADII, 0.4, 0.8, 0.7), (0.1,) * 10 + (-0.2, -0.1, -0.1), CLEAR, CLEAR, *numbers)
    same(compiled, "drive_along_ball", *given_)


@pytest.mark.parametrize("of", range(2))
@pytest.mark.parametrize("at", [0, 3, 10, 11, 12])
def test_a_place_that_is_no_number_is_driven_along_alike(compiled, of, at):
    path = [[*RADII, 0.4, 0.8, 0.7], [0.1] * 10 + [-0.2, -0.1, -0.1]]
    path[of][at] = math.nan
    given_ = (*map(tuple, path), CLEAR, CLEAR, 0.3, 0.1, 0.2, *TURNED_AWAY[3:])
    same(compiled, "drive_along_ball", *given_)


def test_what_is_no_number_is_tracked_alike(compiled):
    state = PYTHON["predict_wall"](START, 0.02, 0.1, 1.0, 0.33, 0.0)
    for place in range(5):
        step = [0.02, 0.1, 1.0, 0.33, 0.05]
        step[place] = math.nan
        same(compiled, "predict_wall", state, *step)
    for seen in ((math.nan, 0.1), (1.0, math.nan)):
        same(compiled, "correct_wall", state, *seen)


STEP = st.tuples(st.floats(-0.05, 0.25), st.floats(-0.4, 0.4), st.floats(0.0, 6.0), st.sampled_from([0.0, 0.05]))


@given(steps=st.lists(st.tuples(STEP, st.floats(0.3, 2.0), st.floats(-0.5, 0.5)), min_size=1, max_size=20))
def test_any_line_is_tracked_alike(compiled, steps):
    state = START
    for (way_m, wheel_rad, speed_mps, unrest_rad), distance_m, heading_rad in steps:
        step = (state, way_m, wheel_rad, speed_mps, 0.33, unrest_rad)
        state = same(compiled, "predict_wall", *step)
        seen = (state, distance_m, heading_rad)
        state = same(compiled, "correct_wall", *seen)
