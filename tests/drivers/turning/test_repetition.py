"""A turn that repeats while the car moves is a stored one; noise, standing still and silence are not."""

import numpy as np
import pytest

from wallride.drivers.turning.repetition import NEW_TURNS, REPEATED_M, Repetition

TURN_S = 0.1
RNG = np.random.default_rng(1)


def turn(noise_m: float = 0.0, silent: float = 0.0) -> np.ndarray:
    range_m = np.linspace(1.0, 3.0, 720) + RNG.normal(0.0, noise_m, 720)
    range_m[RNG.random(720) < silent] = np.nan
    return np.round(range_m, 3)


def judged(speed_mps: float, turns: list[np.ndarray]) -> list[bool]:
    repetition = Repetition()
    return [repetition.is_stored(one, speed_mps, TURN_S) for one in turns]


def test_a_repeated_turn_is_stored_after_a_short_way():
    told = judged(1.0, [turn()] * 8)
    assert told.index(True) == round(REPEATED_M / (1.0 * TURN_S))
    assert all(told[told.index(True) :])


def test_a_car_that_stands_tells_nothing():
    assert not any(judged(0.0, [turn()] * 50))


@pytest.mark.parametrize("noise_m", [0.001, 0.003, 0.01])
def test_noise_is_a_measurement(noise_m):
    assert not any(judged(2.0, [turn(noise_m) for _ in range(20)]))


def test_it_stays_stored_at_rest_until_another_turn_comes():
    repetition, one = Repetition(), turn()
    for _ in range(5):
        repetition.is_stored(one, 2.0, TURN_S)
    assert repetition.stored
    assert repetition.is_stored(one, 0.0, TURN_S)
    assert not repetition.is_stored(turn(0.01), 0.0, TURN_S)


def test_a_turn_without_echoes_is_not_judged():
    assert not any(judged(2.0, [turn(silent=1.0)] * 20))


def test_a_turn_may_have_one_sample_more():
    one = turn()
    repetition = Repetition()
    told = [repetition.is_stored(one[: 720 - k % 2], 2.0, TURN_S) for k in range(8)]
    assert told[-1]


def test_turns_that_are_played_again_are_stored_ones():
    """A second of turns, again and again: none is like the one before."""
    told = judged(1.0, [turn(0.01) for _ in range(10)] * 3)
    assert told.index(True) == 11
    assert all(told[11:])


def test_played_turns_of_a_car_that_stood_are_none_and_end_with_new_ones():
    repetition, again = Repetition(), [turn(0.01) for _ in range(5)]
    assert not any(repetition.is_stored(one, 0.0, TURN_S) for one in again * 2)
    assert [repetition.is_stored(one, 1.0, TURN_S) for one in again][-1]
    told = [repetition.is_stored(turn(0.01), 1.0, TURN_S) for _ in range(NEW_TURNS)]
    assert told == [True] * (NEW_TURNS - 1) + [False]


@pytest.mark.parametrize("silent", [0.0, 1.0])
def test_one_new_turn_where_the_played_ones_begin_again_does_not_end_them(silent):
    again = [turn(0.01) for _ in range(10)]
    told = judged(1.0, [*again, *again, turn(0.01, silent), *again])
    assert all(told[11:])
