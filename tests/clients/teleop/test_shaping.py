import math
from itertools import pairwise

import pytest
from hypothesis import given
from hypothesis import strategies as st

from wallride.clients.teleop.shaping import InputShape, Shaper, curve, ramp

STICK = st.floats(-1, 1)


@given(st.lists(STICK, min_size=2, max_size=20), st.floats(0, 0.5), st.floats(0, 1))
def test_the_curve_is_odd_monotonic_and_full_at_the_end(sticks, deadzone, expo):
    values = [curve(stick, deadzone, expo) for stick in sorted(sticks)]
    assert all(low <= high + 1e-12 for low, high in pairwise(values))
    assert curve(-sticks[0], deadzone, expo) == -curve(sticks[0], deadzone, expo)
    assert curve(1.0, deadzone, expo) == pytest.approx(1.0)
    assert curve(deadzone, deadzone, expo) == 0


def test_what_is_no_number_is_no_wish():
    assert curve(math.nan, 0, 0) == 0
    assert curve(7.0, 0.1, 0.5) == pytest.approx(1.0)


@pytest.mark.parametrize(
    ("last", "wanted", "expected"),
    [(0.0, 2.0, 0.1), (1.0, 2.0, 1.1), (1.95, 2.0, 2.0), (2.0, 0.5, 0.5), (2.0, 0.0, 0.0), (2.0, -1.0, -0.1),
     (-1.0, -2.0, -1.1), (-2.0, -0.5, -0.5)],
)  # fmt: skip
def test_the_ramp_limits_growth_and_never_a_slowdown(last, wanted, expected):
    assert ramp(last, wanted, 0.1) == pytest.approx(expected)


@given(st.lists(STICK, max_size=40))
def test_no_wish_is_beyond_the_limits_or_grows_faster_than_the_ramp(sticks):
    shaper = Shaper(InputShape(max_speed_mps=1.5, ramp_mps2=2.0, steering_rate_radps=1.5))
    last_mps = last_rad = 0.0
    for stick in sticks:
        speed_mps, steering_rad = shaper.step(stick, -stick, 0.02)
        assert abs(speed_mps) <= 1.5
        assert abs(steering_rad) <= 0.34 + 1e-12
        assert abs(speed_mps) <= abs(last_mps) + 0.04 + 1e-12
        assert abs(steering_rad - last_rad) <= 0.03 + 1e-12
        last_mps, last_rad = speed_mps, steering_rad


def test_after_a_release_it_starts_from_standstill():
    shaper = Shaper(InputShape(ramp_mps2=1.0, expo=0, deadzone=0))
    shaper.step(1.0, 1.0, 1.0)
    shaper.reset()
    assert list(shaper.step(1.0, 0.0, 0.02)) == pytest.approx([0.02, 0.0])
