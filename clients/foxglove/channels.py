"""A car's topics as channels of viewers: every topic is offered, a car writes those that a viewer has selected."""

import time
from collections.abc import Callable
from typing import Final

from wallride.runtime.recording.channels import STRING, schema_text, text
from wallride.runtime.ros.definitions import SCHEMA_ENCODING, TYPES
from wallride.runtime.wire import topics
from wallride.runtime.wire.bus import Bus

TEXTS: Final = (topics.STATUS, topics.DECISION)
"""Topics with JSON on zenoh; std_msgs/String here, as in a recording, so that one layout fits both."""
SCHEMAS: Final = tuple({**TYPES, **dict.fromkeys(TEXTS, STRING)}.items())
"""Topic and type by the channel's number, counted from 1."""

Take = Callable[[int, int, bytes], None]
"""Gets a channel's number, the time in ns since 1970, and the message."""


class CarChannels:
    """Passes the messages of one car to every viewer. viewers: what takes them."""

    def __init__(self, bus: Bus, car: str) -> None:
        self.viewers: set[Take] = set()
        self._shown: set[int] = set()
        self._bus = bus
        self._car = car

    def show(self, number: int) -> bool:
        """Subscribe to a channel's topic on the car, once; returns whether there is such a channel."""
        if not 1 <= number <= len(SCHEMAS):
            return False
        if number not in self._shown:
            self._shown.add(number)
            topic = SCHEMAS[number - 1][0]
            wrap = text if topic in TEXTS else bytes
            self._bus.subscribe(
                topics.key(self._car, topic), lambda _k, sample, _s: self._pass_on(number, wrap(sample))
            )
        return True

    def _pass_on(self, number: int, message: bytes) -> None:
        stamp_ns = time.time_ns()
        for take in tuple(self.viewers):
            take(number, stamp_ns, message)


def offered() -> list[dict[str, object]]:
    """Return the channels as a viewer is told of them."""
    return [
        {
            "id": number, "topic": f"/{topic}", "encoding": "cdr", "schemaName": schema,
            "schemaEncoding": SCHEMA_ENCODING, "schema": schema_text(schema),
        }
        for number, (topic, schema) in enumerate(SCHEMAS, 1)
    ]  # fmt: skip
