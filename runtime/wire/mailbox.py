"""Carries what zenoh's threads bring into the event loop."""

import asyncio
import contextlib
import os
from collections import deque
from collections.abc import Callable
from typing import Any

BACKLOG = 256
"""Maximum number of samples of one burst per subscription; the oldest beyond it are dropped, because newer messages
replace older ones."""
MAX_DELIVERIES = 16
"""Maximum deliveries per subscription and turn of the loop. zenoh refills a mailbox as fast as it is emptied: without a
limit a flood of 35,000 commands/s kept the loop from the motor for up to 4 s."""


class Mailbox:
    """Carries calls from zenoh's threads into the loop, in order, with one wake-up per burst.

    A burst is delivered over as many turns of the loop as it needs, so that devices and timers have their turns.
    """

    def __init__(self, loop: asyncio.AbstractEventLoop, deliver: Callable[..., None]) -> None:
        self._loop = loop
        self._deliver = deliver
        self._waiting: deque[tuple[Any, ...]] = deque(maxlen=BACKLOG)
        self._woken = False

    def post(self, arguments: tuple[Any, ...]) -> None:
        """Hand over; called in a foreign thread."""
        self._waiting.append(arguments)
        if not self._woken:
            self._woken = True
            call_in_loop(self._loop, self._drain)

    def _drain(self) -> None:
        try:
            for _ in range(min(MAX_DELIVERIES, len(self._waiting))):
                self._deliver(*self._waiting.popleft())
        finally:  # a receiver that raises loses its message, and not the subscription
            self._woken = False  # before the check: whatever is posted from here on wakes the loop again
            if self._waiting:
                self._woken = True
                self._loop.call_soon(self._drain)


class PromptMailbox:
    """A `Mailbox` whose wake-up is one byte in a pipe, half the time of `call_soon_threadsafe` in cold code.

    The loop takes as many messages as bytes, at most MAX_DELIVERIES in a turn. To be made in the loop.
    """

    def __init__(self, loop: asyncio.AbstractEventLoop, deliver: Callable[..., None]) -> None:
        self._loop, self._deliver = loop, deliver
        self._waiting: deque[tuple[Any, ...]] = deque(maxlen=BACKLOG)
        out, into = os.pipe()
        os.set_blocking(out, False)  # noqa: FBT003
        os.set_blocking(into, False)  # noqa: FBT003 - a full pipe wakes the loop as well
        self._out, self._into = open(out, "rb", buffering=0), open(into, "wb", buffering=0)  # noqa: SIM115 - until `close`
        loop.add_reader(out, self._take)

    def post(self, arguments: tuple[Any, ...]) -> None:
        """Hand over; called in a foreign thread."""
        self._waiting.append(arguments)
        try:  # noqa: SIM105 - `suppress` takes as long as the rest
            self._into.write(b"\0")
        except ValueError:  # it was closed: the session ends
            pass

    def close(self) -> None:
        """End it, in the loop; what is posted from here on is dropped."""
        self._loop.remove_reader(self._out)
        self._out.close()
        self._into.close()

    def _take(self) -> None:
        for _ in self._out.read(MAX_DELIVERIES) or b"":
            if self._waiting:  # else the oldest were dropped
                self._deliver(*self._waiting.popleft())


def call_in_loop(loop: asyncio.AbstractEventLoop, call: Callable[[], object]) -> None:
    """Have the loop call; from any thread."""
    with contextlib.suppress(RuntimeError):  # the loop has closed: there is no listener left
        loop.call_soon_threadsafe(call)
