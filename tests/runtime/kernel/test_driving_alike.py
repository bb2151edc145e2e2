"""Motions are foreseen alike, steps driven."""

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from tests.runtime.kernel.sameness import PYTHON, SOME_RAD, same, same_or_refused
from wallride.runtime.control.wall_following.prediction import SteeringHistory, Told

BOUND_S = st.floats(0.0, 0.2)


@given(
    told=st.lists(st.tuples(st.floats(8.7, 9.1), SOME_RAD), max_size=12).map(lambda told: tuple(sorted(told))),
    obeyed_s=st.sampled_from([-math.inf, 8.4, 8.9]),
    wire_s=st.tuples(BOUND_S, BOUND_S),
    motor=st.tuples(st.floats(8.8, 9.1), st.floats(-1.0, 8.0), SOME_RAD),
    servo_rad=st.floats(-0.4, 0.4),
    times=st.tuples(st.floats(8.9, 9.1), st.floats(0.0, 1.0), st.floats(-0.1, 0.4)),
    car=st.tuples(st.floats(0.2, 0.5), st.floats(-0.1, 0.1), st.floats(0.1, 10.0)),
)
def test_any_motion_is_foreseen_alike(compiled, told, obeyed_s, wire_s, motor, servo_rad, times, car):
    given_ = (told, (obeyed_s, *wire_s), *motor, servo_rad, *times, *car)
    same(compiled, "predict_motion", *given_)


FORESEEN = [9.0, 2.0, 0.1, 0.05, 8.99, 0.025, 0.04, 0.33, 0.01, 3.2]
"""The numbers of `foreseen`, after the answers told and the wire."""


@given(steps=st.lists(st.tuples(st.floats(0.0, 0.06), SOME_RAD, st.integers(0, 3)), min_size=1, max_size=25))
def test_the_way_to_the_wire_is_measured_alike_along_a_drive(compiled, steps):
    told: Told = ()
    wire, now_s = SteeringHistory(3.2).wire, 9.0
    for since_s, angle_rad, ago in steps:
        now_s += since_s
        told = (*told[-11:], (now_s, angle_rad))
        given_ = (told, wire, now_s + 0.01, 2.0, told[-1 - ago % len(told)][1], 0.05, now_s, *FORESEEN[5:])
        answer = same(compiled, "predict_motion", *given_)
        wire = answer[0]


@pytest.mark.parametrize("place", range(15))
@pytest.mark.parametrize("told", [(), ((8.9, 0.1), (8.97, 0.2)), ((math.nan, 0.1), (8.97, math.nan)), ((8.9, 0.3),)])
def test_what_is_no_number_is_foreseen_alike(compiled, place, told):
    numbers = [8.8, 0.01, 0.06, *FORESEEN]
    if place < len(numbers):
        numbers[place] = math.nan
    if place in {1, 2, 9}:  # how long it takes, which is rounded to steps
        for of in (PYTHON, compiled):
            with pytest.raises(ValueError, match="NaN to integer"):
                of["predict_motion"]((), tuple(numbers[:3]), *numbers[3:])
        return
    given_ = (told, tuple(numbers[:3]), *numbers[3:])
    same(compiled, "predict_motion", *given_)


def test_more_answers_than_are_remembered_are_refused(compiled):
    with pytest.raises(TypeError, match="at most 12 answers"):
        compiled["predict_motion"](((9.0, 0.1),) * 13, (8.9, 0.0, 0.1), *FORESEEN)


@given(
    place=st.tuples(st.floats(-50.0, 50.0), st.floats(-50.0, 50.0), st.floats(-3.2, 3.2)),
    step_m=st.floats(-2.0, 20.0),
    steering_rad=SOME_RAD,
)
def test_any_step_is_driven_alike(compiled, place, step_m, steering_rad):
    given_ = (*place, step_m, steering_rad, 0.33)
    same(compiled, "dead_reckon", *given_)


@pytest.mark.parametrize("place", range(6))
def test_what_is_no_number_is_driven_alike(compiled, place):
    given_ = [1.0, 2.0, 0.5, 0.1, 0.2, 0.33]
    for value in (math.nan, math.inf):
        given_[place] = value
        same_or_refused(compiled, "dead_reckon", *given_, match="math domain error")  # no angle is without end
