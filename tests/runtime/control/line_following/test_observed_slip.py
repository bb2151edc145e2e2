"""The slip that is left of what the pose tells, once its growth near the grip is taken out."""

import math

import pytest

from tests.runtime.control.line_following.test_line_law import TYRES
from wallride.runtime.control.line_following.observed_slip import ObservedSlip
from wallride.runtime.control.tyres import Moving, slip_rad
from wallride.runtime.control.vehicle import GRAVITY_MPS2

SPEED_MPS, PERIOD_S = 4.0, 0.025


def told_s2pm(used, mu=TYRES.mu):
    """Return the slip that a pose tells in a bend that uses a share of the assumed grip, on a floor of friction mu."""
    lateral_mps2 = used * TYRES.mu * GRAVITY_MPS2
    return slip_rad(lateral_mps2, TYRES.rear_per_rad, mu) / lateral_mps2


def observed(*bends, mu=TYRES.mu, scans=800):
    """Return what is left after bends that use these shares of the grip, of what the pose tells of the last one."""
    slip = ObservedSlip()
    left = 0.0
    for used in bends:
        turn_radps = used * TYRES.mu * GRAVITY_MPS2 / SPEED_MPS
        for _ in range(scans):
            car = Moving(0j, 0.0, SPEED_MPS, turn_radps)
            left = slip.take(car, PERIOD_S, TYRES, told_s2pm(used or bends[0], mu))
    return left


@pytest.mark.parametrize("used", [0.3, 0.5, 0.75, -0.9])
def test_a_car_whose_grip_is_as_assumed_slips_by_its_stiffness_alone(used):
    assert observed(used) == pytest.approx(told_s2pm(0.01), rel=0.02)


def test_until_bends_have_told_it_the_slip_is_as_assumed():
    standing, bend = Moving(0j, 0.0, 0.0, 0.1), Moving(0j, 0.0, SPEED_MPS, 1.0)
    slip, told = ObservedSlip(), 1.5 * TYRES.slip_s2pm
    assert slip.take(standing, 1e6, TYRES, told) == TYRES.slip_s2pm
    left = [slip.take(bend, PERIOD_S, TYRES, told) for _ in range(200)]
    assert TYRES.slip_s2pm < left[0] < left[40] < left[-1] < told
    assert left[0] < 1.15 * TYRES.slip_s2pm
    assert left[-1] > 1.3 * TYRES.slip_s2pm
    assert slip.take(standing, 1e6, TYRES, told) == left[-1], "a pause changes nothing"


@pytest.mark.parametrize("turn_radps", [5.0, -5.0, math.nan])
def test_a_car_that_spins_tells_nothing(turn_radps):
    slip, told = ObservedSlip(), 1.5 * TYRES.slip_s2pm
    before = [slip.take(Moving(0j, 0.0, SPEED_MPS, 1.0), PERIOD_S, TYRES, told) for _ in range(200)][-1]
    assert slip.take(Moving(0j, 0.0, SPEED_MPS, turn_radps), PERIOD_S, TYRES, told) == before


@pytest.mark.parametrize(("told", "counts"), [(0.9, 1.2), (1.5, 1.5)])
def test_more_slip_counts_at_once_and_less_only_after_bends(told, counts):
    """Between two bends the pose tells too little: a car that believed it came to the next one too fast."""
    slip, bend = ObservedSlip(), Moving(0j, 0.0, SPEED_MPS, 1.0)
    for _ in range(800):
        slip.take(bend, PERIOD_S, TYRES, 1.2 * TYRES.slip_s2pm)
    assert slip.take(bend, PERIOD_S, TYRES, told * TYRES.slip_s2pm) == pytest.approx(counts * TYRES.slip_s2pm, rel=0.03)


def test_a_straight_tells_nothing_new():
    assert observed(0.8, 0.0) == pytest.approx(told_s2pm(0.01), rel=0.02)


def test_a_floor_of_less_grip_stays_told_from_a_bend_near_the_grip():
    assert told_s2pm(0.75) > 1.09 * told_s2pm(0.01), "so much would look like less grip"
    less = observed(0.7, mu=TYRES.mu / 1.2)
    assert TYRES.floor_mu(less) < TYRES.mu / 1.2
    assert TYRES.floor_mu(observed(0.75)) == TYRES.mu
