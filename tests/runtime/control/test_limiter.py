"""What the mechanics allow: clamps, slopes, and a stop that nothing delays."""

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from wallride.runtime.control.limiter import ASIDE_MPS2, Limiter
from wallride.runtime.control.vehicle import GRAVITY_MPS2, CarSettings

LIMITS = CarSettings(
    max_speed_mps=4.0, max_reverse_mps=1.0, max_steering_rad=0.34, steering_rate_radps=3.2, max_acceleration_mps2=4.0
)
LONG_S = 10.0


def moving(speed_mps, steering_rad=0.0):
    limiter = Limiter(LIMITS)
    limiter.limit(speed_mps, steering_rad, LONG_S)
    return limiter


@pytest.mark.parametrize(("wanted", "allowed"), [(9, 4), (4, 4), (1, 1), (-0.5, -0.5), (-9, -1)])
def test_speed_is_clamped(wanted, allowed):
    assert Limiter(LIMITS).limit(wanted, 0.0, LONG_S).speed_mps == allowed


@pytest.mark.parametrize(("wanted", "allowed"), [(1, 0.34), (-1, -0.34), (0.1, 0.1)])
def test_steering_is_clamped(wanted, allowed):
    assert Limiter(LIMITS).limit(0.0, wanted, LONG_S).steering_rad == allowed


def test_a_lower_top_speed_is_obeyed_at_once_and_a_higher_one_by_and_by():
    limiter = moving(4.0)
    limiter.tune(LIMITS.model_copy(update={"max_speed_mps": 1.5}))
    assert limiter.limit(4.0, 0.0, 0.0).speed_mps == 1.5
    limiter.tune(LIMITS)
    assert limiter.limit(3.0, 0.0, 0.02).speed_mps == pytest.approx(1.58)


def test_speed_rises_slowly_and_falls_at_once():
    limiter = Limiter(LIMITS)
    assert limiter.limit(4.0, 0.0, 0.02).speed_mps == pytest.approx(0.08)
    assert limiter.limit(4.0, 0.0, 0.02).speed_mps == pytest.approx(0.16)
    assert moving(4.0).limit(1.0, 0.0, 0.001).speed_mps == 1.0
    assert moving(4.0).limit(0.0, 0.0, 0.0).speed_mps == 0.0
    assert moving(-1.0).limit(0.0, 0.0, 0.0).speed_mps == 0.0


def test_reverse_rises_slowly_too():
    assert Limiter(LIMITS).limit(-1.0, 0.0, 0.02).speed_mps == pytest.approx(-0.08)


def test_from_ahead_to_reverse_goes_through_standstill():
    assert moving(2.0).limit(-1.0, 0.0, LONG_S).speed_mps == 0.0
    assert moving(-1.0).limit(2.0, 0.0, LONG_S).speed_mps == 0.0


def test_steering_slews():
    limiter = Limiter(LIMITS)
    assert limiter.limit(0.0, 0.34, 0.02).steering_rad == pytest.approx(0.064)
    assert limiter.limit(0.0, -0.34, 0.02).steering_rad == pytest.approx(0.0)


def test_nobody_steering_holds_the_wheels():
    assert moving(1.0, 0.2).limit(0.0, None, 0.02).steering_rad == 0.2


def test_after_a_standstill_it_starts_from_zero():
    limiter = moving(3.0, 0.2)
    limiter.standstill()
    drive = limiter.limit(3.0, 0.2, 0.02)
    assert (drive.speed_mps, drive.steering_rad) == (pytest.approx(0.08), 0.2)


@pytest.mark.parametrize("sign", [1, -1])
def test_after_a_gentle_stop_it_starts_from_what_the_brake_has_left(sign):
    limiter = moving(sign * 1.0)
    for _ in range(10):
        assert limiter.limit(0.0, 0.0, 0.02, brake_mps2=1.25).speed_mps == 0.0
    assert limiter.limit(sign * 1.0, 0.0, 0.02).speed_mps == pytest.approx(sign * (1.0 - 0.2 * 1.25 + 0.08))
    assert limiter.limit(sign * 1.0, 0.0, 0.02).speed_mps == pytest.approx(sign * (1.0 - 0.2 * 1.25 + 0.16))


def test_turned_wheels_brake_as_well():
    limiter = moving(3.0, 0.34)
    limiter.limit(0.0, 0.34, 0.0, brake_mps2=1.25)
    drive = limiter.limit(4.0, 0.34, 0.4)
    assert drive.speed_mps == pytest.approx(3.0 - 0.4 * (1.25 + ASIDE_MPS2 * math.sin(0.34)) + 0.4 * 4.0)


