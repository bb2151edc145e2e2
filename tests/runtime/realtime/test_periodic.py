"""Absolute deadlines: no drift, no burst after a stall, one waking for everybody."""

import asyncio

import pytest

from wallride.drivers.api import as_wanted
from wallride.runtime.realtime.periodic import PeriodicTimer
from wallride.sim.virtual.virtual_time import run_virtual


def collect(count, stalls_s=lambda _: 0.0, clear_s=as_wanted):
    """Tick ten times a second; returns times, lateness and missed deadlines. A stall keeps the loop after a tick."""

    async def story():
        loop = asyncio.get_running_loop()
        enough = loop.create_future()
        times, late, missed = [], [], []
        stalled_s = [0.0]

        def tick(late_s, skipped):
            times.append(clock())
            late.append(late_s)
            missed.append(skipped)
            stalled_s[0] += stalls_s(len(times))
            if len(times) == count:
                enough.set_result(None)

        def clock():
            return loop.time() + stalled_s[0]

        timer = PeriodicTimer(clock, clear_s)
        timer.every(0.1, tick)
        task = asyncio.ensure_future(timer.run())
        await enough
        task.cancel()
        return times, late, missed

    return run_virtual(story())


def test_no_drift_although_the_work_takes_time():
    times, _, missed = collect(50, lambda _: 0.03)
    assert times[-1] == pytest.approx(5.0)
    assert sum(missed) == 0


def test_a_stall_is_reported_and_not_replayed():
    times, late, missed = collect(4, lambda n: 0.55 if n == 2 else 0.0)
    assert times == pytest.approx([0.1, 0.2, 0.75, 0.8])
    assert late == pytest.approx([0.0, 0.0, 0.45, 0.0])
    assert missed == [0, 0, 4, 0]


def test_a_deadline_may_be_moved_to_a_better_moment_and_the_next_is_a_period_later():
    # The third deadline is wanted 30 ms sooner, the fifth 20 ms later.
    moved = {3: -0.03, 5: 0.02}
    count = iter(range(2, 10))
    times, late, _ = collect(5, clear_s=lambda wanted_s, _slack_s: wanted_s + moved.get(next(count), 0.0))
    assert times == pytest.approx([0.1, 0.2, 0.27, 0.37, 0.49])
    assert late == pytest.approx([0.0] * 5)


def test_what_may_be_moved_is_less_than_half_a_period():
    slacks_s = []

    def clear_s(wanted_s, slack_s):
        slacks_s.append(slack_s)
        return wanted_s

    collect(3, clear_s=clear_s)
    assert slacks_s == pytest.approx([0.04] * 3)


def test_whoever_is_due_at_the_same_moment_is_called_in_one_waking_in_order():
    async def story():
        loop = asyncio.get_running_loop()
        timer = PeriodicTimer(loop.time)
        called = []
        for name, period_s in (("quick", 0.02), ("slow", 0.05), ("slowest", 0.1)):
            timer.every(period_s, lambda _late_s, _missed, name=name: called.append((loop.time(), name)))
        task = asyncio.ensure_future(timer.run())
        await asyncio.sleep(0.105)
        task.cancel()
        return called

    called = run_virtual(story())
    assert [name for _, name in called] == ["quick", "quick", "slow", "quick", "quick", "quick", "slow", "slowest"]
    assert called[-1][0] == called[-3][0] == pytest.approx(0.1)


def test_an_error_of_one_ends_it():
    async def story():
        timer = PeriodicTimer(asyncio.get_running_loop().time)

        def fail(_late_s, _missed):
            raise ZeroDivisionError

        timer.every(0.02, fail)
        await timer.run()

    with pytest.raises(ZeroDivisionError):
        run_virtual(story())


def test_who_is_cancelled_ticks_no_more():
    async def story():
        loop = asyncio.get_running_loop()
        timer, times = PeriodicTimer(loop.time), []
        timer.every(0.02, lambda _late_s, _missed: times.append(loop.time()))
        task = asyncio.ensure_future(timer.run())
        await asyncio.sleep(0.05)
        task.cancel()
        await asyncio.sleep(0.1)
        return times

    assert run_virtual(story()) == pytest.approx([0.02, 0.04])
