"""An event loop in a thread of its own, so that scripts and notebooks need none."""

import asyncio
import atexit
import concurrent.futures
import threading
from collections.abc import Coroutine
from typing import Any, Final, TypeVar
from weakref import WeakSet

from wallride.clients.connection import ConnectionProblemError
from wallride.runtime.ending import end
from wallride.runtime.wire.bus import Bus

T = TypeVar("T")
CLOSED: Final = "this connection was closed; connect again"


class LoopThread:
    """Runs coroutines for callers in other threads; a daemon, so that a script may simply end.

    Then it closes the sessions in its care: a thread of zenoh that waits for an interpreter which has ended aborts the
    process, over the script's own error and exit code.

    is_closed: whether `close` was called; then each call is a ConnectionProblemError.
    """

    def __init__(self) -> None:
        self._loop = asyncio.new_event_loop()
        self._thread = threading.Thread(target=self._loop.run_forever, name="wallride", daemon=True)
        self._thread.start()
        self._sessions: WeakSet[Bus] = WeakSet()
        self._lock = threading.Lock()
        self.is_closed = False
        atexit.register(self.close)

    def look_after(self, bus: Bus) -> Bus:
        """Return an open session, which is closed at the latest with this thread."""
        self._sessions.add(bus)
        return bus

    def check_open(self) -> None:
        """Raise ConnectionProblemError after `close`."""
        if self.is_closed:
            raise ConnectionProblemError(CLOSED)

    def call(self, coroutine: Coroutine[Any, Any, T], *, begins: bool = False) -> T:
        """Run a coroutine to its end and return its result; its errors are raised here.

        begins: a Ctrl-C ends it, not only the wait for it.
        ConnectionProblemError when `close` was called, also in the middle of it from another thread.
        """
        with self._lock:
            if self.is_closed:
                coroutine.close()
            self.check_open()
            result = asyncio.run_coroutine_threadsafe(coroutine, self._loop)
        try:
            return result.result()
        except concurrent.futures.CancelledError:
            self.check_open()
            raise
        except BaseException:
            if begins:
                result.cancel()
            raise

    def close(self) -> None:
        """End all calls, then the sessions, then the thread; harmless when it has ended."""
        with self._lock:
            if self.is_closed:
                return
            self.is_closed = True
        atexit.unregister(self.close)
        asyncio.run_coroutine_threadsafe(self._end_calls(), self._loop).result()
        self._loop.call_soon_threadsafe(self._loop.stop)
        self._thread.join()
        self._loop.close()

    async def _end_calls(self) -> None:
        await end(*(task for task in asyncio.all_tasks() if task is not asyncio.current_task()))
        for bus in tuple(self._sessions):
            await bus.close()
