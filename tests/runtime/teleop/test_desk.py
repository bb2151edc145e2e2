"""Stories of the operator's desk, one rule each; at the end a table of what every press does in every standing."""

import itertools
import math

import pytest

from runtime.arbitration.command import Source
from runtime.arbitration.emergency_stop import Cause
from runtime.arbitration.permit import NOT_GRANTED
from runtime.teleop.sessions import MAX_SESSIONS
from runtime.wire.teleop import UNKNOWN_AGE_MS, CarCondition, Input, Press
from tests.runtime.operator_rig import AUTO_MPS, BEAT_S, HAND_MPS, Rig

BOTH = ["required", "always"]
MANUAL, AUTONOMY, ESTOP, RESET = Press.MANUAL, Press.AUTONOMY, Press.ESTOP, Press.RESET
TAKE_OVER, GOODBYE, NOTHING = Press.TAKE_OVER, Press.GOODBYE, Press(0)


@pytest.fixture(params=BOTH)
def rig(request):
    return Rig(request.param)


# --- the plain way ---


def test_without_any_operator_the_mode_decides():
    assert Rig("always").speed_mps == AUTO_MPS
    assert Rig("required").speed_mps == 0
    assert Rig("required").decision.reason == NOT_GRANTED


def test_by_hand_only_while_it_is_held(rig):
    ann = rig.client()
    ann.hold(NOTHING)
    ann.hold(MANUAL)
    assert rig.speed_mps == HAND_MPS
    assert rig.decision.driver is Source.TELEOP
    ann.send(NOTHING)
    assert rig.decision.driver is not Source.TELEOP


def test_the_word_ends_with_the_beat_it_echoed(rig):
    ann = rig.client()
    ann.click()
    sent_s = rig.now_s  # the beat of this very moment
    rig.stall(0.199)
    assert rig.speed_mps == HAND_MPS
    rig.now_s = sent_s + 0.2
    assert rig.speed_mps == 0


def test_the_permit_is_a_lease():
    rig = Rig("required")
    ann = rig.client()
    ann.click(AUTONOMY)
    assert rig.speed_mps == AUTO_MPS
    rig.stall(0.2)
    assert rig.speed_mps == 0, "it ends without anybody looking"
    ann = rig.client("Bob")
    assert rig.standing == "autonomy"
    rig.beat()
    assert rig.standing == "operator lost"


def test_releasing_the_permit_stops_at_once():
    rig = Rig("required")
    ann = rig.client()
    ann.click(AUTONOMY)
    ann.send(NOTHING)
    assert rig.speed_mps == 0
    assert rig.decision.reason == NOT_GRANTED


def test_with_permit_always_an_explicit_release_lets_autonomy_go_on():
    rig = Rig("always")
    ann = rig.client()
    ann.hold(NOTHING)
    assert rig.speed_mps == AUTO_MPS
    ann.hold(MANUAL)
    assert rig.speed_mps == HAND_MPS
    ann.hold(NOTHING)
    assert rig.speed_mps == AUTO_MPS


def test_from_one_deadman_to_the_other_without_a_gap():
    rig = Rig("required")
    ann = rig.client()
    ann.click(MANUAL)
    ann.send(AUTONOMY)
    assert rig.decision.driver is Source.NAVIGATION
    assert rig.speed_mps == AUTO_MPS
    ann.send(MANUAL)
    assert rig.speed_mps == HAND_MPS


# --- pressing counts only after a release ---


def test_a_new_session_that_holds_already_is_not_obeyed(rig):
    ann = rig.client()
    ann.hold(MANUAL, 1.0)
    assert rig.decision.driver is not Source.TELEOP
    assert rig.heard.flags & CarCondition.REARM
    assert rig.refused["not released yet"] == 50
    ann.click()
    assert rig.speed_mps == HAND_MPS
    rig.wait(BEAT_S)
    assert not rig.heard.flags & CarCondition.REARM


