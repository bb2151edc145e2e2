"""An event loop in a thread of its own, so that scripts and notebooks need none."""

import asyncio
import atexit
import threading
from collections.abc import Coroutine
from typing import Any, TypeVar
from weakref import WeakSet

from runtime.wire.bus import Bus

T = TypeVar("T")


class LoopThread:
    """Runs coroutines for callers in other threads; a daemon, so that a script may simply end.

    Then it closes the sessions in its care: a thread of zenoh that waits for an interpreter which has ended aborts the
    process, over the script's own error and exit code.
    """

    def __init__(self) -> None:
        self._loop = asyncio.new_event_loop()
        self._thread = threading.Thread(target=self._loop.run_forever, name="wallride", daemon=True)
        self._thread.start()
        self._sessions: WeakSet[Bus] = WeakSet()
        atexit.register(self._end)

    def look_after(self, bus: Bus) -> Bus:
        """Return an open session, which is closed at the latest when the interpreter ends."""
        self._sessions.add(bus)
        return bus

    def call(self, coroutine: Coroutine[Any, Any, T]) -> T:
        """Run a coroutine to its end and return its result; its errors are raised here."""
        return asyncio.run_coroutine_threadsafe(coroutine, self._loop).result()

    def close(self) -> None:
        """End the loop and its thread; harmless when it has ended."""
        atexit.unregister(self._end)
        if self._thread.is_alive():
            self._loop.call_soon_threadsafe(self._loop.stop)
            self._thread.join()
            self._loop.close()

    def _end(self) -> None:
        for bus in tuple(self._sessions):
            bus.close_now()
        self.close()
