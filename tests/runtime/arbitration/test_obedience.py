"""Wheels that go on although the car brakes are told; those that slow down, or stand, are not."""

from types import SimpleNamespace
from typing import Any

import pytest

from wallride.runtime.arbitration.obedience import Obedience


def watch(speeds_mps, sent_mps=0.0, every_s=0.05):
    """Show speeds, one after the other, and return what was said at the end."""
    obedience: Any = Obedience()
    for number, speed_mps in enumerate(speeds_mps):
        output = SimpleNamespace(drive=SimpleNamespace(speed_mps=sent_mps))
        obedience.look(output, SimpleNamespace(speed_mps=speed_mps), number * every_s)
    return obedience.words


@pytest.mark.parametrize("speed_mps", [1.0, -1.0, 5.0])
def test_wheels_that_go_on_are_told(speed_mps, caplog):
    (word,) = watch([speed_mps] * 45)
    assert f"{abs(speed_mps):.1f} m/s although the car brakes" in word
    assert len(caplog.records) == 1


def test_wheels_that_slow_down_roll_out_or_stand_are_not():
    assert watch([1.0 - 0.02 * n for n in range(34)]) == ()  # as without a brake
    assert watch([0.1] * 100) == ()
    assert watch([1.0] * 15) == ()
    assert watch([1.0] * 100, sent_mps=1.0) == ()


def test_it_is_over_when_they_obey():
    assert watch([1.0] * 45 + [1.0 - 0.05 * n for n in range(25)]) == ()