def test_a_gentle_stop_ends_at_standstill_and_a_slower_wish_is_obeyed_at_once():
    limiter = moving(2.0)
    limiter.limit(0.0, 0.0, 0.0, brake_mps2=1.25)
    assert limiter.limit(0.5, 0.0, 0.02).speed_mps == 0.5
    limiter = moving(2.0)
    limiter.limit(0.0, 0.0, 0.0, brake_mps2=1.25)
    assert limiter.limit(-0.5, 0.0, 0.02).speed_mps == 0.0  # it still rolls ahead
    limiter = moving(2.0)
    limiter.limit(0.0, 0.0, 0.0, brake_mps2=1.25)
    limiter.limit(0.0, 0.0, LONG_S, brake_mps2=1.25)
    assert limiter.limit(2.0, 0.0, 0.02).speed_mps == pytest.approx(0.08)


def test_a_hard_stop_leaves_what_one_of_1_g_would():
    """No floor gives more: from zero, the motor locked the wheels of a car that was to roll on."""
    limiter = moving(3.0)
    for brake_mps2 in (1.25, math.inf, 1.25):
        limiter.limit(0.0, 0.0, 0.02, brake_mps2)
    left_mps = 3.0 - 0.02 * (1.25 + GRAVITY_MPS2 + 1.25)
    assert limiter.limit(3.0, 0.0, 0.02).speed_mps == pytest.approx(left_mps + 0.08)
    limiter = moving(3.0)
    limiter.limit(0.0, 0.0, 0.0)
    limiter.limit(0.0, 0.0, 0.31)
    assert limiter.limit(3.0, 0.0, 0.02).speed_mps == pytest.approx(0.08)
    limiter = moving(3.0)
    limiter.limit(0.0, 0.0, 0.02, 1.25)
    limiter.standstill()
    assert limiter.limit(3.0, 0.0, 0.02).speed_mps == pytest.approx(0.08)


@pytest.mark.parametrize("wish_mps", [0.9, -0.9])
def test_a_drive_that_went_out_as_a_brake_is_a_stop_to_rise_from(wish_mps):
    limiter, left_mps = moving(wish_mps), 0.9
    limiter.limit(wish_mps, 0.0, 0.02)
    for _ in range(4):
        limiter.braked()
        left_mps -= 0.02 * GRAVITY_MPS2
        assert abs(limiter.limit(wish_mps, 0.0, 0.02).speed_mps) == pytest.approx(left_mps + 0.08)
    for _ in range(4):
        limiter.braked()
        assert limiter.limit(wish_mps, 0.0, 0.02).speed_mps * wish_mps > 0
    assert abs(limiter.limit(0.9, 0.0, 0.0).speed_mps) <= 0.08


def test_a_brake_in_place_of_a_drive_keeps_wheels_and_strength():
    limiter = moving(3.0, 0.2)
    limiter.limit(3.0, 0.2, 0.0, brake_mps2=1.25)
    limiter.braked()
    drive = limiter.limit(4.0, None, 0.1)
    left_mps = 3.0 - 0.1 * (1.25 + ASIDE_MPS2 * math.sin(0.2))
    assert (drive.speed_mps, drive.steering_rad) == (pytest.approx(left_mps + 0.4), 0.2)


@given(st.lists(st.tuples(st.floats(-20, 20), st.one_of(st.none(), st.floats(-5, 5)), st.floats(0, 0.5)), max_size=30))
def test_no_sequence_leaves_the_limits(wishes):
    limiter = Limiter(LIMITS)
    last, rolls_mps = limiter.limit(0.0, 0.0, 0.0), 0.0
    for speed_mps, steering_rad, dt_s in wishes:
        drive = limiter.limit(speed_mps, steering_rad, dt_s)
        assert -1.0 <= drive.speed_mps <= 4.0
        assert abs(drive.steering_rad) <= 0.34
        assert abs(drive.steering_rad - last.steering_rad) <= 3.2 * dt_s + 1e-9
        rolls_mps = abs(last.speed_mps) or rolls_mps  # a stop leaves no more than what it found
        assert abs(drive.speed_mps) <= rolls_mps + 4.0 * dt_s + 1e-9
        assert last.speed_mps * drive.speed_mps >= 0
        assert math.isfinite(drive.speed_mps)
        last = drive
