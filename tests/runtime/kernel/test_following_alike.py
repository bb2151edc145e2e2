"""The ball is pursued and the wall tracked alike."""

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from drivers import twin
from runtime.control.wall_track import WallTrack
from tests.runtime.kernel.sameness import ANGLE, assert_same

LENGTH = st.floats(0.3, 3.0)


@given(
    near=st.tuples(LENGTH, ANGLE),
    far=st.tuples(LENGTH, ANGLE),
    error_m=st.floats(-2.0, 5.0),
    line=st.one_of(st.just((math.nan, math.nan)), st.tuples(st.floats(-0.5, 0.5), st.floats(-2.0, 2.0))),
    bends=st.tuples(st.floats(-2.0, 2.0), st.floats(-2.0, 2.0)),
    speed_mps=st.floats(-1.0, 8.0),
    gains=st.tuples(st.floats(0.0, 9.0), st.floats(0.0, 9.0)),
)
def test_any_ball_is_pursued_alike(compiled, near, far, error_m, line, bends, speed_mps, gains):
    given_ = (*near, *far, error_m, *line, *bends, speed_mps, *gains, 0.33)
    assert_same("pursued", twin.PLAIN["pursued"](*given_), compiled["pursued"](*given_))


@pytest.mark.parametrize("place", range(13))
@pytest.mark.parametrize("line", [(0.1, 0.2), (math.nan, math.nan)])
def test_what_is_no_number_is_pursued_alike(compiled, place, line):
    given_ = [0.7, 0.1, 1.1, 0.2, 0.3, *line, 0.02, 0.04, 1.5, 4.0, 2.0, 0.33]
    given_[place] = math.nan
    assert_same("pursued", twin.PLAIN["pursued"](*given_), compiled["pursued"](*given_))


def test_what_is_no_number_is_tracked_alike(compiled):
    state = twin.PLAIN["predicted"](WallTrack(0.33)._state, 0.02, 0.1, 1.0, 0.33, 0.0)
    for place in range(5):
        step = [0.02, 0.1, 1.0, 0.33, 0.05]
        step[place] = math.nan
        assert_same("predicted", twin.PLAIN["predicted"](state, *step), compiled["predicted"](state, *step))
    for seen in ((math.nan, 0.1), (1.0, math.nan)):
        assert_same("corrected", twin.PLAIN["corrected"](state, *seen), compiled["corrected"](state, *seen))


STEP = st.tuples(st.floats(-0.05, 0.25), st.floats(-0.4, 0.4), st.floats(0.0, 6.0), st.sampled_from([0.0, 0.05]))


@given(steps=st.lists(st.tuples(STEP, st.floats(0.3, 2.0), st.floats(-0.5, 0.5)), min_size=1, max_size=20))
def test_any_line_is_tracked_alike(compiled, steps):
    state = WallTrack(0.33)._state
    for (way_m, wheel_rad, speed_mps, unrest_rad), distance_m, heading_rad in steps:
        step = (state, way_m, wheel_rad, speed_mps, 0.33, unrest_rad)
        state = twin.PLAIN["predicted"](*step)
        assert_same("predicted", state, compiled["predicted"](*step))
        seen = (state, distance_m, heading_rad)
        state = twin.PLAIN["corrected"](*seen)
        assert_same("corrected", state, compiled["corrected"](*seen))
