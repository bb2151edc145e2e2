"""The operator's desk: the effect of every press in every state."""

import itertools

import pytest

from tests.runtime.operator_rig import Rig
from tests.runtime.teleop.presses import AUTONOMY, BOTH, ESTOP, GOODBYE, MANUAL, NOTHING, RESET, TAKE_OVER
from wallride.runtime.arbitration.command import Source


def _nobody(rig, ann, bob):
    ann.send(NOTHING)


def _released(rig, ann, bob):
    ann.click(AUTONOMY)
    ann.send(NOTHING)


def _manual(rig, ann, bob):
    ann.click(MANUAL)


def _autonomy(rig, ann, bob):
    ann.click(AUTONOMY)


def _unarmed(rig, ann, bob):
    ann.click(MANUAL)
    rig.desk.rearm("the lidar was lost; permit again")


def _lost(rig, ann, bob):
    ann.click(MANUAL)
    rig.wait(0.3)


def _stopped(rig, ann, bob):
    ann.click(ESTOP)
    ann.send(NOTHING)


def _bob(rig, ann, bob):
    ann.send(NOTHING)
    bob.click(AUTONOMY)
    bob.send(NOTHING)


STATES = {
    "nobody": _nobody, "released": _released, "manual": _manual, "autonomy": _autonomy,
    "unarmed": _unarmed, "lost": _lost, "e-stop": _stopped, "another": _bob,
}  # fmt: skip


HAND, AUTO, STOP, GO_ON = "by hand", "autonomy", "stop", "as the mode allows"


TABLE = {
    # what Ann sends:  nothing MANUAL  AUTONOMY  RESET   TAKE_OVER  GOODBYE
    "nobody":         (GO_ON,  HAND,   AUTO,     GO_ON,  STOP,      GO_ON),
    "released":       (GO_ON,  HAND,   AUTO,     GO_ON,  STOP,      GO_ON),
    "manual":         (GO_ON,  HAND,   AUTO,     STOP,   STOP,      GO_ON),
    "autonomy":       (GO_ON,  HAND,   AUTO,     STOP,   STOP,      GO_ON),
    "unarmed":        (STOP,   STOP,   STOP,     STOP,   STOP,      GO_ON),
    "lost":           (STOP,   STOP,   STOP,     STOP,   STOP,      GO_ON),
    "e-stop":         (STOP,   STOP,   STOP,     STOP,   STOP,      STOP),
    "another":        (GO_ON,  GO_ON,  GO_ON,    GO_ON,  STOP,      GO_ON),
}  # fmt: skip


PRESSES = (NOTHING, MANUAL, AUTONOMY, RESET, TAKE_OVER, GOODBYE)


@pytest.mark.parametrize(("mode", "state", "press"), list(itertools.product(BOTH, STATES, PRESSES)))
def test_the_table(mode, state, press):
    rig = Rig(mode)
    ann, bob = rig.client("Ann"), rig.client("Bob")
    STATES[state](rig, ann, bob)
    ann.send(press)
    expected = TABLE[state][PRESSES.index(press)]
    if expected == GO_ON:
        expected = AUTO if mode == "always" else STOP
    decision = rig.decision
    moves = {Source.TELEOP: HAND, Source.NAVIGATION: AUTO, None: STOP}
    assert (moves[decision.driver] if decision.speed_mps else STOP) == expected
