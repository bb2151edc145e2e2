"""Tests of a law, without a car: they drive in the simulator, faster than real time. Needs pytest."""

import numpy as np

from wallride.lab import run
from wallride.new.pd_follower import PdFollower


def test_it_drives_on_in_the_loop_without_contact() -> None:
    """Drive 20 s at 1 m/s."""
    driven = run("loop", PdFollower, duration_s=20.0)
    assert driven.contact is None
    assert driven.distance_m > 5.0


def test_it_answers_the_same_twice() -> None:
    """The same seed is the same drive, bit by bit."""
    first, second = (run("loop", PdFollower, duration_s=3.0, seed=7) for _ in range(2))
    assert np.array_equal(first.pose, second.pose)
