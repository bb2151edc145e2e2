"""The operator's desk when the operator falls silent, leaves, or its pad freezes."""

import math

import pytest

from tests.runtime.operator_rig import AUTO_MPS, BEAT_S, HAND_MPS, Rig
from tests.runtime.teleop.presses import AUTONOMY, GOODBYE, MANUAL, NOTHING, RESET
from wallride.runtime.arbitration.command import Source
from wallride.runtime.wire.teleop import UNKNOWN_AGE_MS, CarCondition, Input, Press


@pytest.mark.parametrize("held", [MANUAL, AUTONOMY, NOTHING])
def test_an_operator_who_falls_silent_stops_the_car_in_either_mode(rig, ann, held):
    ann.click()
    ann.hold(held)
    last_s = rig.now_s
    while rig.speed_mps > 0:
        rig.wait(BEAT_S)
    assert rig.now_s - last_s < 0.2 + BEAT_S + 1e-9
    rig.wait(0.2 + BEAT_S)
    assert rig.standing == "operator lost"
    assert rig.heard.flags & CarCondition.OPERATOR_LOST
    assert rig.heard.flags & CarCondition.REARM
    assert not rig.heard.flags & CarCondition.OPERATOR_PRESENT
    assert rig.speed_mps == 0
    rig.wait(60)
    assert rig.speed_mps == 0, "not even after the place is free"
    assert rig.standing == "operator lost"


def test_between_two_ticks_silence_is_a_stop_too(rig, ann):
    for held in (MANUAL, AUTONOMY, NOTHING):
        ann.click()
        ann.send(held)
        rig.stall(0.2)
        assert rig.speed_mps == 0
        rig.beat()


@pytest.mark.parametrize("held", [MANUAL, AUTONOMY])
@pytest.mark.parametrize("away_s", [0.3, 2.0, 10.0])
def test_after_the_link_is_back_nothing_moves_until_the_operator_acts(rig, ann, held, away_s):
    ann.click(held)
    ann.deaf = True
    rig.wait(away_s)
    ann.deaf = False
    ann.hold(held, 1.0)
    assert rig.speed_mps == 0, "held through the gap"
    ann.hold(NOTHING, 1.0)
    assert rig.speed_mps == 0, "hands off is no act"
    ann.hold(held)
    assert rig.speed_mps > 0


def test_after_the_gap_one_press_and_release_lets_autonomy_go_on():
    rig = Rig("always")
    ann = rig.client()
    ann.click()
    rig.wait(1.0)
    ann.hold(NOTHING)
    assert rig.standing == "waiting for a press"
    ann.click(AUTONOMY)
    ann.hold(NOTHING)
    assert rig.speed_mps == AUTO_MPS


def test_a_gap_is_noticed_by_the_command_after_it_when_no_tick_did(rig, ann):
    ann.click()
    rig.stall(0.3)
    ann.hear(rig.desk.beat(math.nan))  # a beat without a tick
    ann.send(MANUAL)
    assert rig.speed_mps == 0
    assert rig.standing == "release everything"
    ann.send(NOTHING)
    assert rig.speed_mps == 0, "it was lost, and hands off is no act"


def test_a_goodbye_is_no_loss(rig, ann):
    ann.click()
    ann.hold(GOODBYE)
    assert rig.refused == {}
    rig.wait(5.0)
    assert rig.standing == "nobody"
    assert rig.speed_mps == (AUTO_MPS if rig.permit.always else 0)


def test_an_operator_who_leaves_unsure_stops_the_car_at_once_and_gives_the_place_back(rig, ann):
    ann.click()
    ann.send(MANUAL)
    assert rig.speed_mps == HAND_MPS
    ann.send(GOODBYE | Press.UNSURE)
    assert rig.speed_mps == 0
    assert rig.beat().operator_session == 0
    rig.wait(5.0)
    assert rig.speed_mps == 0, "leaving is no release: autonomy waits for an operator"
    bob = rig.client("Bob")
    bob.click()
    assert rig.speed_mps == HAND_MPS


