"""The operator's desk at work: a beat for every operator, and a look for the silence that no message announces."""

import math
from collections.abc import Callable
from typing import Never

from drivers.api import Clock, Motor, Reschedule, as_wanted
from runtime.operator_desk import OperatorDesk
from runtime.ticker import ticks


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
    async for _ in ticks(1 / beat_hz, clock, clear_s):
        desk.tick()
        state = motor.state
        publish(desk.beat(state.speed_mps if state is not None else math.nan).pack())
    raise AssertionError("ticks never end")
