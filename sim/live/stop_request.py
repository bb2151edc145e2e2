"""Ctrl-C in a simulation: the first one ends the time, the second one kills. Imports nothing, to be available early."""

import signal
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from types import FrameType

NAMES = ("SIGINT", "SIGTERM", "SIGHUP")
"""Names of the signals, a closed terminal's too: the car must not outlive the observer."""


class StopRequest:
    """Counts the stop requests. asked: there was one. killed: there was a second one."""

    def __init__(self) -> None:
        self._count = 0
        self._kill: list[Callable[[], object]] = []
        self._is_loading = False

    @property
    def asked(self) -> bool:
        """Return whether a stop was requested."""
        return self._count > 0

    @property
    def killed(self) -> bool:
        """Return whether the orderly end is skipped."""
        return self._count > 1

    def ask(self) -> None:
        """Request a stop; idempotent."""
        self._count = max(1, self._count)

    @contextmanager
    def listening(self) -> Iterator[None]:
        """Count signals while the block runs."""
        before = {number: signal.getsignal(number) for number in _numbers()}
        for number in before:
            signal.signal(number, self._on_signal)
        try:
            yield
        finally:
            for number, handler in before.items():
                signal.signal(number, handler)

    @contextmanager
    def killing(self, *kill: Callable[[], object]) -> Iterator[None]:
        """Call these at the second request, in place of a KeyboardInterrupt, while the block runs."""
        self._kill += kill
        try:
            yield
        finally:
            for one in kill:
                self._kill.remove(one)

    @contextmanager
    def loading(self) -> Iterator[None]:
        """Let the first request end the block at once, by KeyboardInterrupt: nothing drives yet."""
        self._is_loading = True
        try:
            yield
        finally:
            self._is_loading = False

    def _on_signal(self, _number: int, _frame: FrameType | None) -> None:
        self._count += 1
        if self._is_loading:
            raise KeyboardInterrupt
        if self._count > 1:
            for kill in self._kill:
                kill()
            if not self._kill or self._count > 2:
                raise KeyboardInterrupt


def _numbers() -> list[signal.Signals]:
    return [getattr(signal, name) for name in NAMES if hasattr(signal, name)]
