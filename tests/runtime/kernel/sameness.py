"""When two answers are the same; and drives and rooms in which they are asked for."""

import math
from typing import Any

import numpy as np
import pytest
from hypothesis import strategies as st

from tests.runtime.in_earnest import judged
from tests.runtime.kernel.structures import STRUCTURES
from wallride.drivers.accelerated import FUNCTIONS
from wallride.drivers.api import MotorState, Scan
from wallride.runtime.control.safety.swept import SweptGuard
from wallride.runtime.control.safety.swept_settings import SweptSettings
from wallride.runtime.control.vehicle import CarSettings
from wallride.runtime.control.wall_following.ball import BallFollower
from wallride.runtime.control.wall_following.ball_settings import BallSettings

BEAMS, STEP_RAD = 1081, math.radians(0.25)
ROUNDING = 1e-9
"""Sines and sums are rounded differently; whatever is a choice (a beam, a yes or no) has to be the same."""
SOME_RAD = st.one_of(st.floats(-0.4, 0.4), st.sampled_from([0.0, 0.1, 0.1 + 1e-7, 0.2]))
ANGLE = st.floats(-1.5, 1.5)


class _Python(dict[str, Any]):
    """The functions as written in Python, by name, with the arguments of the C."""

    def __missing__(self, name):
        structures = STRUCTURES.get(name, lambda *given: given)
        return lambda *flat: FUNCTIONS[name].python(*structures(*flat))


PYTHON = _Python()


def assert_same(name, one, other):
    if isinstance(one, tuple | list):
        assert type(one) is type(other), name
        assert len(one) == len(other), name
        for a, b in zip(one, other, strict=True):
            assert_same(name, a, b)
    elif isinstance(one, np.ndarray):
        assert one.dtype == other.dtype, name
        assert one.shape == other.shape, name
        exact = one.dtype.kind in "bi"
        if one.tobytes() != other.tobytes():  # else they are the same at a hundredth of the time
            np.testing.assert_allclose(other, one, rtol=0 if exact else ROUNDING, atol=0 if exact else ROUNDING)
    elif isinstance(one, float):
        assert other == one or other == pytest.approx(one, rel=ROUNDING, abs=ROUNDING, nan_ok=True), name
    else:
        assert (type(one), one) == (type(other), other), name


def same(compiled, name, *given_):
    """Return the answer of the Python; fail where the C has another."""
    answer = PYTHON[name](*given_)
    assert_same(name, answer, compiled[name](*given_))
    return answer


def same_or_refused(compiled, name, *given_, match=None):
    """As `same`, but both may refuse with the same error."""
    try:
        answer = PYTHON[name](*given_)
    except (ValueError, OverflowError, ZeroDivisionError) as error:
        with pytest.raises(type(error), match=match):
            compiled[name](*given_)
    else:
        assert_same(name, answer, compiled[name](*given_))


def other_lengths_are_refused(compiled, name, given_, places):
    """See that the C refuses each of these arrays when it is one shorter than the others."""
    for place in places:
        with pytest.raises(ValueError, match="different lengths"):
            compiled[name](*given_[:place], given_[place][1:].copy(), *given_[place + 1 :])


class Drive:
    """Feeds scans to both laws of a car that drives by dead reckoning; asks about driving on and about backing out."""

    def __init__(self, side="left"):
        car = CarSettings(lidar_y_m=0.03)
        self.guard = SweptGuard(SweptSettings(), car)
        self.follower = BallFollower(BallSettings(speed_mps=2.0, side=side), car, self.guard.perception.views)
        self.way_m = 0.0
        self.scans = 0

    def see(self, sweep, speed_mps=2.0, steering_rad=0.05):
        self.way_m += 0.025 * speed_mps
        motor = MotorState(
            sweep.stamp_s, speed_mps, self.way_m, steering_rad, 11.0, 0.0, 0.0, 30.0, "", timed_out=False, killed=False
        )
        assessment = self.guard.look(sweep, motor)
        guidance = self.follower.follow(sweep, motor)
        wish = guidance.drive
        if wish is not None:
            judged(assessment, wish.speed_mps, wish.steering_rad)
        for asked in ((4.0, 0.3), (1.0, -0.34), (-0.4, 0.2)):
            judged(assessment, *asked)
        self.scans += 1

    def see_ranges(self, ranges_m, **how):
        at_s = 0.025 * self.scans
        ranges_m = np.asarray(ranges_m, np.float32)
        self.see(Scan(at_s, at_s, -STEP_RAD * (BEAMS // 2), STEP_RAD, 0.02, 30.0, ranges_m, self.scans), **how)


def ranges(draw_seed):
    """Return ranges as a hostile room gives them: pieces of walls, poles, dirt, the car's own parts, silence, noise."""
    rng = np.random.default_rng(draw_seed)
    ranges_m = np.empty(BEAMS)
    edges = np.sort(rng.integers(0, BEAMS, rng.integers(1, 40)))
    for piece in np.split(np.arange(BEAMS), edges):
        nearest_m = rng.choice([0.05, 0.15, 0.3, 0.5, 0.8, 1.5, 3.0, 6.0, 20.0])
        ranges_m[piece] = nearest_m * (1 + rng.uniform(-0.01, 0.01) * np.arange(piece.size))
        if rng.random() < 0.2:
            ranges_m[piece] = rng.choice([math.nan, math.inf, 0.0, -1.0])
    ranges_m += rng.normal(0, rng.choice([0.0, 0.005, 0.03]), BEAMS)
    wild = rng.random(BEAMS) < 0.03
    ranges_m[wild] = rng.uniform(0.0, 10.0, np.count_nonzero(wild))
    return ranges_m