def test_a_client_that_was_away_wants_a_release_although_it_never_operated(rig):
    ann = rig.client()
    ann.hold(NOTHING)
    rig.wait(1.0)
    ann.hold(MANUAL)
    assert rig.decision.driver is not Source.TELEOP
    ann.click()
    assert rig.speed_mps == HAND_MPS


@pytest.mark.parametrize("held", [MANUAL, AUTONOMY])
def test_a_device_that_went_or_came_back_wants_a_release(held):
    rig = Rig("required")
    ann = rig.client()
    ann.click(held)
    rig.desk.rearm("the lidar was lost; permit again")
    assert rig.speed_mps == 0
    ann.hold(held)
    assert rig.speed_mps == 0
    assert rig.desk.view().reason == "the lidar was lost; permit again"
    ann.click(held)
    assert rig.speed_mps > 0


def test_a_device_that_went_takes_back_a_permit_that_somebody_else_gave():
    rig = Rig("required")
    rig.permit.grant(until_s=1000.0)
    rig.desk.rearm("the lidar was lost; permit again")
    assert rig.decision.reason == "the lidar was lost; permit again"


def test_with_permit_always_a_device_that_came_back_resumes_unless_somebody_drove():
    rig = Rig("always")
    rig.desk.rearm("the motor was lost; permit again")
    assert rig.speed_mps == AUTO_MPS
    ann = rig.client()
    ann.click()
    rig.desk.rearm("the motor was lost; permit again")
    ann.hold(NOTHING)
    assert rig.speed_mps == 0
    assert rig.standing == "waiting for a press"


# --- losing the operator ---


@pytest.mark.parametrize("held", [MANUAL, AUTONOMY, NOTHING])
def test_an_operator_who_falls_silent_stops_the_car_in_either_mode(rig, held):
    ann = rig.client()
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


def test_between_two_ticks_silence_is_a_stop_too(rig):
    ann = rig.client()
    for held in (MANUAL, AUTONOMY, NOTHING):
        ann.click()
        ann.send(held)
        rig.stall(0.2)
        assert rig.speed_mps == 0
        rig.beat()


@pytest.mark.parametrize("held", [MANUAL, AUTONOMY])
@pytest.mark.parametrize("away_s", [0.3, 2.0, 10.0])
def test_after_the_link_is_back_nothing_moves_until_the_operator_acts(rig, held, away_s):
    ann = rig.client()
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


def test_a_gap_is_noticed_by_the_command_after_it_when_no_tick_did(rig):
    ann = rig.client()
    ann.click()
    rig.stall(0.3)
    ann.hear(rig.desk.beat(math.nan))  # a beat without a tick
    ann.send(MANUAL)
    assert rig.speed_mps == 0
    assert rig.standing == "release everything"
    ann.send(NOTHING)
    assert rig.speed_mps == 0, "it was lost, and hands off is no act"


def test_a_goodbye_is_no_loss(rig):
    ann = rig.client()
    ann.click()
    ann.hold(GOODBYE)
    assert rig.refused == {}
    rig.wait(5.0)
    assert rig.standing == "nobody"
    assert rig.speed_mps == (AUTO_MPS if rig.permit.always else 0)


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


def test_whoever_said_goodbye_is_gone_even_for_copies_of_its_last_commands(rig):
    ann = rig.client()
    ann.send(NOTHING)
    ann.send(MANUAL)
    later = [ann.make(NOTHING), ann.make(MANUAL)]
    ann.send(GOODBYE)
    for payload in later:
        rig.desk.receive("", payload, rig.now_s)
    assert rig.decision.driver is not Source.TELEOP
    assert rig.refused["session is over"] == 2


# --- age and replay ---


