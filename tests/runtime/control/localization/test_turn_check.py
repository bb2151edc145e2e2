"""A pose that turns the other way than the wheels steer is lost; understeer, lag, a spin and a standing car are not."""

import math

import pytest

from wallride.runtime.control.localization.turn_check import FITS_SHARE, WAY_M, TurnCheck

STEP_M = 0.05


def checked(way_m, pose_radpm, wheels_radpm, *, share=0.7, step_m=STEP_M):
    """Return whether turns speak against the pose after a way."""
    check = TurnCheck()
    for _ in range(round(way_m / step_m)):
        check.take(step_m, step_m * pose_radpm, step_m * wheels_radpm)
    return check.contradicts(share)


@pytest.mark.parametrize(
    ("way_m", "pose_radpm", "wheels_radpm", "found"),
    [
        (4.0, -0.3, 0.3, True),
        (4.0, 0.3, -0.3, True),
        (40.0, -0.3, 0.3, True),
        (2.0, -0.3, 0.3, False),  # too little yet
        (40.0, -0.1, 1.0, False),  # a slide aside in a bend
        (40.0, 0.2, 1.0, False),  # understeer
        (40.0, 0.3, 0.0, False),  # a trim that is not known
    ],
)
def test_turns_the_other_way_round_contradict(way_m, pose_radpm, wheels_radpm, found):
    assert checked(way_m, pose_radpm, wheels_radpm) is found


def test_a_scan_that_fits_is_believed_against_the_wheels():
    assert checked(4.0, -0.3, 0.3, share=FITS_SHARE - 0.01)
    assert not checked(4.0, -0.3, 0.3, share=FITS_SHARE)
    assert not checked(4.0, -0.3, 0.3, share=math.nan), "no beam is no evidence"


def test_backwards_counts_and_a_car_that_stands_remembers_nothing():
    check = TurnCheck()
    for _ in range(1000):
        check.take(0.0005, 0.01, -0.01)
    assert not check._steps
    for _ in range(100):
        check.take(-STEP_M, -0.02, 0.02)
    assert check.contradicts(0.7)
    assert len(check._steps) <= WAY_M / STEP_M + 1
    check.begin()
    assert not check.contradicts(0.7)


def test_an_earlier_way_is_forgotten():
    check = TurnCheck()
    for turn in (0.3, 0.0):
        for _ in range(100):
            check.take(STEP_M, STEP_M * turn, -STEP_M * turn)
    assert not check.contradicts(0.7)
