"""A drive in virtual time, with what happens in it."""

import asyncio
from collections.abc import Callable, Sequence
from typing import Any

from wallride.runtime.app import Car


async def drive_for(seconds: float, car: Car, it: Any, events: Sequence[tuple[float, Callable[[Any], object]]]) -> None:
    """Connect and drive; each event is called with `it` at its time."""
    loop, stop = asyncio.get_running_loop(), asyncio.Event()
    car.connect()
    for at_s, event in events:
        loop.call_at(at_s, event, it)
    loop.call_at(seconds, stop.set)
    await car.drive(stop)
