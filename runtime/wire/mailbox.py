"""Carries what zenoh's threads bring into the event loop."""

import asyncio
import contextlib
import os
from collections import deque
from collections.abc import Callable
from io import FileIO
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
            self._wake()

    def _wake(self) -> None:
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


class PromptMailbox(Mailbox):
    """A mailbox that wakes the loop by a byte in a pipe, in half the time of `call_soon_threadsafe` in cold code.

    To be made and closed in the loop; what is posted after `close` is dropped.
    """

    def __init__(self, loop: asyncio.AbstractEventLoop, deliver: Callable[..., None]) -> None:
        super().__init__(loop, deliver)
        out, into = os.pipe()
        self._out, self._into = FileIO(out, "r"), FileIO(into, "w")
        loop.add_reader(self._out, self._awake)

    def close(self) -> None:
        """End it; as files, its descriptors are not written to once their numbers are those of others."""
        self._loop.remove_reader(self._out)
        self._into.close()
        self._out.close()

    def _wake(self) -> None:
        try:  # noqa: SIM105 - `suppress` takes as long as the rest
            self._into.write(b"\0")
        except ValueError:  # closed
            pass

    def _awake(self) -> None:
        self._out.read(1)
        self._drain()


def call_in_loop(loop: asyncio.AbstractEventLoop, call: Callable[[], object]) -> None:
    """Have the loop call; from any thread."""
    with contextlib.suppress(RuntimeError):  # the loop has closed: there is no listener left
        loop.call_soon_threadsafe(call)
