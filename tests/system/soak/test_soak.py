"""Random faults for some virtual minutes, often several at once, and not one motor command that breaks a rule.

The long ones are `python -m benchmarks.soak`.
"""

import pytest

from tests.system.soak.faults import FAULTS
from tests.system.soak.virtual import soak, suffer
from tests.tiers import slow

SECONDS, MEAN_PAUSE_S = 60.0, 2.0
MIN_WAY_M, MIN_FAULTS, MIN_MOVING = 15.0, 20, 40


def test_no_motor_command_breaks_a_rule_whatever_happens():
    found = soak(SECONDS, 1, MEAN_PAUSE_S)
    assert found.violations == {}, found.kept
    assert found.way_m > MIN_WAY_M
    assert sum(found.faults.values()) > MIN_FAULTS
    assert set(found.faults) == set(FAULTS)


def test_the_same_seed_is_the_same_soak():
    found = soak(5.0, 3, 0.5)
    assert found.faults
    assert found == soak(5.0, 3, 0.5)


@pytest.mark.parametrize("lasts_s", [0.09, 0.11, *slow(0.15)])
def test_after_the_drivers_own_brake_on_an_impossible_speed_the_speed_rises_as_after_every_other(lasts_s):
    found = suffer("motor impossible speed", lasts_s=lasts_s)
    assert found.violations == {}, found.kept
    assert found.moving > MIN_MOVING


def test_a_fault_beside_an_impossible_speed_is_latched():
    def prepare(soak):
        soak._loop.call_at(4.2, soak.injector.begin, "motor fault", 4.2)

    found = suffer("motor impossible speed", lasts_s=1.5, prepare=prepare)
    assert found.violations == {}, found.kept
    assert found.faults["motor fault"] == 1


@pytest.mark.parametrize(
    ("fault", "lasts_s"),
    [("lidar mute", 2.0), ("motor mute", 2.02), *slow(("lidar mute", 2.02), ("motor mute", 2.0))],
)
def test_what_is_pressed_while_a_device_is_lost_moves_nothing_when_it_is_back(fault, lasts_s):
    found = suffer(fault, lasts_s=lasts_s)
    assert found.violations == {}, found.kept
    assert found.moving > MIN_MOVING
