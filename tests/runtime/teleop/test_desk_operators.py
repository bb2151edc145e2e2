"""The operator's desk with two operators, an e-stop and a reset."""

import pytest

from tests.runtime.operator_rig import BEAT_S, HAND_MPS, Rig
from tests.runtime.teleop.presses import AUTONOMY, ESTOP, GOODBYE, MANUAL, NOTHING, RESET, TAKE_OVER
from wallride.runtime.arbitration.command import Source
from wallride.runtime.arbitration.emergency_stop import Cause
from wallride.runtime.wire.teleop import CarCondition, Press


def test_the_second_is_told_who_operates(rig, ann, bob):
    ann.click()
    bob.click()
    assert rig.decision.reason == "Ann drives"
    assert rig.refused["not the operator"] == 1
    beat = rig.beat()
    assert (beat.operator_name, beat.operator_session) == ("Ann", ann.session)


def test_who_pressed_in_vain_does_not_set_off_when_the_place_is_free(rig, ann, bob):
    ann.click()
    bob.click()
    ann.send(GOODBYE)
    bob.hold(MANUAL)
    assert rig.decision.driver is not Source.TELEOP
    bob.click()
    assert rig.decision.reason == "Bob drives"


def test_the_place_is_free_after_three_seconds_of_silence(rig, ann, bob):
    ann.click()
    rig.wait(2.9)
    bob.click()
    assert rig.speed_mps == 0
    rig.wait(0.2)
    bob.click()
    assert rig.decision.reason == "Bob drives"
    ann.click()
    assert rig.decision.reason == "Bob drives"


@pytest.mark.parametrize("held", [MANUAL, AUTONOMY, NOTHING])
def test_taking_over_stops_the_car_and_wants_a_release(rig, ann, bob, held):
    ann.click()
    ann.send(held)
    bob.send(NOTHING)
    bob.send(TAKE_OVER)
    assert rig.speed_mps == 0
    assert rig.decision.reason == "Bob took over"
    assert rig.beat().operator_name == "Bob"
    ann.click()
    bob.send(MANUAL)
    assert rig.speed_mps == 0
    bob.hold(NOTHING)
    assert rig.speed_mps == 0
    bob.send(MANUAL)
    assert rig.decision.reason == "Bob drives"


def test_a_stale_take_over_changes_nothing(rig, ann, bob):
    late = bob.make(TAKE_OVER)
    ann.click()
    for _ in range(20):
        ann.hold(MANUAL, BEAT_S)
    rig.desk.receive("", late, rig.now_s)
    assert rig.decision.reason == "Ann drives"


def test_a_lost_operators_place_can_be_taken_over_at_once(rig, ann, bob):
    ann.click()
    rig.wait(0.3)
    bob.send(TAKE_OVER)
    bob.click()
    assert rig.decision.reason == "Bob drives"
    ann.click()
    assert rig.decision.reason == "Bob drives"


@pytest.mark.parametrize("flags", [ESTOP, ESTOP | GOODBYE, MANUAL | AUTONOMY, Press(63)])
def test_e_stop_latches_from_anybody_and_holds(rig, ann, bob, flags):
    ann.click()
    bob.send(flags)
    assert rig.decision.winner is Source.ESTOP
    assert rig.decision.reason == "e-stop by Bob"
    assert rig.refused == {}
    assert [word for word in rig.queue.live() if word.source is Source.TELEOP] == []
    for held in (NOTHING, MANUAL, AUTONOMY, MANUAL | RESET, TAKE_OVER, TAKE_OVER | RESET, GOODBYE):
        ann.send(NOTHING)
        ann.hold(held)
        assert [word.source for word in rig.queue.live() if word.source is Source.TELEOP] == []
        assert rig.standing == "e-stop"
        assert rig.speed_mps == 0
    rig.wait(60)
    assert rig.standing == "e-stop"


