"""With a permit required: what is lost disarms, what comes back arms nothing, and the state says so."""

from functools import partial
from typing import Any

import pytest

from wallride.runtime.arbitration.driving_state import DrivingState
from wallride.sim.lab.stories import Story, tell
from wallride.sim.scenario.virtual_drive import Stage

PULLED_S, BACK_S, ENDS_S = 3.0, 5.0, 7.0
MOVING = {DrivingState.DRIVING, DrivingState.LIMITED}


def permit(play):
    play.car.permit.grant(until_s=1000.0)


def fault(play):
    play.motor.latch_fault("gate driver fault")


def clear(play):
    play.motor.clear_fault()


def exchange(play):
    play.sensor.health.identity = "another lidar"


FAULTS: dict[str, tuple[Any, Any, DrivingState]] = {
    "lidar": (partial(Stage.plug_lidar, plugged=False), partial(Stage.plug_lidar, plugged=True), DrivingState.WAITING),
    "motor": (partial(Stage.plug_motor, plugged=False), partial(Stage.plug_motor, plugged=True), DrivingState.WAITING),
    "fault": (fault, clear, DrivingState.FAULT),
    "another lidar": (exchange, lambda _: None, DrivingState.DISARMED),
}


@pytest.mark.parametrize("name", list(FAULTS))
def test_what_is_lost_disarms_and_what_comes_back_arms_nothing(name):
    begin, end, state = FAULTS[name]
    seen = []

    def watch(play):
        publish = play.car.telemetry.on_output

        def on_output(output):
            monitor = play.car.driving_state
            seen.append((play.clock(), output.drive.speed_mps * output.delivered, monitor.state))
            publish(output)

        play.car.telemetry.on_output = on_output

    events = ((0.0, watch), (0.5, permit), (PULLED_S, begin), (BACK_S, end))
    tell(Story("loop", ENDS_S, lambda _: [], speed_mps=1.0, permit="required", events=events))
    assert any(speed_mps > 0.5 for at_s, speed_mps, _ in seen if at_s < PULLED_S)
    assert {at_s for at_s, speed_mps, _ in seen if speed_mps and at_s > PULLED_S + 0.25} == set(), "motion in a fault"
    assert {now for at_s, _, now in seen if PULLED_S + 0.25 < at_s < BACK_S} == {state}
    assert {now for at_s, _, now in seen if at_s > BACK_S + 0.1} == {DrivingState.DISARMED}
    assert {speed_mps != 0 for _, speed_mps, now in seen if now in MOVING} == {True}
    assert {speed_mps for _, speed_mps, now in seen if now not in MOVING} == {0.0}
