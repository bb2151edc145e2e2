"""The state of the car: every state times every observation, and what a person reads of it."""

import math

import pytest

from tests.runtime.observed import HandClock
from wallride.drivers.api import Drive, LinkState
from wallride.runtime.arbitration.command import LAB_ORDER, Decision, Output, Source
from wallride.runtime.arbitration.command_queue import CommandQueue
from wallride.runtime.arbitration.driving_state import (
    BATTERY_CLEARED_BY,
    CLEARED_BY,
    DRIVES_ON,
    OWN_LAW_CLEARED_BY,
    PERMIT_AGAIN,
    PLANNER_CLEARED_BY,
    STATE_OF,
    TOO_SLOW,
    Circumstances,
    DrivingState,
    DrivingStateMonitor,
    Observation,
    observe,
)
from wallride.runtime.arbitration.emergency_stop import Cause, EmergencyStop
from wallride.runtime.arbitration.permit import Permit
from wallride.sim.virtual.devices import MemoryLidar, MemoryMotor

S, E = DrivingState, Observation
DEFAULT = Output(0.0, Drive(0.0, 0.0), Decision(0.0, None, None, None, "no word"), delivered=True)
SLOW = Circumstances("", "", "", permitted=True, refusal="", slowest_mps=0.2)
CALM = Circumstances("", "", "", permitted=True, refusal="")


def output_of(sent_mps, *, driver=Source.NAVIGATION, winner=None, speed_mps=None, reason="wall"):
    speed_mps = sent_mps if speed_mps is None else speed_mps
    decision = Decision(speed_mps, 0.0, driver, winner or driver, reason, 0.4)
    return Output(0.0, Drive(sent_mps, 0.0), decision, delivered=True)


def test_each_observation_names_a_state_of_its_own_and_none_is_starting():
    assert set(STATE_OF) == set(E)
    assert sorted(STATE_OF.values()) == sorted(set(S) - {S.STARTING})


def test_each_state_but_driving_says_what_clears_it():
    assert set(CLEARED_BY) == set(S)
    assert [state for state, words in CLEARED_BY.items() if not words] == [S.DRIVING]


@pytest.mark.parametrize(
    ("output", "around", "seen", "reason"),
    [
        (output_of(1.0), CALM, E.FREE, "wall"),
        (output_of(-0.5), CALM, E.FREE, "wall"),
        (output_of(0.4, winner=Source.SAFETY, reason="ahead"), CALM, E.SLOWED, "ahead"),
        (output_of(0.0, winner=Source.SAFETY, reason="ahead"), CALM, E.BLOCKED, "ahead"),
        (output_of(0.0, reason="boxed in"), CALM, E.BLOCKED, "boxed in"),
        (output_of(0.0, driver=Source.TELEOP, reason="ann drives"), CALM, E.IDLE, "ann drives"),
        (output_of(0.0, driver=Source.TELEOP, winner=Source.SAFETY, reason="ahead"), CALM, E.BLOCKED, "ahead"),
        (output_of(0.0, speed_mps=-0.5), CALM, E.IDLE, "wall"),
        (DEFAULT, CALM, E.BLOCKED, "no word"),
        (output_of(0.0), Circumstances("", "", "", permitted=False, refusal="ask"), E.NOT_PERMITTED, "ask"),
        (output_of(1.0, driver=Source.TELEOP), Circumstances("", "", "", permitted=False, refusal="x"), E.FREE, "wall"),
        (output_of(0.0), Circumstances("gone", "", "", permitted=True, refusal=""), E.DEVICE_MISSING, "gone"),
        (output_of(1.0), Circumstances("gone", "", "", permitted=False, refusal="ask"), E.FREE, "wall"),
        (output_of(1.0), Circumstances("gone", "", "red", permitted=True, refusal=""), E.ESTOP, "red"),
        (output_of(0.0), Circumstances("", "", "", permitted=False, refusal="ask", battery="low"), E.BLOCKED, "low"),
        (output_of(0.0, driver=Source.TELEOP), Circumstances("", "", "", True, "", "low"), E.BLOCKED, "low"),
        (output_of(0.3), Circumstances("", "", "", True, "", "low"), E.FREE, "wall"),
        (output_of(0.0), Circumstances("gone", "", "", True, "", "low"), E.DEVICE_MISSING, "gone"),
        (output_of(1.0), Circumstances("gone", "DRV", "red", permitted=True, refusal=""), E.FAULT, "DRV"),
        (output_of(0.15), SLOW, E.BLOCKED, TOO_SLOW.format(0.2)),
        (output_of(-0.15, driver=Source.TELEOP), SLOW, E.BLOCKED, TOO_SLOW.format(0.2)),
        (output_of(0.1, speed_mps=0.2), SLOW, E.FREE, "wall"),
    ],
)  # fmt: skip
def test_a_decision_and_its_circumstances_are_one_observation(output, around, seen, reason):
    assert observe(output, around) == (seen, reason)