@pytest.mark.parametrize("permit", BOTH)
def test_a_burst_of_late_commands_moves_nothing(permit):
    rig = Rig(permit)
    ann = rig.client()
    ann.click()
    late = []
    for _ in range(144):  # 3 s at 48 Hz stay in the link while the beats still come
        rig.wait(BEAT_S)
        late.append(ann.make(MANUAL))
    rig.wait(0.3)
    for payload in late:
        rig.desk.receive("", payload, rig.now_s)
        assert rig.speed_mps == 0
    assert rig.refused["stale"] == 144
    assert rig.desk.view().accepted == 2


def test_the_last_moments_of_a_burst_are_fresh_and_still_not_obeyed(rig):
    ann = rig.client()
    ann.click()
    late = []
    for _ in range(150):
        rig.wait(BEAT_S)
        late.append(ann.make(MANUAL))
    for payload in late:
        rig.desk.receive("", payload, rig.now_s)
        assert rig.speed_mps == 0
    assert rig.standing == "release everything"


@pytest.mark.parametrize(("age_s", "obeyed"), [(0.0, True), (0.19, True), (0.2, False), (0.25, False)])
def test_a_command_is_as_old_as_its_beat(rig, age_s, obeyed):
    ann = rig.client()
    ann.send(NOTHING)
    pressed = ann.make(MANUAL)
    rig.now_s += age_s
    rig.desk.receive("", pressed, rig.now_s)
    assert (rig.decision.driver is Source.TELEOP) == obeyed
    assert rig.refused == ({} if obeyed else {"stale": 1})


def test_an_e_stop_in_a_late_burst_is_obeyed(rig):
    ann = rig.client()
    ann.click()
    late = [ann.make(MANUAL), ann.make(ESTOP), ann.make(NOTHING), ann.make(RESET)]
    rig.wait(3.0)
    for payload in late:
        rig.desk.receive("", payload, rig.now_s)
    assert rig.standing == "e-stop"
    assert rig.refused["stale"] == 4


def test_when_the_cars_own_process_stood_still_the_waiting_commands_are_old(rig):
    ann = rig.client()
    ann.click()
    waiting = [ann.make(MANUAL) for _ in range(100)]
    rig.stall(3.0)
    for payload in waiting:
        rig.desk.receive("", payload, rig.now_s - 2.9)  # the arrival does not make them younger, nor older
    assert rig.speed_mps == 0
    assert rig.refused["stale"] == 100


def test_a_copy_of_a_fresh_command_is_not_obeyed(rig):
    ann = rig.client()
    ann.send(NOTHING)
    pressed = ann.send(MANUAL)
    ann.send(NOTHING)
    rig.desk.receive("", pressed, rig.now_s)
    assert rig.decision.driver is not Source.TELEOP
    assert rig.refused["replay"] == 1


def test_commands_for_an_earlier_start_of_the_car_are_foreign(rig):
    ann = rig.client()
    ann.send(NOTHING)
    ann.send(MANUAL, car_session=0xBEEF)
    ann.send(MANUAL, car_session=0, beat=0)
    assert rig.refused["for another start of the car"] == 2
    assert rig.decision.driver is not Source.TELEOP


@pytest.mark.parametrize("ahead", [1, 2, 1000, 2**31, 2**32 - 1000])
def test_beats_of_the_future_are_unknown(rig, ahead):
    ann = rig.client()
    ann.send(NOTHING)
    ann.send(MANUAL, beat=rig.heard.beat + ahead)
    assert rig.refused["unknown beat"] == 1
    assert rig.decision.driver is not Source.TELEOP


def test_the_numbers_may_wrap_around(rig):
    rig.desk._beats.number = 2**32 - 3
    ann = rig.client()
    ann.sequence = 2**32 - 3
    rig.wait(BEAT_S)
    ann.hold(NOTHING, 0.06)
    ann.hold(MANUAL, 1.0)
    assert rig.speed_mps == HAND_MPS
    assert rig.heard.beat < 100
    assert rig.heard.acknowledged < 100
    assert rig.refused == {}


