"""The operator's desk and the age of commands: late bursts, replays, foreign sessions."""

from functools import partial

import pytest

from tests.runtime.operator_rig import BEAT_S, HAND_MPS, Rig
from tests.runtime.teleop.presses import BOTH, ESTOP, GOODBYE, MANUAL, NOTHING, RESET
from wallride.runtime.arbitration.command import Source
from wallride.runtime.teleop import desk
from wallride.runtime.teleop.sessions import Beats


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


def test_the_last_moments_of_a_burst_are_fresh_and_still_not_obeyed(rig, ann):
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
def test_a_command_is_as_old_as_its_beat(rig, ann, age_s, obeyed):
    ann.send(NOTHING)
    pressed = ann.make(MANUAL)
    rig.now_s += age_s
    rig.desk.receive("", pressed, rig.now_s)
    assert (rig.decision.driver is Source.TELEOP) == obeyed
    assert rig.refused == ({} if obeyed else {"stale": 1})


def test_an_e_stop_in_a_late_burst_is_obeyed(rig, ann):
    ann.click()
    late = [ann.make(MANUAL), ann.make(ESTOP), ann.make(NOTHING), ann.make(RESET)]
    rig.wait(3.0)
    for payload in late:
        rig.desk.receive("", payload, rig.now_s)
    assert rig.standing == "e-stop"
    assert rig.refused["stale"] == 3, "all but the e-stop"


def test_when_the_cars_own_process_stood_still_the_waiting_commands_are_old(rig, ann):
    ann.click()
    waiting = [ann.make(MANUAL) for _ in range(100)]
    rig.stall(3.0)
    for payload in waiting:
        rig.desk.receive("", payload, rig.now_s - 2.9)  # the arrival does not make them younger, nor older
    assert rig.speed_mps == 0
    assert rig.refused["stale"] == 100


def test_a_copy_of_a_fresh_command_is_not_obeyed(rig, ann):
    ann.send(NOTHING)
    pressed = ann.send(MANUAL)
    ann.send(NOTHING)
    rig.desk.receive("", pressed, rig.now_s)
    assert rig.decision.driver is not Source.TELEOP
    assert rig.refused["replay"] == 1


def test_commands_for_an_earlier_start_of_the_car_are_foreign(rig, ann):
    ann.send(NOTHING)
    ann.send(MANUAL, car_session=0xBEEF)
    ann.send(MANUAL, car_session=0, beat=0)
    assert rig.refused["for another start of the car"] == 2
    assert rig.decision.driver is not Source.TELEOP


@pytest.mark.parametrize("ahead", [1, 2, 1000, 2**31, 2**32 - 1000])
def test_beats_of_the_future_are_unknown(rig, ann, ahead):
    ann.send(NOTHING)
    ann.send(MANUAL, beat=rig.heard.beat + ahead)
    assert rig.refused["unknown beat"] == 1
    assert rig.decision.driver is not Source.TELEOP


def test_the_numbers_may_wrap_around(monkeypatch):
    monkeypatch.setattr(desk, "Beats", partial(Beats, number=2**32 - 3))
    rig = Rig()
    ann = rig.client()
    ann.sequence = 2**32 - 3
    rig.wait(BEAT_S)
    ann.hold(NOTHING, 0.06)
    ann.hold(MANUAL, 1.0)
    assert rig.speed_mps == HAND_MPS
    assert rig.heard.beat < 100
    assert rig.heard.acknowledged < 100
    assert rig.refused == {}


def test_a_restarted_client_counts_from_one_again(rig, ann):
    ann.click()
    ann.hold(MANUAL, 1.0)
    ann.send(GOODBYE)
    again = rig.client("Ann", session=77)
    again.click()
    assert rig.speed_mps == HAND_MPS
    assert rig.beat().operator_session == 77