class Watched:
    """A monitor and all that it reads."""

    def __init__(self):
        self.clock = HandClock()
        self.lidar, self.motor = MemoryLidar(lambda _: None, self.clock), MemoryMotor(self.clock)
        queue = CommandQueue(LAB_ORDER, self.clock)
        self.e_stop, self.permit = EmergencyStop(queue), Permit(queue, "required")
        self.battery = self.own_law = ""
        self.monitor = DrivingStateMonitor(
            self.lidar, self.motor, self.e_stop, self.permit, self.clock, lambda: self.battery
        )
        self.monitor.own_law = lambda: self.own_law

    def driving(self):
        """Return it with a permit, driving."""
        self.permit.grant(until_s=math.inf)
        assert self.after(output_of(1.0)) is S.DRIVING
        return self

    def after(self, output):
        self.clock.now_s += 0.02
        self.monitor.update(output)
        return self.monitor.state


def test_the_monitor_follows_a_drive_from_the_start_to_a_fault_and_back():
    car, stands, drives = Watched(), output_of(0.0, reason="boxed in"), output_of(1.0)
    assert car.monitor.state is S.STARTING
    car.motor.present = False
    assert car.after(stands) is S.WAITING
    assert "motor absent" in car.monitor.reason
    car.motor.present = True
    assert car.after(stands) is S.DISARMED
    car.permit.grant(until_s=math.inf)
    assert car.after(drives) is S.DRIVING
    assert car.after(stands) is S.STOPPED
    assert car.monitor.fields()["measure"] == 0.4
    car.lidar.health.link = LinkState.STARTING
    assert car.after(stands) is S.WAITING
    car.lidar.health.link = LinkState.READY
    car.e_stop.latch(Cause.OPERATOR, "e-stop by ann")
    assert car.after(stands) is S.ESTOPPED
    car.e_stop.latch(Cause.MOTOR, "motor fault: DRV")
    assert car.after(stands) is S.FAULT
    assert car.monitor.fields() | {"for_s": 0.0, "measure": None} == {
        "state": "fault (latched)", "reason": "motor fault: DRV", "measure": None, "for_s": 0.0,
        "clears": CLEARED_BY[S.FAULT],
    }  # fmt: skip
    car.e_stop.clear(Cause.MOTOR)
    assert car.after(stands) is S.ESTOPPED
    car.e_stop.clear(Cause.OPERATOR)
    car.permit.refuse("the e-stop was reset")
    assert car.after(stands) is S.DISARMED
    assert car.monitor.reason == "the e-stop was reset"