def test_a_restarted_client_counts_from_one_again(rig):
    ann = rig.client()
    ann.click()
    ann.hold(MANUAL, 1.0)
    ann.send(GOODBYE)
    again = rig.client("Ann", session=77)
    again.click()
    assert rig.speed_mps == HAND_MPS
    assert rig.beat().operator_session == 77


# --- one operator at a time ---


def test_the_second_is_told_who_operates(rig):
    ann, bob = rig.client("Ann"), rig.client("Bob")
    ann.click()
    bob.click()
    assert rig.decision.reason == "Ann drives"
    assert rig.refused["not the operator"] == 1
    beat = rig.beat()
    assert (beat.operator_name, beat.operator_session) == ("Ann", ann.session)


def test_who_pressed_in_vain_does_not_set_off_when_the_place_is_free(rig):
    ann, bob = rig.client("Ann"), rig.client("Bob")
    ann.click()
    bob.click()
    ann.send(GOODBYE)
    bob.hold(MANUAL)
    assert rig.decision.driver is not Source.TELEOP
    bob.click()
    assert rig.decision.reason == "Bob drives"


def test_the_place_is_free_after_three_seconds_of_silence(rig):
    ann, bob = rig.client("Ann"), rig.client("Bob")
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
def test_taking_over_stops_the_car_and_wants_a_release(rig, held):
    ann, bob = rig.client("Ann"), rig.client("Bob")
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


def test_a_stale_take_over_changes_nothing(rig):
    ann, bob = rig.client("Ann"), rig.client("Bob")
    late = bob.make(TAKE_OVER)
    ann.click()
    for _ in range(20):
        ann.hold(MANUAL, BEAT_S)
    rig.desk.receive("", late, rig.now_s)
    assert rig.decision.reason == "Ann drives"


def test_a_lost_operators_place_can_be_taken_over_at_once(rig):
    ann, bob = rig.client("Ann"), rig.client("Bob")
    ann.click()
    rig.wait(0.3)
    bob.send(TAKE_OVER)
    bob.click()
    assert rig.decision.reason == "Bob drives"
    ann.click()
    assert rig.decision.reason == "Bob drives"


# --- e-stop ---


@pytest.mark.parametrize("flags", [ESTOP, ESTOP | GOODBYE, MANUAL | AUTONOMY, Press(63)])
def test_e_stop_latches_from_anybody_and_holds(rig, flags):
    ann, bob = rig.client("Ann"), rig.client("Bob")
    ann.click()
    bob.send(flags)
    assert rig.decision.winner is Source.ESTOP
    assert rig.decision.reason == "e-stop by Bob"
    assert rig.refused == {}
    assert [word for word in rig.voices.live() if word.source is Source.TELEOP] == []
    for held in (NOTHING, MANUAL, AUTONOMY, MANUAL | RESET, TAKE_OVER, TAKE_OVER | RESET, GOODBYE):
        ann.send(NOTHING)
        ann.hold(held)
        assert [word.source for word in rig.voices.live() if word.source is Source.TELEOP] == []
        assert rig.standing == "e-stop"
        assert rig.speed_mps == 0
    rig.wait(60)
    assert rig.standing == "e-stop"


def test_e_stop_is_obeyed_from_commands_that_count_for_nothing_else(rig):
    ann = rig.client()
    for changes in ({"car_session": 1}, {"beat": 12345}, {"sequence": 0}, {"session": 2**64 - 1}, {"name": ""}):
        ann.send(ESTOP, **changes)
        assert rig.e_stop.latched
        rig.e_stop.clear(Cause.OPERATOR)


def test_e_stop_is_obeyed_from_a_command_that_is_broken_inside(rig):
    payload = bytearray(rig.client().make(ESTOP))
    payload[28:32] = b"\x00\x00\xc0\x7f"  # a speed that is not a number
    rig.desk.receive("", bytes(payload), rig.now_s)
    assert rig.decision.reason == "e-stop by an unreadable command"
    assert rig.refused == {"malformed": 1}


