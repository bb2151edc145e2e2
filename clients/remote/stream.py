"""Bounded iterators over arriving messages, for `for` and `async for` alike. Filled by one thread, read by another."""

import asyncio
import contextlib
import threading
import time
from collections import deque
from collections.abc import AsyncIterator, Callable, Iterator
from typing import Generic, TypeVar

from wallride.clients.connection import ConnectionProblemError

T = TypeVar("T")
Raw = tuple[str, bytes, float]
"""Topic, payload, arrival in seconds since 1970."""


class Stream(Generic[T]):
    """Yields messages in the order of their arrival; without an end, until `close`.

    read: turns an arrival into what is yielded; called in the reader's thread. buffer: maximum number of waiting
    messages; the oldest beyond it are dropped and counted in `dropped`. timeout_s: maximum wait for one, then a
    ConnectionProblemError with `silent` as its text.
    """

    def __init__(self, read: Callable[[Raw], T], *, buffer: int, timeout_s: float, silent: str) -> None:
        self._read = read
        self._timeout_s = timeout_s
        self._silent = silent
        self._waiting: deque[Raw] = deque(maxlen=buffer)
        self._changed = threading.Condition()
        self._waiters: list[tuple[asyncio.AbstractEventLoop, asyncio.Future[None]]] = []
        self._closed = False
        self.dropped = 0

    def put(self, raw: Raw) -> None:
        """Add a message."""
        with self._changed:
            self.dropped += len(self._waiting) == self._waiting.maxlen
            self._waiting.append(raw)
            self._wake()

    def close(self) -> None:
        """End the iteration after the messages that wait."""
        with self._changed:
            self._closed = True
            self._wake()

    def __iter__(self) -> Iterator[T]:
        return self

    def __next__(self) -> T:
        until_s = time.monotonic() + self._timeout_s
        with self._changed:
            while not self._waiting:
                if self._closed:
                    raise StopIteration
                if not self._changed.wait(max(0.0, until_s - time.monotonic())) and time.monotonic() >= until_s:
                    raise ConnectionProblemError(self._silent)
            raw = self._waiting.popleft()
        return self._read(raw)

    def __aiter__(self) -> AsyncIterator[T]:
        return self

    async def __anext__(self) -> T:
        try:
            async with asyncio.timeout(self._timeout_s):
                while (raw := self._take()) is None:
                    await self._news()
        except TimeoutError:
            raise ConnectionProblemError(self._silent) from None
        return self._read(raw)

    def _take(self) -> Raw | None:
        with self._changed:
            if self._waiting:
                return self._waiting.popleft()
            if self._closed:
                raise StopAsyncIteration
            return None

    def _news(self) -> asyncio.Future[None]:
        loop = asyncio.get_running_loop()
        waiter: asyncio.Future[None] = loop.create_future()
        with self._changed:
            if self._waiting or self._closed:
                waiter.set_result(None)
            else:
                self._waiters.append((loop, waiter))
        return waiter

    def _wake(self) -> None:
        self._changed.notify_all()
        waiters, self._waiters = self._waiters, []
        for loop, waiter in waiters:
            with contextlib.suppress(RuntimeError):  # that loop has ended, and its reader with it
                loop.call_soon_threadsafe(_finish, waiter)


def _finish(waiter: asyncio.Future[None]) -> None:
    if not waiter.done():
        waiter.set_result(None)
