"""Distance, latched faults and the battery, from report to report."""

from dataclasses import replace

import pytest
from hypothesis import given
from hypothesis import strategies as st

from wallride.drivers.api import Health, MotorState
from wallride.drivers.vesc.calibration import Calibration
from wallride.drivers.vesc.condition import MAX_STEPS_PER_POLL, Tachometer, VescMonitor
from wallride.drivers.vesc.replies import Values
from wallride.drivers.vesc.settings import VescSettings

WELL = Values(
    motor_current_a=1.0,
    input_current_a=0.5,
    duty=0.1,
    erpm=4614,
    voltage_v=11.8,
    drawn_ah=0.0,
    charged_ah=0.0,
    drawn_wh=0.0,
    charged_wh=0.0,
    tachometer=0,
    tachometer_abs=0,
    fault_code=0,
    mosfet_temperature_c=31.5,
    status=0,
)


def wrap(counter: int) -> int:
    return (counter + 2**31) % 2**32 - 2**31


@given(
    start=st.integers(-(2**31), 2**31 - 1),
    steps=st.lists(st.integers(-MAX_STEPS_PER_POLL, MAX_STEPS_PER_POLL), max_size=30),
)
def test_the_sum_of_steps_survives_every_wrap(start, steps):
    tachometer = Tachometer()
    at, total = start, start
    tachometer.update(wrap(at), wrap(total), 0.0)
    for step in steps:
        at, total = at + step, total + abs(step)
        tachometer.update(wrap(at), wrap(total), 0.0)
    assert (tachometer.steps, tachometer.restarts) == (sum(steps), 0)


@pytest.mark.parametrize(
    ("before", "after"),
    [((5000, 5000), (0, 0)), ((500, 500), (0, 0)), ((-300, 2000), (10, 10)), ((0, 5000), (0, 0))],
    ids=["far", "near", "backwards", "same place"],
)
def test_a_reboot_keeps_the_sum_and_is_counted(before, after):
    tachometer = Tachometer()
    tachometer.update(before[0] - 100, before[1] - 100, 0.0)
    tachometer.update(before[0], before[1], 0.02)
    tachometer.update(after[0], after[1], 0.04)
    assert (tachometer.steps, tachometer.restarts) == (100, 1)
    tachometer.update(after[0] + 7, after[1] + 7, 0.06)
    assert tachometer.steps == 107


@pytest.mark.parametrize("start_abs", [100_000, 300])
def test_an_absolute_counter_that_runs_backwards_is_no_reboot_at_every_poll(start_abs):
    tachometer = Tachometer()
    for poll in range(101):
        tachometer.update(20 * poll, start_abs - 20 * poll, 0.02 * poll)
    assert tachometer.restarts <= 1
    assert tachometer.steps >= 20 * 99
    assert tachometer.contradictions >= 99


def test_a_jump_too_large_to_be_driven_is_a_restart():
    tachometer = Tachometer()
    tachometer.update(0, 0, 0.0)
    tachometer.update(1001, 1001, 0.02)
    assert (tachometer.steps, tachometer.restarts) == (0, 1)


@pytest.fixture
def health() -> Health:
    return Health()


def state_of(condition: VescMonitor) -> MotorState:
    assert condition.state is not None
    return condition.state


@pytest.fixture
def condition(health: Health) -> VescMonitor:
    return VescMonitor(Calibration(VescSettings()), 8.0, health)


def test_a_report_in_si_units(condition):
    condition.update(WELL, 1.0, 0.1)
    condition.update(replace(WELL, tachometer=-1000, tachometer_abs=1000, erpm=-4614, status=3), 1.02, 0.2)
    state = state_of(condition)
    assert (state.stamp_s, state.speed_mps, state.steering_rad, state.voltage_v) == (1.02, -1.0, 0.2, 11.8)
    assert state.distance_m == pytest.approx(-2.1673, rel=1e-4)
    assert (state.timed_out, state.killed, state.fault, state.temperature_c) == (True, True, "", 31.5)


def test_a_fault_is_latched_when_the_code_is_gone_and_counted_once(condition, health):
    for code in (0, 2, 2, 2, 0, 0):
        condition.update(replace(WELL, fault_code=code), 1.0, 0.0)
    assert state_of(condition).fault == "under voltage: charge or change the battery"
    assert condition.trouble == condition.fault
    assert health.counts == {"fault": 1}
    condition.disconnect()
    assert condition.state is None
    condition.update(WELL, 2.0, 0.0)
    assert state_of(condition).fault
    condition.clear_fault()
    assert (state_of(condition).fault, condition.trouble) == ("", "")


def test_a_contradiction_is_told_from_a_fault_of_the_vesc_s_own_until_it_is_cleared(condition):
    condition.update(replace(WELL, fault_code=5), 1.0, 0.0)
    assert not condition.contradicts
    condition.clear_fault()
    condition.latch("runs backwards")
    assert condition.contradicts
    condition.clear_fault()
    assert not condition.contradicts


def test_the_newest_fault_is_the_one_that_is_told(condition):
    for code in (2, 0, 4):
        condition.update(replace(WELL, fault_code=code), 1.0, 0.0)
    assert "over-current" in condition.fault


def test_only_a_lasting_low_voltage_is_an_empty_battery(condition):
    low, edge = replace(WELL, voltage_v=0.4), replace(WELL, voltage_v=8.1)
    condition.update(low, 1.0, 0.0)
    condition.update(low, 1.9, 0.0)
    condition.update(WELL, 1.95, 0.0)
    condition.update(low, 2.0, 0.0)
    condition.update(low, 2.9, 0.0)
    assert condition.trouble == ""
    condition.update(low, 3.1, 0.0)
    told = condition.trouble
    assert told == "no battery: 0.4 V (plug it in, release its switch)"
    condition.update(replace(WELL, voltage_v=0.9), 3.2, 0.0)
    condition.update(edge, 3.3, 0.0)
    assert condition.trouble == told  # constant words: a change of words is an event
    condition.update(WELL, 3.4, 0.0)
    assert condition.trouble == ""


def test_an_empty_battery_is_named_with_its_voltage(condition):
    for stamp_s in (1.0, 2.0):
        condition.update(replace(WELL, voltage_v=7.9), stamp_s, 0.0)
    assert condition.trouble == "battery empty: 7.9 V, less than 8 V (charge or change it)"


def test_a_battery_is_judged_anew_after_a_lost_link(condition):
    low = replace(WELL, voltage_v=0.4)
    condition.update(low, 1.0, 0.0)
    condition.disconnect()
    condition.update(low, 50.0, 0.0)
    assert condition.trouble == ""
