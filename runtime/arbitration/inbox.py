"""The inbox of a task: the newest value only, and a reader that takes it without a turn of the loop between.

asyncio wakes a task at the loop's next turn, behind whatever else is due there; every scan passes two inboxes. A value
that is put outside any task (in the reader callback of a lidar's port) is taken at once: `put` returns when the reader
waits again. Put by a task, it is taken at the next turn, because tasks do not nest.
"""

import asyncio
from collections.abc import Callable, Generator
from contextvars import Context
from typing import Any, Generic, TypeVar

V = TypeVar("V")

Wake = Callable[["Arrival"], object]


class Inbox(Generic[V]):
    """Holds the newest value only, each taken once: for consumers that must never work through a backlog.

    One reader at a time. Equivalent to a queue with one key, in a quarter of its time.
    """

    def __init__(self) -> None:
        self._newest: V | None = None
        self._arrival: Arrival | None = None

    def put(self, value: V) -> None:
        """Replace the present value, which is never None."""
        self._newest = value
        if self._arrival is not None:
            self._arrival.happen()

    async def get(self) -> V:
        """Take the newest value, waiting for one if need be."""
        while (value := self._newest) is None:
            assert self._arrival is None, "an inbox has one reader"  # noqa: S101 - a bug in the wiring
            self._arrival = Arrival(asyncio.get_running_loop())
            try:
                await self._arrival
            finally:
                self._arrival = None
        self._newest = None
        return value


class Arrival:
    """An event for one task, which goes on inside `happen`.

    A Future-like object of asyncio (`asyncio.isfuture`): the methods are those that a task calls of what it awaits. A
    Future itself tells its end through the loop.
    """

    def __init__(self, loop: asyncio.AbstractEventLoop) -> None:
        self._asyncio_future_blocking = False
        self._loop = loop
        self._waiter: tuple[Wake, Context | None] | None = None
        self._cancelled = False

    def __await__(self) -> Generator["Arrival", None, None]:
        """Wait for the event; a cancelled task gets its CancelledError."""
        self._asyncio_future_blocking = True
        yield self

    def happen(self) -> None:
        """Let the waiting task go on: now, or at the loop's next turn where another task is running."""
        if self._waiter is None:
            return
        wake, context = self._waiter
        self._waiter = None
        if context is None or asyncio.current_task(self._loop) is not None:
            self._loop.call_soon(wake, self, context=context)
        else:
            context.run(wake, self)

    def add_done_callback(self, wake: Wake, *, context: Context | None = None) -> None:
        """Keep what lets the task go on."""
        self._waiter = wake, context

    def cancel(self, msg: Any = None) -> bool:  # noqa: ANN401, ARG002 - the signature of asyncio's
        """End the wait with a cancellation; False where the event has happened."""
        if self._waiter is None:
            return False
        self._cancelled = True
        (wake, context), self._waiter = self._waiter, None
        self._loop.call_soon(wake, self, context=context)
        return True

    def result(self) -> None:
        """Raise the cancellation, if there was one."""
        if self._cancelled:
            raise asyncio.CancelledError

    def get_loop(self) -> asyncio.AbstractEventLoop:
        """Return the loop of the task."""
        return self._loop
