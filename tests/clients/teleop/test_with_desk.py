"""The real pilot and the car's real desk, in virtual time: what the mux would send while hands and links misbehave."""

from dataclasses import replace

import pytest

from tests.clients.teleop.scenes import DEAD, LINEAR, SESSION, hands
from tests.runtime.operator_rig import BEAT_S, Rig
from wallride.clients.teleop.inputs import Control
from wallride.clients.teleop.pilot import DeadmanFault, Pilot
from wallride.runtime.arbitration.command import Source
from wallride.runtime.wire.teleop import Press

MANUAL = Control("manual")
STRANGER = 5
DRIVING = hands(MANUAL, speed=1.0)


class Road:
    """A desk and a pilot with a link between them."""

    def __init__(self, permit):
        self.rig = Rig(permit)
        self.pilot = Pilot(SESSION, "ann", LINEAR)
        self.rig.clients.append(self)
        self.up = self.down = True
        self.frozen_s = None
        self.hear(self.rig.heard)

    def hear(self, beat):
        if self.down:
            self.pilot.hear(beat, self.rig.now_s)

    def hold(self, inputs, seconds=0.2):
        """Let the hands stay so; return the fastest that the car was told to go."""
        fastest_mps = 0.0
        for _ in range(round(seconds / BEAT_S)):
            self.rig.wait(BEAT_S)
            event_s = self.rig.now_s if self.frozen_s is None else self.frozen_s
            payload = self.pilot.step(replace(inputs, event_s=event_s), self.rig.now_s).pack()
            if self.up:
                self.rig.desk.receive("", payload, self.rig.now_s)
            fastest_mps = max(fastest_mps, abs(self.rig.speed_mps))
        return fastest_mps

    def drive(self):
        self.hold(hands())
        self.hold(hands(MANUAL))
        self.hold(DRIVING)
        assert self.rig.speed_mps == 2.0
        assert self.rig.decision.driver is Source.TELEOP


@pytest.fixture(params=["required", "always"])
def road(request):
    return Road(request.param)


def test_drive_release_drive(road):
    road.drive()
    road.hold(hands(speed=1.0), BEAT_S)
    assert road.rig.decision.driver is not Source.TELEOP
    road.drive()
    assert road.pilot.situation.mine
    assert 0 <= road.pilot.situation.round_trip_s <= BEAT_S


TROUBLES = {
    "the pad is unplugged": DEAD,
    "an axis is not to be trusted": hands(MANUAL, speed=1.0, steering=float("nan")),
}


@pytest.mark.parametrize("inputs", TROUBLES.values(), ids=TROUBLES)
def test_trouble_with_the_pad_stops_at_once_and_autonomy_does_not_take_over(road, inputs):
    road.drive()
    road.hold(inputs, BEAT_S)
    assert road.rig.speed_mps == 0
    assert road.hold(inputs, 3.0) == 0
    assert road.hold(DRIVING, 3.0) == 0, "what is still held when it returns"
    road.drive()


def test_a_frozen_pad_stops_the_car_within_a_second_and_autonomy_does_not_take_over(road):
    road.drive()
    road.frozen_s = road.rig.now_s
    road.hold(DRIVING, 1.0 + 2 * BEAT_S)
    assert road.hold(DRIVING, 3.0) == 0
    road.frozen_s = None
    assert road.hold(DRIVING, 1.0) == 0
    road.drive()


@pytest.mark.parametrize(("up", "down"), [(False, True), (True, False), (False, False)], ids=["up", "down", "both"])
def test_a_dead_link_stops_the_car_and_its_return_moves_nothing(road, up, down):
    road.drive()
    road.up, road.down = up, down
    road.hold(DRIVING, 0.2 + BEAT_S)
    assert road.hold(DRIVING, 1.0) == 0
    road.up = road.down = True
    assert road.hold(DRIVING, 2.0) == 0
    assert road.pilot.situation.block is DeadmanFault.REARM
    road.drive()


def test_a_paused_client_stops_the_car_and_its_return_moves_nothing(road):
    road.drive()
    road.rig.wait(3.0)
    assert road.rig.speed_mps == 0
    assert road.hold(DRIVING, 2.0) == 0
    road.drive()


def test_a_lost_device_of_the_car_wants_a_release(road):
    road.drive()
    road.rig.desk.rearm("the lidar was lost")
    assert road.hold(DRIVING, 1.0) == 0
    road.drive()


def test_a_second_client_with_a_stuck_button_does_not_keep_us_from_driving(road):
    bob = road.rig.client("bob", STRANGER)
    for inputs in (hands(), hands(MANUAL), DRIVING):
        for _ in range(20):
            bob.send(Press.MANUAL)
            road.hold(inputs, BEAT_S)
    assert road.rig.speed_mps == 2.0
