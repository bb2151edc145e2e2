"""What the laps teach: the aim beside the line where earlier laps were off it."""

import math

import numpy as np
import pytest

from tests.runtime.control.line_following.lines import circle, line_through
from wallride.runtime.control.line_following.lap_correction import LEAD_S, MOST_M, LapCorrection

SPEED_MPS, STEP_M = 4.0, 0.1
LINE = circle(radius_m=40.0 / math.tau, speed_mps=SPEED_MPS, step_m=STEP_M)
LENGTH_M = LINE.length_m
WAYS_M = np.arange(0.0, LENGTH_M, STEP_M)


def off_in_the_bend(along_m):
    """3 cm to the left over four metres, and on the line elsewhere."""
    return 0.03 * float(np.exp(-(((along_m - 20.0) / 2.0) ** 2)))


def lap(correction, aside_m, share=1.0, ways_m=WAYS_M):
    for along_m in ways_m:
        correction.take(float(along_m), aside_m(along_m), share)
    correction.lap_done()


def test_before_a_lap_it_aims_at_the_line():
    correction = LapCorrection(LINE)
    correction.take(20.0, 0.1, 1.0)
    assert not any(correction.aim_m(float(along_m), 1.0) for along_m in WAYS_M)


def test_after_a_lap_it_aims_to_the_other_side_a_moment_before_the_place():
    correction = LapCorrection(LINE)
    lap(correction, off_in_the_bend)
    aims_m = np.array([correction.aim_m(float(along_m), 1.0) for along_m in WAYS_M])
    assert WAYS_M[aims_m.argmin()] == pytest.approx(20.0 - LEAD_S * SPEED_MPS, abs=0.3)
    assert -0.03 < aims_m.min() < -0.015
    assert np.abs(aims_m[(WAYS_M < 12.0) | (WAYS_M > 28.0)]).max() < 0.001


@pytest.mark.parametrize("lag_s", [0.15, 0.25, 0.35])
def test_laps_of_a_car_that_follows_the_aim_come_to_the_line(lag_s):
    correction, errors_m = LapCorrection(LINE), []
    for _ in range(6):
        before = [correction.aim_m(float(along_m - lag_s * SPEED_MPS) % LENGTH_M, 1.0) for along_m in WAYS_M]
        driven = dict(zip(WAYS_M, before, strict=True))
        off_m = [off_in_the_bend(along_m) + driven[along_m] for along_m in WAYS_M]
        errors_m.append(float(np.abs(off_m).max()))
        lap(correction, lambda along_m, driven=driven: off_in_the_bend(along_m) + driven[along_m])
    assert errors_m[1] < 0.6 * errors_m[0]
    assert errors_m[-1] < 0.3 * errors_m[0]


def test_what_changes_faster_than_the_car_can_follow_is_not_learnt():
    correction = LapCorrection(LINE)
    lap(correction, lambda along_m: 0.05 if round(along_m / 0.3) % 2 else -0.05)
    assert max(abs(correction.aim_m(float(along_m), 1.0)) for along_m in WAYS_M) < 0.01


def test_what_was_learnt_fades_in_laps_without_an_error():
    correction = LapCorrection(LINE)
    for _ in range(4):
        lap(correction, lambda _: 0.04)
    learnt_m = correction.aim_m(20.0, 1.0)
    lap(correction, lambda _: 0.0)
    assert correction.aim_m(20.0, 1.0) == pytest.approx(0.95 * learnt_m)


def test_what_is_no_longer_there_is_unlearnt():
    correction = LapCorrection(LINE)
    lap(correction, lambda _: 0.04)
    learnt_m = correction.aim_m(20.0, 1.0)
    for _ in range(4):
        aim_m = correction.aim_m(20.0, 1.0)
        lap(correction, lambda _, aim_m=aim_m: aim_m)
    assert learnt_m == pytest.approx(-0.028)
    assert abs(correction.aim_m(20.0, 1.0)) < 0.001


def test_the_aim_stays_near_the_line_whatever_the_laps_say():
    correction = LapCorrection(LINE)
    for _ in range(10):
        lap(correction, lambda _: 0.7)
    assert correction.aim_m(20.0, 1.0) == pytest.approx(-MOST_M)
    for _ in range(10):
        lap(correction, lambda _: -0.7, share=0.3)
    assert correction.aim_m(20.0, 0.5) == pytest.approx(0.5 * MOST_M)


def test_a_slow_lap_teaches_more_for_a_fast_one():
    correction = LapCorrection(LINE)
    lap(correction, lambda _: 0.02, share=0.5)
    assert correction.aim_m(20.0, 1.0) == pytest.approx(2.0 * correction.aim_m(20.0, 0.5))


def test_pieces_without_a_scan_are_as_their_neighbours_and_a_lap_without_any_teaches_nothing():
    correction = LapCorrection(LINE)
    lap(correction, lambda _: 0.04, ways_m=WAYS_M[(WAYS_M < 15.0) | (WAYS_M > 25.0)])
    assert correction.aim_m(20.0, 1.0) == pytest.approx(-0.028)
    lap(correction, lambda _: 0.04, ways_m=())
    assert correction.aim_m(20.0, 1.0) == pytest.approx(-0.028)


def test_a_place_is_learnt_across_the_end_of_the_line():
    correction = LapCorrection(LINE)
    lap(correction, lambda along_m: 0.04 if along_m < 1.0 or along_m > 39.0 else 0.0)
    assert correction.aim_m(39.0, 1.0) == pytest.approx(-0.028, abs=0.004)
    assert correction.aim_m(20.0, 1.0) == 0.0


def test_what_is_learnt_is_as_wide_in_time_where_the_line_is_fast():
    """A car at twice the speed comes back to its line on twice the way, and is told on twice the way before."""
    turn = np.exp(1j * math.tau * np.arange(800) / 800)
    line = line_through(80.0 / math.tau * turn, math.tau / 80.0, np.where(np.arange(800) < 400, 6.0, 3.0))
    correction = LapCorrection(line)
    ways_m = np.arange(0.0, 80.0, 0.1)
    lap(correction, lambda along_m: 0.03 * (abs(along_m - 20.0) < 1.0 or abs(along_m - 60.0) < 0.5), ways_m=ways_m)
    aims_m = np.array([correction.aim_m(float(along_m), 1.0) for along_m in ways_m])
    fast_m, slow_m = (0.1 * np.count_nonzero(half < -0.0025) for half in (aims_m[:400], aims_m[400:]))
    assert fast_m == pytest.approx(2.0 * slow_m, rel=0.15)
    assert 20.0 - 0.1 * aims_m[:400].argmin() == pytest.approx(LEAD_S * 6.0, abs=0.3)
    assert 20.0 - 0.1 * aims_m[400:].argmin() == pytest.approx(LEAD_S * 3.0, abs=0.3)
