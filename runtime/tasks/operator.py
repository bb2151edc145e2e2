"""The operator's desk at work: a beat for every operator, and a look for the silence that no message announces."""

import math
from collections.abc import Callable
from typing import Final, Never

from drivers.api import Clock, Motor, Reschedule, as_wanted
from runtime.operator_desk import OperatorDesk
from runtime.ticker import ticks

EVERY_UNHEARD: Final = 3
"""While no operator speaks, only every third beat is sent: enough to see the car and to speak to it, for a third of the
work, and one that is lost is not yet a lost link (0.2 s). From the first command on every beat is sent."""


async def attend(
    desk: OperatorDesk,
    motor: Motor,
    publish: Callable[[bytes], None],
    *,
    beat_hz: float,
    clock: Clock,
    clear_s: Reschedule = as_wanted,
) -> Never:
    """Tick and beat for ever. `publish` sends a beat at once or not at all, and must not wait. clear_s: see `ticks`."""
    unheard = -1  # the first beat at once
    async for _ in ticks(1 / beat_hz, clock, clear_s):
        desk.tick()
        unheard = 0 if desk.is_attended else (unheard + 1) % EVERY_UNHEARD
        if unheard == 0:
            state = motor.state
            publish(desk.beat(state.speed_mps if state is not None else math.nan).pack())
    raise AssertionError("ticks never end")
