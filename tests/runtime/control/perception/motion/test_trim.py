"""The steering's trim, learnt on straights by the turn of the poses alone."""

import math

import numpy as np
import pytest

from wallride.runtime.control.perception.motion.trim import MOST_RAD, SteeringTrim
from wallride.runtime.control.tyres import TURN_LAG_S, Moving, Tyres

TYRES = Tyres(0.33, 0.8, 4.7, 5.5)
STEP_S = 0.025


def rolled(trim, *, true_rad, speed=3.0, told_rad=lambda k: 0.0, scans=300, noise_rad=0.004, lags=False):
    """Roll a car whose wheels stand `true_rad` off what they are told; the filter's own turn leans to what is told."""
    noise, yaw_rad, wheels_rad = np.random.default_rng(1), 0.0, 0.0
    for k in range(scans):
        wheels_rad += (1.0 - math.exp(-STEP_S / TURN_LAG_S) if lags else 1.0) * (told_rad(k) - wheels_rad)
        turn_radps = speed * math.tan(wheels_rad + true_rad) / 0.33
        yaw_rad = math.remainder(yaw_rad + turn_radps * STEP_S, math.tau)
        now = Moving(0j, yaw_rad + float(noise.normal(0.0, noise_rad)), speed, 0.7 * turn_radps, trim.rad)
        trim.learn(now, told_rad(k), STEP_S, TYRES)
    return trim.rad


@pytest.mark.parametrize("true_rad", [0.02, -0.015, 0.0])
def test_it_is_learnt_whole(true_rad):
    assert rolled(SteeringTrim(), true_rad=true_rad, speed=2.0) == pytest.approx(true_rad, abs=0.003)


@pytest.mark.parametrize(
    "more", [{"speed": 0.3}, {"speed": 5.0, "told_rad": lambda k: 0.2}, {"told_rad": lambda k: 0.03 * (-1) ** k}]
)
def test_standing_in_bends_and_while_steering_nothing_is_learnt(more):
    assert rolled(SteeringTrim(), true_rad=0.03, **more) == 0.0


def test_a_turn_that_lags_behind_the_steering_on_a_one_way_course_is_no_trim():
    slow = rolled(SteeringTrim(), true_rad=0.01, speed=1.5, told_rad=lambda k: -0.002 * (k % 80), lags=True)
    assert slow == pytest.approx(0.01, abs=0.004)


def test_it_has_its_bound():
    assert rolled(SteeringTrim(), true_rad=0.16, speed=1.0, scans=2000) == MOST_RAD
