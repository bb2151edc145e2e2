"""Rehearsals: in time before the next scan, only for a car that drives, never on a wire, and never by a user's law."""

import asyncio
import math
from dataclasses import replace

import numpy as np
import pytest

from wallride.drivers.api import Drive, MotorState, Scan
from wallride.runtime.arbitration.command import Decision, Output, Source
from wallride.runtime.control.perception.lidar_health import LidarHealth
from wallride.runtime.control.perception.scene_agreement import SceneAgreement
from wallride.runtime.rehearsal import MAX_TOOK_S, SPARE_S, Rehearsal
from wallride.runtime.settings.tree import Settings
from wallride.sim.virtual.virtual_time import run_virtual

PERIOD_S = 0.025
STEP_RAD = math.radians(0.25)


def scan_at(now_s):
    ranges_m = np.linspace(1.0, 3.0, 1081, dtype=np.float32)
    return Scan(now_s, now_s, -STEP_RAD * 540, STEP_RAD, 0.02, 30.0, ranges_m, round(now_s / PERIOD_S))


def motor_at(now_s):
    return MotorState(now_s, 1.0, now_s, 0.0, 12.0, 0.0, 0.0, 20.0, "", timed_out=False, killed=False)


def output_of(speed_mps=1.0, winner=Source.NAVIGATION):
    decision = Decision(speed_mps, 0.0, Source.NAVIGATION, winner, "wall")
    return Output(0.0, Drive(speed_mps, 0.0), decision, delivered=True)


def rehearsed(output, *, took_s=0.0, scans=3, due_s=PERIOD_S, settings=None, fails=False):
    """Return when each rehearsal began, counted from its scan, and the scans that it answered."""

    async def drive():
        loop = asyncio.get_running_loop()
        rehearsal, begun = Rehearsal(settings or Settings(), loop.time), []
        rehearsal.took_s, answer = took_s, rehearsal._answer

        def noted(scan, motor):
            begun.append((loop.time() - began_s, scan))
            if fails:
                raise ValueError("a law that fails")
            answer(scan, motor)

        rehearsal._answer = noted  # type: ignore[method-assign]
        loop.set_exception_handler(lambda *_: None)
        for _ in range(scans):
            began_s = loop.time()
            rehearsal.plan(scan_at(began_s), motor_at(began_s), output, began_s + due_s)
            await asyncio.sleep(PERIOD_S)
        return begun, rehearsal

    return run_virtual(drive())


def test_it_ends_a_spare_before_the_next_scan():
    begun, _ = rehearsed(output_of(), took_s=0.001)
    assert len(begun) == 3
    first_s, scan = begun[0]
    assert first_s == pytest.approx(PERIOD_S - SPARE_S - 0.001)
    assert scan.stamp_s == scan.received_s > 0.0, "a scan of now: an old one would be answered by a stop"


@pytest.mark.parametrize(
    "output",
    [None, output_of(0.0), output_of(0.5, Source.SAFETY), output_of(1.0, None)],
    ids=["nothing was decided", "it stands", "safety slows it", "no source decides"],
)
def test_a_car_that_does_not_drive_freely_rehearses_nothing(output):
    assert rehearsed(output)[0] == []


def test_without_an_estimate_of_the_next_scan_there_is_none():
    assert rehearsed(output_of(), due_s=math.nan)[0] == []
    assert rehearsed(output_of(), due_s=0.0005)[0] == [], "too late"


def test_scans_that_come_at_once_are_rehearsed_once_and_a_brake_cancels_what_was_planned():
    async def drive():
        loop = asyncio.get_running_loop()
        rehearsal, begun = Rehearsal(Settings(), loop.time), []
        rehearsal._answer = lambda scan, _motor: begun.append(scan.sequence)  # type: ignore[method-assign, assignment]
        for output in (output_of(), output_of(0.0)):
            for sequence in range(3):
                scan = replace(scan_at(loop.time()), sequence=sequence)
                rehearsal.plan(scan, None, output_of(), loop.time() + PERIOD_S)
            rehearsal.plan(replace(scan, sequence=3), None, output, loop.time() + PERIOD_S)
            await asyncio.sleep(PERIOD_S)
        return begun

    assert run_virtual(drive()) == [3]


def test_a_driver_reads_before_each_answer_and_not_where_there_is_none():
    async def drive():
        loop = asyncio.get_running_loop()
        rehearsal, done = Rehearsal(Settings(), loop.time), []
        rehearsal.read = lambda: done.append("read")
        rehearsal._answer = lambda *_: done.append("answer")  # type: ignore[method-assign]
        for output in (output_of(), output_of(0.0), output_of()):
            rehearsal.plan(scan_at(loop.time()), None, output, loop.time() + PERIOD_S)
            await asyncio.sleep(PERIOD_S)
        return done

    assert run_virtual(drive()) == ["read", "answer"] * 2


def test_a_computer_that_is_too_slow_does_not_rehearse():
    assert rehearsed(output_of(), took_s=1.1 * MAX_TOOK_S)[0] == []


def test_after_one_slow_rehearsal_they_go_on_later():
    begun, _ = rehearsed(output_of(), took_s=1.1 * MAX_TOOK_S, scans=10)
    assert 0 < len(begun) < 10


def test_one_that_fails_is_the_last():
    begun, rehearsal = rehearsed(output_of(), fails=True)
    assert len(begun) == 1
    assert rehearsal.took_s == math.inf


def test_what_is_rehearsed_is_not_learnt(monkeypatch):
    learnt = []
    monkeypatch.setattr(LidarHealth, "update", lambda *_, **__: learnt.append("window"))
    monkeypatch.setattr(SceneAgreement, "learn", lambda *_, **__: learnt.append("scene"))
    begun, rehearsal = rehearsed(output_of(), scans=5)
    rehearsal._stack.laws.learn()
    assert len(begun) == 5
    assert learnt == []


@pytest.mark.parametrize("own", ["wall_follow", "safety"])
def test_a_law_of_the_user_is_called_for_real_scans_alone(own):
    settings = Settings()
    named = getattr(settings, own).model_copy(update={"method": "my_laws:Law"})
    _, rehearsal = rehearsed(output_of(), settings=settings.model_copy(update={own: named}))
    assert rehearsal._stack.laws.runners == []
    rehearsal.apply(settings.model_copy(update={own: named}))
    assert rehearsal._stack.laws.runners == []


def test_the_warm_up_answers_for_safety_and_follower():
    rehearsal = Rehearsal(Settings(), lambda: 1.0)
    rehearsal.warm_up()
    assert [word.source for word in rehearsal._stack.queue.live()] == [Source.SAFETY, Source.PERMIT, Source.NAVIGATION]
