"""Manoeuvres are rolled out alike: where they lead, what they hit, and which end is the best."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from tests.runtime.kernel.sameness import PYTHON, SOME_RAD, same_or_refused

START = [3.0, 0.0, 0.06, 3.2, 0.33, 5.5, 0.42, 0.13, 0.15, 0.0]


def arguments(points_m, start=START, steering_rad=(0.3, 0.0, -0.34), brake_mps2=(1.2, math.inf, 6.0)):
    wheels_rad = np.linspace(0.0, 0.2, 30)
    given_ = (np.array(values, float) for values in (steering_rad, brake_mps2, (7.85, 4.9)))
    return (points_m, *given_, wheels_rad[:24], wheels_rad[24:], *start)


def assert_rolled_alike(compiled, *given_):
    with np.errstate(all="ignore"):
        same_or_refused(compiled, "roll_out_all", *given_)


@settings(max_examples=150, deadline=None)
@given(
    seed=st.integers(0, 2**32),
    points=st.sampled_from([0, 2, 3, 4, 40, 400]),
    speed_mps=st.floats(0.0, 8.0),
    brake_mps2=st.sampled_from([0.0, 2.0, 5.0, 20.0]),
    latency_s=st.sampled_from([0.0, 0.05, 0.073, 0.3, 2.0]),
    wish_rad=SOME_RAD,
)
def test_any_manoeuvre_is_rolled_out_alike(compiled, seed, points, speed_mps, brake_mps2, latency_s, wish_rad):
    rng = np.random.default_rng(seed)
    room_m = rng.choice([0.5, 1.0, 3.0])
    points_m = rng.uniform(-room_m, room_m, points) + 1j * rng.uniform(-room_m, room_m, points)
    if points > 4:
        points_m[rng.integers(0, points, 3)] = complex(*rng.choice([math.nan, math.inf, -math.inf, 1.0], 2))
    steering_rad = np.append(rng.uniform(-0.4, 0.4, 3), wish_rad)
    brakes_mps2 = rng.choice([0.0, 1.2, 3.4, 6.0, 9.0, math.inf], 4)
    past_rad, coming_rad = rng.uniform(-0.34, 0.34, rng.integers(0, 30)), rng.uniform(-0.34, 0.34, rng.integers(0, 9))
    grips_mps2 = rng.uniform(2.0, 10.0, rng.integers(1, 5))
    start = [speed_mps, brake_mps2, latency_s, *START[3:-1], rng.choice([0.0, 0.07, 0.14])]
    for places_m in (points_m, np.repeat(points_m, 2)[::2]):
        assert_rolled_alike(compiled, places_m, steering_rad, brakes_mps2, grips_mps2, past_rad, coming_rad, *start)


WALL = 1.0 + 1j * np.linspace(-0.5, 0.5, 41)


@pytest.mark.parametrize("value", [math.nan, math.inf, -math.inf, 0.0, -1.0])
@pytest.mark.parametrize("place", [0, 1, 2, 3, 5, 6, 7, 8, 9])
def test_what_is_no_car_is_rolled_out_alike(compiled, place, value):
    start = list(START)
    start[place] = value
    assert_rolled_alike(compiled, *arguments(WALL, start))


@pytest.mark.parametrize("value", [math.nan, math.inf, -1.0])
@pytest.mark.parametrize("which", [1, 2, 3, 4, 5])
def test_what_is_no_number_is_refused_by_both(compiled, which, value):
    given_ = list(arguments(WALL))
    given_[which][0] = value
    assert_rolled_alike(compiled, *given_)


def test_arrays_that_do_not_fit_are_refused_by_both(compiled):
    few = arguments(WALL, brake_mps2=(1.0, 2.0))
    floors = list(arguments(WALL))
    for count in (0, 5):
        floors[3] = np.full(count, 5.0)
        for of in (PYTHON, compiled):
            with pytest.raises(ValueError, match="1 to 4 floors"):
                of["roll_out_all"](*floors)
            with pytest.raises(ValueError, match="a steering for every brake"):
                of["roll_out_all"](*few)