@pytest.mark.parametrize("before", S)
@pytest.mark.parametrize(
    ("output", "after"),
    [
        (output_of(1.0), S.DRIVING), (output_of(0.4, winner=Source.SAFETY), S.LIMITED), (output_of(0.0), S.STOPPED),
        (output_of(0.0, speed_mps=-0.5), S.ARMED),
    ],
)  # fmt: skip
def test_the_state_is_that_of_the_decision_whatever_it_was_before(before, output, after):
    car = Watched()
    car.permit.grant(until_s=math.inf)
    car.monitor.state = before
    assert car.after(output) is after


def test_an_empty_battery_that_took_the_permit_is_a_stop_with_its_own_remedy_and_ends_disarmed():
    car = Watched().driving()
    car.battery = "battery empty: 9.4 V"
    car.permit.revoke("battery empty: 9.4 V; permit again")
    assert car.after(output_of(0.0, winner=Source.BATTERY)) is S.STOPPED
    assert (car.monitor.reason, car.monitor.fields()["clears"]) == ("battery empty: 9.4 V", BATTERY_CLEARED_BY)
    car.battery = ""
    assert car.after(output_of(0.0)) is S.DISARMED
    assert car.monitor.fields()["clears"] == CLEARED_BY[S.DISARMED]
    car.permit.grant(until_s=math.inf)
    assert car.after(output_of(0.0, reason="boxed in")) is S.STOPPED
    assert car.monitor.fields()["clears"] == CLEARED_BY[S.STOPPED]


def test_a_planner_that_holds_the_car_is_named_as_what_clears_the_stop():
    car = Watched().driving()
    assert car.after(output_of(0.0, winner=Source.PLANNER_HOLD, reason="planner slam was lost")) is S.STOPPED
    assert car.monitor.fields()["clears"] == PLANNER_CLEARED_BY
    assert car.after(output_of(0.0, reason="boxed in")) is S.STOPPED
    assert car.monitor.fields()["clears"] == CLEARED_BY[S.STOPPED]


def test_a_law_of_the_user_that_failed_is_to_be_mended():
    car = Watched().driving()
    car.own_law = "mine:Law raised ValueError: lost (mine.py:7)"
    assert car.after(output_of(0.0, reason=car.own_law)) is S.STOPPED
    assert car.monitor.fields()["clears"] == OWN_LAW_CLEARED_BY
    car.permit.revoke(f"{car.own_law}; permit again")
    assert car.after(output_of(0.0)) is S.DISARMED
    assert car.monitor.fields()["clears"] == OWN_LAW_CLEARED_BY
    car.own_law = ""
    assert car.monitor.fields()["clears"] == CLEARED_BY[S.DISARMED]


@pytest.mark.parametrize("state", [S.WAITING, S.ESTOPPED, S.FAULT])
def test_where_no_permit_is_required_none_is_asked_for(state):
    car = Watched()
    car.monitor.state = state
    assert car.monitor.fields()["clears"] == CLEARED_BY[state]
    car.permit.always = True
    words = str(car.monitor.fields()["clears"])
    assert words == CLEARED_BY[state].replace(PERMIT_AGAIN, DRIVES_ON) != CLEARED_BY[state]


def test_no_state_is_cleared_by_words_about_words():
    assert not any("end of the reason" in words for words in CLEARED_BY.values())


def test_before_the_first_decision_it_is_starting_and_says_for_how_long():
    car = Watched()
    car.clock.now_s += 0.5
    fields = car.monitor.fields()
    assert math.isnan(float(fields.pop("measure")))
    assert fields == {
        "state": "starting", "reason": "no decision yet", "clears": CLEARED_BY[S.STARTING], "for_s": 0.5
    }  # fmt: skip


def test_a_permit_ends_at_its_end():
    car = Watched()
    car.permit.grant(until_s=car.clock.now_s + 0.02)
    assert car.after(output_of(0.0)) is S.DISARMED


def test_the_state_is_as_old_as_its_beginning():
    car = Watched().driving()
    for _ in range(4):
        car.after(output_of(1.0))
    assert car.monitor.fields()["for_s"] == pytest.approx(0.08)
