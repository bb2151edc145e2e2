"""Absolute deadlines: no drift, no burst after a stall."""

import asyncio

import pytest

from runtime.ticker import ticks
from sim.virtual_time import run_virtual


def collect(count, work_s):
    async def story():
        loop = asyncio.get_running_loop()
        times, missed = [], []
        async for tick in ticks(0.1, loop.time):
            times.append(loop.time())
            missed.append(tick.missed)
            await asyncio.sleep(work_s(len(times)))
            if len(times) == count:
                break
        return times, missed

    return run_virtual(story())


def test_no_drift_although_the_work_takes_time():
    times, missed = collect(50, lambda _: 0.03)
    assert times[-1] == pytest.approx(5.0)
    assert sum(missed) == 0


def test_a_stall_is_reported_and_not_replayed():
    times, missed = collect(4, lambda n: 0.55 if n == 2 else 0.0)
    assert times == pytest.approx([0.1, 0.2, 0.75, 0.8])
    assert missed == [0, 0, 4, 0]


def test_a_deadline_may_be_moved_out_of_the_way_and_the_grid_stays():
    async def story():
        loop = asyncio.get_running_loop()
        times, late = [], []
        # The second deadline is wanted 30 ms sooner, the fourth 20 ms later.
        moved = {2: -0.03, 4: 0.02}
        async for tick in ticks(0.1, loop.time, lambda wanted_s: wanted_s + moved.get(round(wanted_s * 10), 0.0)):
            times.append(loop.time())
            late.append(tick.late_s)
            if len(times) == 5:
                break
        return times, late

    times, late = run_virtual(story())
    assert times == pytest.approx([0.1, 0.17, 0.3, 0.42, 0.5])
    assert late == pytest.approx([0.0] * 5)
