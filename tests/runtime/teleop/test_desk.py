"""The operator's desk: driving by hand, permits, and pressing after a release."""

import math

import pytest

from tests.runtime.operator_rig import AUTO_MPS, BEAT_S, HAND_MPS, Rig
from tests.runtime.teleop.presses import AUTONOMY, MANUAL, NOTHING
from wallride.runtime.arbitration.command import Source
from wallride.runtime.arbitration.permit import NOT_GRANTED
from wallride.runtime.teleop.sessions import MAX_SESSIONS
from wallride.runtime.wire.teleop import CarCondition


def test_without_any_operator_the_mode_decides():
    assert Rig("always").speed_mps == AUTO_MPS
    assert Rig("required").speed_mps == 0
    assert Rig("required").decision.reason == NOT_GRANTED


def test_by_hand_only_while_it_is_held(rig, ann):
    ann.hold(NOTHING)
    ann.hold(MANUAL)
    assert rig.speed_mps == HAND_MPS
    assert rig.decision.driver is Source.TELEOP
    ann.send(NOTHING)
    assert rig.decision.driver is not Source.TELEOP


def test_the_word_ends_with_the_beat_it_echoed(rig, ann):
    ann.click()
    sent_s = rig.now_s  # the beat of this very moment
    rig.stall(0.199)
    assert rig.speed_mps == HAND_MPS
    rig.now_s = sent_s + 0.2
    assert rig.speed_mps == 0


def test_what_the_operator_holds_is_known_until_it_expires(rig, ann, bob):

    def held():
        command = rig.desk.command
        return command and command.flags

    assert held() is None
    ann.click()
    assert held() == MANUAL
    bob.send(NOTHING)
    assert held() == MANUAL, "only the operator's"
    ann.send(NOTHING)
    assert held() == NOTHING
    rig.stall(0.2)
    assert held() is None


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


def test_a_new_session_that_holds_already_is_not_obeyed(rig, ann):
    ann.hold(MANUAL, 1.0)
    assert rig.decision.driver is not Source.TELEOP
    assert rig.heard.flags & CarCondition.REARM
    assert rig.refused["not released yet"] == 50
    ann.click()
    assert rig.speed_mps == HAND_MPS
    rig.wait(BEAT_S)
    assert not rig.heard.flags & CarCondition.REARM


def test_a_client_that_was_away_wants_a_release_although_it_never_operated(rig, ann):
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


def test_thousands_of_sessions_take_no_memory_and_cannot_push_the_operator_out(rig, ann):
    ann.click()
    for number in range(1000, 6000):
        crowd = rig.client(f"x{number}", number)
        rig.clients.remove(crowd)
        crowd.click()
        if number % 100 == 0:
            ann.hold(MANUAL, BEAT_S)
    assert rig.desk.view().sessions == MAX_SESSIONS
    assert rig.decision.reason == "Ann drives"
    assert rig.refused["too many sessions"] > 4000
    rig.wait(3.1)
    bob = rig.client("Bob", 7)
    bob.click()
    assert rig.decision.reason == "Bob drives", "silent ones make room"


def test_the_round_trip_is_shown(rig, ann):
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


def test_nothing_is_logged_per_message(rig, ann, caplog):
    for number in range(5000):
        rig.now_s += 0.001
        ann.send(MANUAL)
        rig.desk.receive("", b"x" * (number % 80), rig.now_s)
    assert 2 <= len(caplog.records) < 20
    assert sum(rig.refused.values()) > 5000
    assert "more)" in caplog.text


def test_while_a_device_is_lost_no_press_counts_and_after_its_return_only_one_after_a_release():
    rig = Rig()
    ann = rig.client()
    rig.desk.waits = lambda by_hand: not by_hand
    ann.click(AUTONOMY)
    assert rig.speed_mps == 0
    rig.desk.waits = lambda _by_hand: False
    ann.hold(AUTONOMY)
    assert rig.speed_mps == 0
    ann.click(AUTONOMY)
    assert rig.speed_mps == AUTO_MPS


def test_a_device_that_a_human_does_not_need_holds_no_human_up():
    rig = Rig()
    rig.desk.waits = lambda by_hand: not by_hand
    rig.client().click(MANUAL)
    assert rig.speed_mps == HAND_MPS


def test_a_change_to_autonomy_that_does_not_count_ends_driving_by_hand_at_once():
    """With the lidar lost: the hand has let go of the drive, whatever becomes of the permit."""
    rig = Rig()
    rig.desk.waits = lambda by_hand: not by_hand
    ann = rig.client()
    ann.click(MANUAL)
    ann.hold(AUTONOMY)
    assert rig.speed_mps == 0
    ann.hold(MANUAL)
    assert rig.speed_mps == 0
    ann.click(MANUAL)
    assert rig.speed_mps == HAND_MPS
