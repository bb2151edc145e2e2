"""Promised paths are driven alike, and hidden alike."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from tests.runtime.kernel.sameness import SOME_RAD, same, same_or_refused
from wallride.runtime.control.safety import promise_judgement as judgement
from wallride.runtime.control.safety import promised_way as ways

CAR = (1.0, 0.1, 0.05, 3.2, 0.33, 0.34, 7.85, 0.023, 4.0)
"""A `Roadworthy`."""


def a_path(seed, count, step_m, bend_per_m, behind_m=0.0):
    """Return places and speeds of a path that begins near the car; some are no path of a car."""
    rng = np.random.default_rng(seed)
    step_m *= rng.uniform(0.9, 1.1)  # else rounding decides how many poses there are
    turned_rad = np.cumsum(bend_per_m * step_m + rng.normal(0.0, rng.choice([0.0, 0.003, 0.3]), count))
    steps_m = rng.choice([step_m, 0.01, 0.0, 0.6], count, p=[0.97, 0.01, 0.01, 0.01] if seed % 4 == 0 else [1, 0, 0, 0])
    places_m = np.concatenate([[0j], np.cumsum(steps_m * np.exp(1j * turned_rad))])[:count]
    aside_m = rng.choice([0.0, 0.03, 0.07], p=[0.6, 0.3, 0.1])
    return places_m - behind_m + 1j * aside_m, rng.uniform(0.0, rng.choice([3.0, 8.0]), count)


@settings(max_examples=400)
@given(
    seed=st.integers(0, 2**32), count=st.sampled_from([2, 3, 4, 20, 60, 300]),
    step_m=st.sampled_from([0.0531, 0.2137, 0.4019]),
    bend_per_m=st.floats(-1.2, 1.2), behind_m=st.sampled_from([0.0, 0.11, 0.15, 1.03, 2.21]),
    look_m=st.sampled_from([-1.0, 0.0, 0.3, 3.0, 9.0]),
    car=st.tuples(st.floats(0.0, 8.0), SOME_RAD, st.floats(0.0, 0.2), st.sampled_from([0.0, 3.2, 9.0])),
    grip=st.tuples(st.sampled_from([2.0, 7.85]), st.floats(0.0, 0.05), st.floats(0.0, 5.0)),
)  # fmt: skip
def test_any_promise_is_driven_alike(compiled, seed, count, step_m, bend_per_m, behind_m, look_m, car, grip):
    places_m, speed_mps = a_path(seed, count, step_m, bend_per_m, behind_m)
    same(compiled, "drive_promise", places_m, speed_mps, look_m, *car, 0.33, 0.34, *grip)
    same(compiled, "drive_promise", np.repeat(places_m, 2)[::2], speed_mps, look_m, *car, 0.33, 0.34, *grip)


def test_every_refusal_and_a_way_are_answered_alike(compiled):
    bend, tight = (np.cumsum(0.19 * np.exp(1j * per_m * 0.19 * np.arange(40))) - 0.19 for per_m in (0.3, 1.9))
    refused = {"a way": bend, ways.GAPS: 2.7 * bend, ways.NOT_HERE: bend + 0.2j, ways.TOO_SHORT: 0.1 * bend[:2]}
    for reason, places_m in {**refused, ways.CANNOT_STEER: tight, ways.NO_GRIP: bend}.items():
        speed_mps = np.full(places_m.size, 9.0 if reason == ways.NO_GRIP else 1.0)
        found = same(compiled, "drive_promise", places_m, speed_mps, 3.1, *CAR)
        assert reason == (ways.REFUSALS[found] if isinstance(found, int) else "a way")
    for look_m in (math.nan, math.inf):
        same_or_refused(compiled, "drive_promise", bend, np.ones(40), look_m, *CAR)


def test_promises_of_no_shape_are_refused(compiled):
    one, two = np.zeros(1, np.complex128), np.arange(2) * (0.2 + 0j)
    for places_m, speed_mps in ((one, np.zeros(1)), (two, np.zeros(3))):
        with pytest.raises(ValueError, match="fewer than two points, or arrays of different lengths"):
            compiled["drive_promise"](places_m, speed_mps, 3.0, *CAR)
    with pytest.raises(MemoryError):
        compiled["drive_promise"](two, np.ones(2), 1e18, *CAR)


@settings(max_examples=300)
@given(
    seed=st.integers(0, 2**32), count=st.sampled_from([1, 2, 40]), beams=st.sampled_from([1, 5, 360, 1081]),
    first_rad=st.floats(-3.2, 0.0), step_rad=st.sampled_from([0.004363, -0.0174, 0.06]),
)  # fmt: skip
def test_any_place_is_hidden_alike(compiled, seed, count, beams, first_rad, step_rad):
    rng = np.random.default_rng(seed)
    nose_m = np.cumsum(0.1 * np.exp(1j * np.cumsum(rng.normal(0.0, 0.1, count)))) * np.exp(1j * rng.uniform(-3.0, 3.0))
    ranges_m = rng.choice([0.5, 2.0, 9.0, math.nan], beams, p=[0.05, 0.1, 0.8, 0.05])
    same(compiled, "first_hidden", nose_m, ranges_m, first_rad, step_rad)


def test_a_scan_without_beams_or_steps_hides_nothing_and_is_refused(compiled):
    nose_m = np.array([1.0 + 0j])
    for ranges_m, step_rad in ((np.ones(0), 0.1), (np.ones(3), 0.0), (np.ones(3), math.nan)):
        with pytest.raises(ValueError, match="no beams, or no angle"):
            compiled["first_hidden"](nose_m, ranges_m, 0.0, step_rad)
    assert compiled["first_hidden"](nose_m, np.full(9, 0.5), -0.4, 0.1) == 0
    assert compiled["first_hidden"](nose_m, np.full(9, judgement.SIGHT_SPARE_M + 1.0), -0.4, 0.1) == -1
