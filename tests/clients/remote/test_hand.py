"""The deadman of a script, at the car's real desk, in virtual time."""

import math

import pytest

from tests.runtime.operator_rig import BEAT_S, Rig
from wallride.clients.remote.hand import HOLD_S, ScriptedHand
from wallride.clients.teleop.pilot import Pilot
from wallride.runtime.arbitration.command import Source
from wallride.runtime.wire.teleop import Press

SESSION = 77


class Script:
    """A script at a car: its hand and pilot, 50 steps a second, as `RemoteDriver` runs them."""

    def __init__(self, rig, **limits):
        self.rig = rig
        self.hand = ScriptedHand(limits.get("max_speed_mps", 2.0), 0.3)
        self.pilot = Pilot(SESSION, "script", self.hand.shape)

    def step(self, wish=None):
        rig = self.rig
        rig.now_s += BEAT_S
        self.pilot.hear(rig.beat(), rig.now_s)
        if wish is not None:
            self.hand.send(wish[0], wish[1], rig.now_s)
        rig.desk.receive("", self.pilot.step(self.hand.inputs(rig.now_s), rig.now_s).pack(), rig.now_s)
        assert self.pilot.situation is not None
        self.hand.note(self.pilot.situation)

    def run(self, seconds, wish=None):
        for _ in range(round(seconds / BEAT_S)):
            self.step(wish)
        return self.decision()

    def decision(self):
        return self.rig.decision


@pytest.fixture(params=["required", "always"])
def script(request):
    script = Script(Rig(permit=request.param))
    script.run(0.1)
    return script


def test_what_is_sent_is_driven(script):
    decision = script.run(0.2, (1.0, 0.1))
    assert (decision.driver, decision.speed_mps, decision.steering_rad) == (
        Source.TELEOP, pytest.approx(1.0), pytest.approx(0.1),
    )  # fmt: skip
    assert script.hand.trouble == ""


def test_a_send_while_a_command_is_on_its_way_is_driven_with_the_next_one(script):
    rig = script.rig
    command = script.pilot.step(script.hand.inputs(rig.now_s), rig.now_s)
    script.hand.send(1.0, 0.1, rig.now_s)  # by the script's thread, while the loop's is in its step
    script.hand.note(script.pilot.situation)
    rig.desk.receive("", command.pack(), rig.now_s)
    assert script.hand.trouble == ""
    assert script.run(0.1, (1.0, 0.1)).speed_mps == pytest.approx(1.0)


def test_a_send_after_the_scripts_own_e_stop_is_refused(script):
    script.hand.press_e_stop()
    script.run(0.1, (1.0, 0.1))
    assert script.hand.trouble == "e-stop"
    assert script.rig.e_stop.latched


def test_a_script_that_stalls_stops_the_car_and_does_not_go_on_by_itself(script):
    script.run(0.2, (1.0, 0.1))
    decision = script.run(HOLD_S + 3 * BEAT_S)
    assert decision.speed_mps == 0.0
    assert "nothing was sent for 0.2 s" in script.hand.trouble
    assert script.run(1.0, (1.0, 0.1)).speed_mps == 0.0, "sending again is no release"
    assert script.pilot.situation.flags is Press.UNSURE


def test_within_the_hold_nothing_stops(script):
    script.run(0.2, (1.0, 0.1))
    assert script.run(HOLD_S - 2 * BEAT_S).speed_mps == pytest.approx(1.0)


def test_letting_go_stops_and_the_next_send_drives_again():
    script = Script(Rig(permit="required"))
    script.run(0.1)
    script.run(0.2, (1.0, 0.1))
    script.hand.release()
    assert script.run(0.1).speed_mps == 0.0
    assert script.run(0.2, (1.0, 0.1)).speed_mps == pytest.approx(1.0)
    assert script.hand.trouble == ""


def test_an_e_stop_of_another_client_takes_the_deadman_for_good(script):
    script.run(0.2, (1.0, 0.1))
    script.rig.desk._press_e_stop("bob")
    assert script.run(0.2, (1.0, 0.1)).speed_mps == 0.0
    assert script.hand.trouble != ""


def test_a_lost_link_takes_the_deadman(script):
    script.run(0.2, (1.0, 0.1))
    rig = script.rig
    for _ in range(20):  # the script goes on, and hears nothing
        rig.now_s += BEAT_S
        script.hand.send(1.0, 0.1, rig.now_s)
        script.pilot.step(script.hand.inputs(rig.now_s), rig.now_s)
        script.hand.note(script.pilot.situation)
    assert "link" in script.hand.trouble


def test_another_operator_keeps_the_car(script):
    other = script.rig.client("ann", 5)
    script.rig.beat()
    other.click()
    for _ in range(10):
        script.step((1.0, 0.1))
        other.send(Press.MANUAL)
    assert "another operator" in script.hand.trouble
    assert script.decision().speed_mps == pytest.approx(2.0), "ann's"


@pytest.mark.parametrize("wish", [(math.nan, 0.0), (0.0, math.inf), (-math.inf, 0.0)])
def test_no_number_is_an_error_and_not_sent(wish):
    hand = ScriptedHand(1.0, 0.3)
    with pytest.raises(ValueError, match="must be numbers"):
        hand.send(wish[0], wish[1], 1.0)
    assert not hand.inputs(1.0).pressed


@pytest.mark.parametrize(("wish", "driven"), [((9.0, 0.0), 2.0), ((-9.0, 0.0), -2.0)])
def test_more_than_the_limit_is_the_limit(script, wish, driven):
    assert script.run(0.3, wish).speed_mps == pytest.approx(driven)


@pytest.mark.parametrize("limits", [(0.0, 0.3), (1.0, -0.1), (math.nan, 0.3)])
def test_limits_are_positive(limits):
    with pytest.raises(ValueError, match="must be positive"):
        ScriptedHand(*limits)
