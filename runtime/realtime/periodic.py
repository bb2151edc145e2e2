"""Periodic calls on absolute deadlines, because `sleep(period)` drifts and replays a stall as a burst.

The first deadlines are multiples of their periods on the clock itself, and every job whose deadline has come is called
in one wake-up of the loop: a wake-up, and a task of its own, cost more than most of the jobs.
"""

import asyncio
import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Final, Never

from wallride.drivers.api import Clock, Reschedule, as_wanted

Tick = Callable[[float, int], None]
"""late_s: delay of the wake-up after the deadline; missed: deadlines skipped since the last tick."""

TOGETHER_S: Final = 0.001
"""Maximum distance of deadlines that share one wake-up."""
SLACK_SHARE: Final = 0.4
"""Share of its period by which a tick may come sooner or later."""


@dataclass(slots=True)
class _Ticked:
    period_s: float
    deadline_s: float
    tick: Tick


class PeriodicTimer:
    """Ticks for every job added with `every`; an error of one of them ends `run`.

    clear_s: moves a deadline to a better moment (`ScanPhase.clear_s`); the next one is a period later than that.
    """

    def __init__(self, clock: Clock, clear_s: Reschedule = as_wanted) -> None:
        self._clock = clock
        self._clear_s = clear_s
        self._ticked: list[_Ticked] = []
        self._next_s = math.inf

    def every(self, period_s: float, tick: Tick) -> None:
        """Call `tick` once per period from `run` on; after a stall once, and never for the missed deadlines."""
        deadline_s = (self._clock() // period_s + 1) * period_s
        self._next_s = min(self._next_s, deadline_s)
        self._ticked.append(_Ticked(period_s, deadline_s, tick))

    async def run(self) -> Never:
        """Tick in a loop; within one wake-up in the order of `every`.

        Uses the loop's timer itself: a task that sleeps costs one more turn of the loop per wake-up.
        """
        loop = asyncio.get_running_loop()
        over: asyncio.Future[Never] = loop.create_future()
        timer: asyncio.TimerHandle | None = None

        def strike() -> None:
            nonlocal timer
            try:
                self._tick()
                timer = loop.call_later(max(0.0, self._next_s - self._clock()), strike)
            except Exception as error:
                if over.done():  # cancelled just now
                    raise
                over.set_exception(error)

        timer = loop.call_later(max(0.0, self._next_s - self._clock()), strike)
        try:
            await over
        finally:
            timer.cancel()

    def _tick(self) -> None:
        now_s = self._clock()
        until_s, next_s = max(self._next_s + TOGETHER_S, now_s), math.inf
        for ticked in self._ticked:
            if ticked.deadline_s <= until_s:
                late_s = max(0.0, now_s - ticked.deadline_s)
                missed = int(late_s // ticked.period_s)
                wanted_s = ticked.deadline_s + ticked.period_s * (missed + 1)
                ticked.deadline_s = self._clear_s(wanted_s, SLACK_SHARE * ticked.period_s)
                ticked.tick(late_s, missed)
            if ticked.deadline_s < next_s:
                next_s = ticked.deadline_s
        self._next_s = next_s
