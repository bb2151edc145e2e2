"""Measures how long a link takes, there and back, also while this client does not operate the car.

A heartbeat that arrives every 20 ms may be seconds old: it waited in queues with all those before it. Only the car's
answer to a question of ours tells. The car's patience with commands comes with it.
"""

import asyncio
import json
import math
import time
from collections.abc import Awaitable, Callable
from typing import Any, Final, Never

from wallride.runtime.wire import topics
from wallride.runtime.wire.network import RefusedError

EVERY_S: Final = 0.5
WITHIN_S: Final = 3.0
PATIENCE: Final = "operator.expiry_s"
QUESTION: Final = json.dumps({"names": [PATIENCE]}).encode()

Ask = Callable[[bytes], Awaitable[list[bytes]]]


class LinkProbe:
    """Asks the car again and again. patience_s: lifetime of a command at this car, NaN until it has said so."""

    def __init__(self, ask: Ask, clock: Callable[[], float] = time.monotonic) -> None:
        self._ask = ask
        self._clock = clock
        self._took_s = math.nan
        self._asked_s: float | None = None
        self.patience_s = math.nan

    def takes_s(self, now_s: float) -> float:
        """Return the round trip: that of the last answer, or the time since a question that is open; NaN before."""
        open_s = now_s - self._asked_s if self._asked_s is not None else 0.0
        return max(open_s, self._took_s) if math.isfinite(self._took_s) else math.nan

    async def run(self) -> Never:
        """Measure until cancelled."""
        while True:
            await self.measure()
            await asyncio.sleep(EVERY_S)

    async def measure(self) -> None:
        """Ask once. A car that may not answer this certificate leaves the round trip unknown."""
        since_s = self._clock()
        self._asked_s = since_s if self._asked_s is None else self._asked_s  # without an answer it waits on
        try:
            answers = await self._ask(QUESTION)
        except (OSError, TimeoutError, RefusedError):
            answers = []
        if answers:
            self._took_s, self._asked_s = self._clock() - since_s, None
            self.patience_s = _patience_s(answers[0], self.patience_s)


def _patience_s(answer: bytes, known_s: float) -> float:
    try:
        value: Any = topics.decode(answer)["values"][PATIENCE]
        return float(value)
    except (ValueError, TypeError, KeyError):
        return known_s
