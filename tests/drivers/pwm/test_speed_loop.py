"""The speed by scans: kept where they tell it, thought and slow where they do not, a fault where they contradict."""

import pytest

from wallride.drivers.maestro.settings import MaestroSettings
from wallride.drivers.pwm.speed import EstimatedSpeed
from wallride.drivers.pwm.speed_loop import (
    BACKWARDS,
    BACKWARDS_S,
    FOLLOWS_S,
    FRESH_S,
    RUNS_AWAY,
    RUNS_AWAY_S,
    SEES_AGAIN_S,
    STALLED,
    STALLED_S,
    SpeedLoop,
)

STEP_S = 0.025


class Car:
    """A car whose speed follows what its ESC is asked for, times a gain."""

    def __init__(self, gain=1.0):
        self.loop = SpeedLoop(MaestroSettings())
        self.loop.forget(0.0)
        self.gain, self.now_s, self.speed_mps = gain, 0.0, 0.0

    def drive(self, wanted_mps, duration_s, *, spread_mps=0.1, shows=None):
        for _ in range(round(duration_s / STEP_S)):
            self.now_s += STEP_S
            asked_mps = self.loop.command_mps(wanted_mps, self.now_s)
            self.speed_mps += (self.gain * asked_mps - self.speed_mps) * STEP_S / FOLLOWS_S
            seen_mps = self.speed_mps if shows is None else shows
            self.loop.learn(EstimatedSpeed(self.now_s, seen_mps, spread_mps), self.now_s)


def is_blind(car):
    return car.loop.blind


@pytest.mark.parametrize("gain", [0.7, 1.0, 1.3])
def test_a_speed_is_kept_with_any_battery(gain):
    car = Car(gain)
    car.drive(0.0, 1.0)
    car.drive(1.0, 4.0)
    assert car.speed_mps == pytest.approx(1.0, abs=0.03)
    assert not car.loop.fault


def test_a_stop_stays_a_stop():
    car = Car(0.7)
    car.drive(1.0, 4.0)
    assert car.loop.command_mps(0.0, car.now_s) == 0.0


def test_what_is_not_told_is_blind_and_the_car_is_thought_to_follow():
    car = Car()
    car.drive(0.0, 1.0)
    assert not is_blind(car)
    car.drive(0.5, FRESH_S + 1.0, spread_mps=1.5)
    assert is_blind(car)
    assert car.loop.speed_mps == pytest.approx(0.5, abs=0.05)


def test_it_is_told_again_only_after_a_while():
    car = Car()
    car.drive(0.5, 2.0, spread_mps=1.5)
    car.drive(0.5, 0.6 * SEES_AGAIN_S)
    assert is_blind(car)
    car.drive(0.5, SEES_AGAIN_S)
    assert not is_blind(car)


def test_no_estimates_at_all_are_blind():
    car = Car()
    car.drive(1.0, 2.0)
    car.loop.advance(car.now_s + 1.1 * FRESH_S)
    assert is_blind(car)


@pytest.mark.parametrize("old", [EstimatedSpeed(-9.0, 1.0, 0.1), EstimatedSpeed(0.0, float("nan"), 0.1)])
def test_an_old_estimate_and_one_that_is_no_number_tell_nothing(old):
    loop = SpeedLoop(MaestroSettings())
    loop.forget(0.0)
    for step in range(100):
        loop.learn(old, step * STEP_S)
    assert loop.blind
    assert loop.speed_mps == 0.0


@pytest.mark.parametrize(
    ("shows_mps", "after_s", "words"),
    [(0.0, STALLED_S, STALLED), (2.4, RUNS_AWAY_S, RUNS_AWAY), (-0.5, BACKWARDS_S, BACKWARDS)],
)
def test_scans_that_contradict_the_command_are_a_fault(shows_mps, after_s, words):
    car = Car()
    car.drive(1.0, 0.7 * after_s, shows=shows_mps)
    assert not car.loop.fault
    car.drive(1.0, 0.5 * after_s, shows=shows_mps)
    assert car.loop.fault == words


def test_a_car_that_slows_down_does_not_run_away():
    car = Car()
    car.drive(2.0, 3.0)
    car.drive(0.5, 3.0)
    assert not car.loop.fault
