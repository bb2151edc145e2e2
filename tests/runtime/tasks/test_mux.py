"""When the mux decides: on every word, at once for the last word on a scan, and on ticks only in silence."""

import asyncio
import itertools
import math

import pytest

from tests.runtime.decisions import Counting
from wallride.drivers.api import Drive
from wallride.runtime.arbitration.command import LAB_ORDER, DriveCommand, Source, SpeedLimit
from wallride.runtime.arbitration.command_queue import CommandQueue
from wallride.runtime.control.limiter import Limiter
from wallride.runtime.control.vehicle import CarSettings
from wallride.runtime.realtime.periodic import PeriodicTimer
from wallride.runtime.recording.decision_log import DecisionLog
from wallride.runtime.tasks.mux import Mux, SilenceTick
from wallride.sim.virtual.devices import MemoryMotor
from wallride.sim.virtual.virtual_time import run_virtual

TICK_HZ = 50.0


class BrakingMotor(MemoryMotor):
    """Its driver brakes in place of every speed for a time; wheels that the brake does not slow."""

    brakes_s = (math.inf, math.inf)

    @property
    def braked_instead(self):
        begin_s, end_s = self.brakes_s
        return begin_s <= self._clock() < end_s


class Rig:
    """A mux with its tick, and nobody who speaks."""

    def __init__(self):
        clock = asyncio.get_running_loop().time
        self.clock = clock
        self.queue = CommandQueue(LAB_ORDER, clock)
        self.motor = BrakingMotor(clock)
        self.log = DecisionLog(clock)
        limiter = Limiter(CarSettings())
        self.mux = Mux(self.queue, self.motor, limiter, frozenset(), self.log.clock, decision_log=self.log)
        self.decided_s = []
        self.notes = []
        timer = PeriodicTimer(clock)
        silence = SilenceTick(self.queue, TICK_HZ, clock, lambda *note: self.notes.append(note))
        timer.every(1 / TICK_HZ, silence.tick)
        self._tasks = [
            asyncio.ensure_future(self.mux.run(lambda _: self.decided_s.append(clock()))),
            asyncio.ensure_future(timer.run()),
        ]

    def put(self, *, for_s=10.0):
        word = DriveCommand(Source.TELEOP, Drive(1.0, 0.0), None, "stick")
        self.queue.put(word, expires_at_s=self.clock() + for_s)

    async def end(self):
        for task in self._tasks:
            task.cancel()
        await asyncio.gather(*self._tasks, return_exceptions=True)


def play(story):
    async def main():
        rig = Rig()
        try:
            await story(rig)
        finally:
            await rig.end()
        return rig

    return run_virtual(main())


def test_it_ticks_in_silence():
    async def story(_rig):
        await asyncio.sleep(1.001)

    rig = play(story)
    assert len(rig.decided_s) == pytest.approx(50, abs=2)
    assert len(rig.notes) == 50


def test_words_at_the_lidars_rate_leave_no_silence():
    async def story(rig):
        for _ in range(40):
            rig.put()
            await asyncio.sleep(0.025)

    assert len(play(story).decided_s) == 40


def test_after_the_last_word_it_ticks_again_soon():
    async def story(rig):
        rig.put()
        await asyncio.sleep(0.2)

    decided_s = play(story).decided_s
    assert decided_s[1] - decided_s[0] < 0.0501
    assert decided_s[-1] - decided_s[-2] == pytest.approx(0.02)


def test_a_word_that_expires_is_noticed_within_a_tick():
    async def story(rig):
        rig.put(for_s=0.031)
        for _ in range(10):
            await asyncio.sleep(0.025)
            rig.queue.last_put_s = rig.clock()  # another source goes on

    rig = play(story)
    assert rig.motor.wire[0][1].speed_mps >= 0
    assert min(at_s for at_s in rig.decided_s if at_s >= 0.031) <= 0.0511


def test_deciding_now_leaves_no_news_for_the_loops_next_turn():
    async def story(rig):
        await asyncio.sleep(0)
        rig.put()
        rig.mux.decide_now()
        assert len(rig.motor.wire) == 1
        await asyncio.sleep(0.001)
        assert len(rig.motor.wire) == 1
        rig.mux.decide_now()
        assert len(rig.motor.wire) == 1, "nothing new was said"
        rig.put()
        await asyncio.sleep(0.001)
        assert len(rig.motor.wire) == 2

    assert len(play(story).decided_s) == 2


def test_after_a_brake_of_the_drivers_own_the_speed_rises_from_what_that_left():
    """The driver brakes by itself, for one where the reported speed is impossible, and the mux wants to drive on."""

    async def story(rig):
        rig.motor.brakes_s = (1.0, 1.1)
        for _ in range(60):
            rig.put()
            await asyncio.sleep(0.025)

    wire = [(at_s, drive.speed_mps) for at_s, drive in play(story).motor.wire]
    before = [mps for at_s, mps in wire if at_s < 1.0]
    during = [mps for at_s, mps in wire if 1.0 <= at_s < 1.1]
    after = [mps for at_s, mps in wire if at_s >= 1.1]
    assert before[-1] == 1.0
    assert len(during) == 4
    assert during == sorted(during, reverse=True)
    assert after[0] < 0.3
    assert all(now - last <= 4.0 * 0.0251 for last, now in itertools.pairwise(after))
    assert after[-1] == 1.0


def test_a_motor_that_was_away_is_met_from_a_standstill():
    async def story(rig):
        for step in range(60):
            rig.motor.present = not 40 <= step < 44
            rig.put()
            await asyncio.sleep(0.025)

    wire = [(at_s, drive.speed_mps) for at_s, drive in play(story).motor.wire]
    assert [mps for at_s, mps in wire if at_s < 0.99][-1] == 1.0
    assert not [mps for at_s, mps in wire if 1.001 < at_s < 1.09]
    assert next(mps for at_s, mps in wire if at_s > 1.09) == pytest.approx(0.1)


def test_each_decision_is_published_kept_counted_and_logged():
    published = []

    async def story(rig):
        await asyncio.sleep(0.001)
        rig.mux._publish = published.append
        rig.put(for_s=0.05)
        await asyncio.sleep(0.05)
        rig.mux.step()

    rig = play(story)
    assert rig.mux.output is not None
    assert published
    steps = [parts for _, kind, parts in rig.log.drain() if kind == "step"]
    assert steps[-1][-1] is rig.mux.output
    assert {id(output) for output in published} <= {id(output) for *_, output in steps}
    assert rig.mux.seconds_by_winner["teleop"] == pytest.approx(0.05, abs=0.021)
    assert all(times_s[0] == output.stamp_s for times_s, *_, output in steps)


def test_what_a_command_leaves_in_safety_is_committed_once_when_it_is_sent():
    async def story(rig):
        judge = Counting()
        rig.queue.put(SpeedLimit(Source.SAFETY, judge), expires_at_s=rig.clock() + 10.0)
        rig.mux.step()
        assert judge.memory == 0, "nothing was sent"
        wish = DriveCommand(Source.NAVIGATION, Drive(1.0, 0.0), None, "wall")
        rig.queue.put(wish, expires_at_s=rig.clock() + 10.0)
        for sent in (1, 2):
            rig.mux.step()
            assert judge.memory == sent

    play(story)