def test_reset_is_a_deliberate_act_and_moves_nothing(rig):
    ann = rig.client()
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


def test_a_stale_or_foreign_reset_resets_nothing(rig):
    ann = rig.client()
    ann.send(ESTOP)
    ann.send(NOTHING)
    late = ann.make(RESET)
    ann.send(RESET, car_session=1)
    rig.wait(1.0)
    rig.desk.receive("", late, rig.now_s)
    assert rig.e_stop.latched


def test_only_the_operator_resets_while_there_is_one(rig):
    ann, bob = rig.client("Ann"), rig.client("Bob")
    ann.click()
    bob.send(ESTOP)
    ann.send(NOTHING)
    bob.click(RESET)
    assert rig.e_stop.latched
    ann.send(GOODBYE)
    bob.click(RESET)
    assert not rig.e_stop.latched


def test_a_reset_during_a_motor_fault_asks_the_motor_and_waits_for_it(rig):
    ann = rig.client()
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


def test_a_reset_without_an_e_stop_changes_nothing_but_wants_a_release(rig):
    ann = rig.client()
    before = rig.speed_mps
    ann.click(RESET)
    assert rig.faults_cleared == 0
    assert rig.standing == "nobody"
    ann.send(MANUAL)
    assert rig.speed_mps == before


# --- frozen pads and contradictions ---


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
def test_a_pad_that_drives_without_an_event_is_frozen(rig, changes, obeyed):
    ann = rig.client()
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
def test_two_things_at_once_and_unknown_hands_stop_the_car(rig, flags):
    ann = rig.client()
    ann.click()
    ann.send(flags)
    assert rig.speed_mps == 0
    ann.hold(MANUAL)
    assert rig.speed_mps == 0


# --- many sessions, and what is shown ---


def test_thousands_of_sessions_take_no_memory_and_cannot_push_the_operator_out(rig):
    ann = rig.client()
    ann.click()
    for number in range(1000, 6000):
        crowd = rig.client(f"x{number}", number)
        rig.clients.remove(crowd)
        crowd.click()
        if number % 100 == 0:
            ann.hold(MANUAL, BEAT_S)
    assert len(rig.desk._gate._sessions) == MAX_SESSIONS
    assert rig.decision.reason == "Ann drives"
    assert rig.refused["too many sessions"] > 4000
    rig.wait(3.1)
    bob = rig.client("Bob", 7)
    bob.click()
    assert rig.decision.reason == "Bob drives", "silent ones make room"


def test_the_round_trip_is_shown(rig):
    ann = rig.client()
    ann.click()
    ann.deaf = True
    rig.wait(0.1)
    ann.send(MANUAL)
    view = rig.desk.view()
    assert view.round_trip_s == pytest.approx(0.1)
    assert view.operator == "Ann"
    assert view.session == "0000000000000001"
    assert view.age_s == 0
    rig.stall(0.03)
    beat = rig.desk.beat(1.5)
    assert (beat.acknowledged, beat.acknowledged_age_ms, beat.speed_mps) == (3, 30, 1.5)


def test_the_acknowledged_age_counts_from_the_arrival():
    rig = Rig()
    ann = rig.client()
    ann.click()
    rig.desk.receive("", ann.make(MANUAL), rig.now_s - 0.05)
    assert rig.desk.beat(math.nan).acknowledged_age_ms == 50


def test_nothing_is_logged_per_message(rig, caplog):
    ann = rig.client()
    for number in range(5000):
        rig.now_s += 0.001
        ann.send(MANUAL)
        rig.desk.receive("", b"x" * (number % 80), rig.now_s)
    assert 2 <= len(caplog.records) < 20
    assert sum(rig.refused.values()) > 5000
    assert "more)" in caplog.text


# --- every press in every standing ---


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
