"""Off the hot path: takes what the control tasks left in the outbox, writes JSON, publishes."""

from collections.abc import Callable, Mapping
from typing import Any, Never, Protocol

from drivers.api import Clock
from runtime import wire
from runtime.queues import PriorityQueue
from runtime.ticker import ticks

Outbox = PriorityQueue[str, Mapping[str, Any]]
"""One slot per topic: what a slow bus did not take is replaced by the newer, never piled up."""


class Publisher(Protocol):
    """Where bytes go; the bus on the car, a list in tests."""

    def put(self, key: str, payload: bytes) -> None:
        """Publish without waiting."""
        ...


async def publish(outbox: Outbox, bus: Publisher, car: str) -> Never:
    """Send whatever is newest, most important first."""
    while True:
        topic, message = await _next(outbox)
        bus.put(wire.key(car, topic), wire.encode(message))


async def report_status(
    bus: Publisher, car: str, snapshot: Callable[[], Mapping[str, Any]], rate_hz: float, clock: Clock
) -> Never:
    """Send the status at a steady rate, also in silence: it answers "why is it not moving"."""
    async for _ in ticks(1 / rate_hz, clock):
        bus.put(wire.key(car, wire.STATUS), wire.encode(snapshot()))
    raise AssertionError("ticks never end")


async def _next(outbox: Outbox) -> tuple[str, Mapping[str, Any]]:
    message = await outbox.get()
    return str(message["topic"]), message
