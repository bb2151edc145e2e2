"""The signals that ask this process to end, held against code of the user, which runs in the thread that handles them.

A law, or a library that it imports, may replace a handler, ignore a signal or block it: the car would drive on after
SIGTERM. Whether a handler was changed is asked after each call of the user's code, which takes 1 us. What Python does
not see (C's own signal(), a blocked signal, another wake-up descriptor) is put right once a second.
"""

import signal
from _signal import getsignal  # type: ignore[import-not-found]  # the public one takes 60 times as long
from collections.abc import Callable
from typing import Final

STOP_SIGNALS: Final = tuple(
    getattr(signal, name)
    for name in ("SIGINT", "SIGTERM", "SIGHUP", "SIGQUIT", "SIGUSR1", "SIGUSR2", "SIGALRM", "SIGVTALRM", "SIGXCPU")
    if hasattr(signal, name)
)
"""Signals that end a process and that it can catch: a closed terminal (SIGHUP) and a used up real-time budget (SIGXCPU)
among them. Each is a request to stop."""
_NUMBERS: Final = tuple(int(number) for number in STOP_SIGNALS)


class StopSignals:
    """The handlers of one process. True while they are held, which is false in programs other than a car's."""

    def __init__(self) -> None:
        self._hold: Callable[[], object] | None = None
        self._handlers: list[object] = []
        self._wakeup = -1

    def __bool__(self) -> bool:
        return self._hold is not None

    def hold(self, handle: Callable[[], object]) -> None:
        """Hold the handlers that `handle` puts in place, from now on."""
        self._hold = handle
        handle()
        self._wakeup = signal.set_wakeup_fd(-1)
        self.put_back()

    def take_back(self) -> str:
        """Put handlers in place again that were changed; return the name of the first, "" where none was."""
        if self._hold is None or (now := [*map(getsignal, _NUMBERS)]) == self._handlers:
            return ""
        first = next(each for each, one, ours in zip(STOP_SIGNALS, now, self._handlers, strict=True) if one != ours)
        self.put_back()
        return str(first.name)

    def put_back(self) -> None:
        """Put all in place again, seen or not: handlers, also those of C, the loop's wake-up, and no signal blocked."""
        if self._hold is not None:
            self._hold()
            self._handlers = [*map(getsignal, _NUMBERS)]
            signal.set_wakeup_fd(self._wakeup, warn_on_full_buffer=False)
            signal.pthread_sigmask(signal.SIG_UNBLOCK, STOP_SIGNALS)


STOP_SIGNALS_HELD: Final = StopSignals()
"""Those of this process."""