def test_a_script_that_fails_before_its_first_press_stops_the_car_where_no_permit_is_needed():
    rig = Rig("always")
    ann = rig.client()
    ann.send(NOTHING)
    assert rig.speed_mps == AUTO_MPS
    ann.send(GOODBYE | Press.UNSURE)
    assert rig.speed_mps == 0
    rig.wait(5.0)
    assert rig.speed_mps == 0, "leaving is no release: autonomy waits for an operator"
    rig.client("Bob").click()
    assert rig.speed_mps == HAND_MPS


def test_a_script_that_fails_beside_an_operator_changes_nothing():
    rig = Rig("always")
    ann, bob = rig.client(), rig.client("Bob")
    ann.click()
    bob.send(NOTHING)
    ann.send(MANUAL)
    bob.send(GOODBYE | Press.UNSURE)
    assert rig.speed_mps == HAND_MPS


def test_a_lost_operator_may_come_back_to_say_goodbye():
    rig = Rig("always")
    ann = rig.client()
    ann.click()
    rig.wait(10.0)
    ann.send(GOODBYE)
    assert rig.speed_mps == AUTO_MPS
    assert rig.standing == "nobody"


def test_a_bystanders_goodbye_or_silence_means_nothing():
    rig = Rig("always")
    ann, bob, eve = rig.client(), rig.client("Bob"), rig.client("Eve")
    ann.click()
    bob.send(NOTHING)
    eve.send(NOTHING)
    rig.wait(10.0)
    bob.send(GOODBYE)
    eve.hold(NOTHING)
    assert rig.speed_mps == 0
    assert rig.standing == "operator lost"


def test_an_operator_that_said_goodbye_is_gone_even_for_copies_of_its_last_commands(rig, ann):
    ann.send(NOTHING)
    ann.send(MANUAL)
    later = [ann.make(NOTHING), ann.make(MANUAL)]
    ann.send(GOODBYE)
    for payload in later:
        rig.desk.receive("", payload, rig.now_s)
    assert rig.decision.driver is not Source.TELEOP
    assert rig.refused["session is over"] == 2


@pytest.mark.parametrize("permit", ["always", "required"])
def test_a_pad_that_is_gone_is_no_release(permit):
    rig = Rig(permit)
    ann = rig.client()
    ann.click()
    ann.hold(Press.UNSURE)
    assert rig.speed_mps == 0
    assert rig.refused["no input from the operator"] > 0
    assert rig.decision.reason == "no input from the operator: release everything, then press again"


@pytest.mark.parametrize(
    ("changes", "obeyed"),
    [
        ({"input": Input.PAD, "input_age_ms": 1000}, True),
        ({"input": Input.PAD, "input_age_ms": 1001}, False),
        ({"input": Input.PAD, "input_age_ms": UNKNOWN_AGE_MS}, False),
        ({"input": Input.PAD, "input_age_ms": 1001, "speed_mps": -0.5}, False),
        ({"input": Input.PAD, "input_age_ms": 1001, "speed_mps": 0.0}, True),
        ({"input": Input.KEYBOARD, "input_age_ms": UNKNOWN_AGE_MS}, True),
    ],
)
def test_a_pad_that_drives_without_an_event_is_frozen(rig, ann, changes, obeyed):
    ann.click()
    ann.send(MANUAL, **changes)
    assert (rig.decision.driver is Source.TELEOP) == obeyed
    if not obeyed:
        assert rig.decision.reason.startswith("the pad is frozen: no event from it")
        ann.hold(MANUAL)
        assert rig.speed_mps == 0, "it wants a release"
        ann.hold(NOTHING)
        assert rig.speed_mps == 0, "a pad that wakes up released is no act"
        ann.hold(MANUAL)
        assert rig.speed_mps == HAND_MPS


@pytest.mark.parametrize("flags", [MANUAL | RESET, AUTONOMY | RESET, Press.UNSURE, Press.UNSURE | MANUAL])
def test_two_things_at_once_and_unknown_hands_stop_the_car(rig, ann, flags):
    ann.click()
    ann.send(flags)
    assert rig.speed_mps == 0
    ann.hold(MANUAL)
    assert rig.speed_mps == 0
