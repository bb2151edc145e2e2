"""A drive in virtual time, with what happens in it."""

import asyncio
from collections.abc import Callable, Sequence
from typing import Any

from wallride.runtime.app import Car


async def drive_for(seconds: float, car: Car, it: Any, events: Sequence[tuple[float, Callable[[Any], object]]]) -> None:
    """Connect and drive; each event is called with `it` at its time. What an event raises ends the drive."""
    loop, stop = asyncio.get_running_loop(), asyncio.Event()
    failed: list[BaseException] = []

    def happen(event: Callable[[Any], object]) -> None:
        try:
            event(it)
        except BaseException as error:  # noqa: BLE001 - a loop would only log it
            failed.append(error)
            stop.set()

    car.connect()
    for at_s, event in events:
        loop.call_at(at_s, happen, event)
    loop.call_at(seconds, stop.set)
    await car.drive(stop)
    if failed:
        raise failed[0]
