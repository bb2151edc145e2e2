"""The C that watches the sectors answers as its Python does, whatever the scan."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from tests.runtime.kernel.sameness import same

SECTORS = 83
WIDTH_RAD = math.radians(2.5)
FIRST_RAD = -41 * WIDTH_RAD


def arguments(seed):
    random = np.random.default_rng(seed)
    beams = 1081
    steps_m = random.normal(0, random.choice([0.01, 0.1, 0.5]), beams)
    ranges_m = np.abs(np.cumsum(steps_m) + random.uniform(0.1, 8))
    no_echo = random.random(beams) < random.choice([0.0, 0.02, 0.5])
    at = int(random.integers(0, beams))
    no_echo[at : at + int(random.integers(0, 400))] = True
    at = int(random.integers(0, beams))
    ranges_m[at : at + int(random.integers(0, 300))] = random.uniform(0.05, 0.25)
    ranges_m[no_echo] = np.nan
    bearing_rad = np.radians(np.linspace(-135, 135, beams))
    x_m, y_m = np.cos(bearing_rad) * ranges_m + 0.27, np.sin(bearing_rad) * ranges_m + 0.02
    own = (ranges_m < 0.45) & (x_m <= 0.42) & (x_m >= -0.13) & (np.abs(y_m) <= 0.15)
    dirty = None if random.random() < 0.5 else random.random(beams) < 0.2
    state = random.integers(0, 6, SECTORS).astype(np.int8)
    held_rad = FIRST_RAD + WIDTH_RAD * np.arange(SECTORS) + random.normal(0, 0.02, SECTORS)
    held = 0.27 + 0.02j + random.uniform(0.5, 13, SECTORS) * np.exp(1j * held_rad)
    held[random.random(SECTORS) < 0.3] = complex(math.nan, math.nan)
    return (
        ranges_m, x_m, y_m, no_echo, own, dirty, state, held, 125, 10, FIRST_RAD, WIDTH_RAD, 0.27, 0.02, 0.42, 0.15,
        float(random.choice([0.0, 12.0])), float(random.normal(0, 0.1)), 0.01, float(random.normal(0, 0.1)),
    )  # fmt: skip


@given(st.integers(0, 2**32 - 1))
def test_any_scan_is_watched_alike(compiled, seed):
    given_ = arguments(seed)
    same(compiled, "watch_sectors", *given_)


@pytest.mark.parametrize("place", [12, 13, 14, 15, 16, 17, 18, 19])
def test_what_is_no_number_is_watched_alike(compiled, place):
    given_ = list(arguments(7))
    given_[place] = math.nan
    same(compiled, "watch_sectors", *given_)


def test_arrays_of_other_lengths_are_refused(compiled):
    wrong_numbers = ((8, 900), (8, -1), (9, 0), (9, 2**62), (8, 2**62))
    for place, wrong in ((1, np.zeros(5)), (7, np.zeros(3, np.complex128)), *wrong_numbers):
        given_ = list(arguments(1))
        given_[place] = wrong
        with pytest.raises(ValueError, match="lengths"):
            compiled["watch_sectors"](*given_)