def test_e_stop_is_obeyed_from_commands_that_count_for_nothing_else(rig, ann):
    for changes in ({"car_session": 1}, {"beat": 12345}, {"sequence": 0}, {"session": 2**64 - 1}, {"name": ""}):
        ann.send(ESTOP, **changes)
        assert rig.e_stop.latched
        rig.e_stop.clear(Cause.OPERATOR)
    assert rig.refused == {}, "it was obeyed"


def test_a_stop_to_all_is_logged_as_what_it_is(rig, caplog):
    """It comes 50 times a second from a client that has not heard this start of the car."""
    for sequence in range(20):
        rig.client("marshal").send(ESTOP, car_session=0, beat=0, sequence=sequence)
    assert [record.getMessage() for record in caplog.records] == ["e-stop by marshal"]
    assert rig.refused == {}
    assert rig.standing == "e-stop"


def test_e_stop_is_obeyed_from_a_command_that_is_broken_inside(rig):
    payload = bytearray(rig.client().make(ESTOP))
    payload[28:32] = b"\x00\x00\xc0\x7f"  # a speed that is not a number
    rig.desk.receive("", bytes(payload), rig.now_s)
    assert rig.decision.reason == "e-stop by an unreadable command"
    assert rig.refused == {"malformed": 1}


def test_reset_is_a_deliberate_act_and_moves_nothing(rig, ann):
    ann.click()
    ann.hold(ESTOP)
    ann.send(RESET)
    assert rig.e_stop.latched, "not before a release"
    ann.send(NOTHING)
    ann.send(RESET)
    assert not rig.e_stop.latched
    assert rig.faults_cleared == 1
    ann.hold(RESET)
    assert rig.speed_mps == 0
    ann.send(MANUAL)
    assert rig.speed_mps == 0
    ann.hold(NOTHING)
    assert rig.speed_mps == 0
    ann.send(MANUAL)
    assert rig.speed_mps == HAND_MPS


def test_a_reset_moves_nothing_although_everybody_left_in_peace():
    rig = Rig("always")
    ann, bob = rig.client("Ann"), rig.client("Bob")
    ann.click()
    ann.send(ESTOP)
    ann.send(GOODBYE)
    assert not rig.beat().flags & CarCondition.PERMITTED
    bob.hold(NOTHING)
    bob.send(RESET)
    assert rig.speed_mps == 0
    bob.hold(NOTHING)
    assert rig.speed_mps == 0
    assert rig.standing == "waiting for a press"


def test_a_stale_or_foreign_reset_resets_nothing(rig, ann):
    ann.send(ESTOP)
    ann.send(NOTHING)
    late = ann.make(RESET)
    ann.send(RESET, car_session=1)
    rig.wait(1.0)
    rig.desk.receive("", late, rig.now_s)
    assert rig.e_stop.latched


def test_only_the_operator_resets_while_there_is_one(rig, ann, bob):
    ann.click()
    bob.send(ESTOP)
    ann.send(NOTHING)
    bob.click(RESET)
    assert rig.e_stop.latched
    ann.send(GOODBYE)
    bob.click(RESET)
    assert not rig.e_stop.latched


def test_a_reset_during_a_motor_fault_asks_the_motor_and_waits_for_it(rig, ann):
    rig.e_stop.latch(Cause.MOTOR, "motor fault: DRV")
    rig.desk.rearm("the motor had a fault; permit again")
    ann.send(ESTOP)
    assert rig.decision.reason == "motor fault: DRV; e-stop by Ann"
    ann.click(RESET)
    assert rig.faults_cleared == 1
    assert rig.decision.reason == "motor fault: DRV"
    assert rig.beat().flags & CarCondition.FAULT
    rig.e_stop.clear(Cause.MOTOR)
    ann.click()
    assert rig.speed_mps == HAND_MPS


def test_a_reset_without_an_e_stop_changes_nothing_but_wants_a_release(rig, ann):
    before = rig.speed_mps
    ann.click(RESET)
    assert rig.faults_cleared == 0
    assert rig.standing == "nobody"
    ann.send(MANUAL)
    assert rig.speed_mps == before
