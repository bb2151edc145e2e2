"""Several cars in one world in virtual time: far apart each drives as alone, and one that stands is not run into."""

from dataclasses import replace

import numpy as np
import pytest

from benchmarks.fleet import alone, cases, driven, gaps_m, together
from wallride.runtime.settings.tree import Settings
from wallride.sim.world.worlds import load_world

CLEARANCE_M = 0.1


def test_two_cars_half_a_lap_apart_drive_as_each_does_alone():
    settings = Settings()
    some = cases(load_world("loop"), 2, settings, 9.0, seed=3)
    runs = together(some, settings)
    for case, run in zip(some, runs, strict=True):
        here, by_itself = driven(run), driven(alone(case, settings))
        assert here.contacts == 0
        assert here.error_m == pytest.approx(by_itself.error_m, rel=0.05)
        assert gaps_m(runs).min() > 3.0


def test_a_car_sees_another_one_that_stands_in_its_way_and_stops():
    settings = Settings()
    first, second = cases(load_world("straight"), 2, settings, 4.5, seed=0)
    runs = together([first, replace(second, duration_s=0.0)], settings)
    assert runs[0].contact is None
    assert runs[0].speed_mps[-1, 0] == pytest.approx(0.0, abs=0.01)
    assert runs[0].clearance_m[-1] > CLEARANCE_M
    assert runs[0].distance_m < 3.0, "the other one stands 3 m ahead"
    assert alone(first, settings).distance_m > 3.5, "and without it the way is free"


def test_together_is_repeatable_bit_by_bit():
    settings = Settings()
    some = cases(load_world("loop"), 3, settings, 1.0, seed=5)
    one, other = together(some, settings), together(some, settings)
    assert all(np.array_equal(a.pose, b.pose) for a, b in zip(one, other, strict=True))
