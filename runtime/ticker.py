"""Ticks on absolute deadlines, because `sleep(period)` drifts and replays a stall as a burst.

The deadlines are multiples of the period on the clock itself, so that whoever ticks at 50 Hz ticks at the same moment:
waking up costs more than most of what is done then.
"""

import asyncio
from collections.abc import AsyncIterator
from dataclasses import dataclass

from drivers.api import Clock, Reschedule, as_wanted


@dataclass(frozen=True, slots=True)
class Tick:
    """late_s: how much later than wanted the loop woke us; missed: deadlines skipped since the tick before."""

    late_s: float
    missed: int


async def ticks(period_s: float, clock: Clock, clear_s: Reschedule = as_wanted) -> AsyncIterator[Tick]:
    """Yield once per period for ever; after a stall go on with the next deadline, never with the ones missed.

    clear_s: moves a deadline out of the way of something that hurries more (`Cadence.clear_s`).
    """
    deadline_s = (clock() // period_s + 1) * period_s
    while True:
        wanted_s = clear_s(deadline_s)
        await asyncio.sleep(max(0.0, wanted_s - clock()))
        late_s = clock() - wanted_s
        missed = max(0, int(late_s // period_s))
        yield Tick(late_s, missed)
        deadline_s += period_s * (missed + 1)
