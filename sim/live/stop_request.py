"""Ctrl-C in a simulation: the first one is "time is up", the second one kills. Imports nothing, to be there early."""

import signal
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from types import FrameType

NAMES = ("SIGINT", "SIGTERM", "SIGHUP")
"""A closed terminal too: what drives must not outlive the one who watches it."""


class StopRequest:
    """Counts the wishes to end. asked: there was one. killed: there was a second one."""

    def __init__(self) -> None:
        self._count = 0
        self._kill: list[Callable[[], object]] = []
        self._is_guarded = False

    @property
    def asked(self) -> bool:
        """Whether time is up."""
        return self._count > 0

    @property
    def killed(self) -> bool:
        """Whether the orderly end is not waited for."""
        return self._count > 1

    def ask(self) -> None:
        """Ask once; harmless when it was asked already."""
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
        """Call these at the second wish, in place of a KeyboardInterrupt, while the block runs."""
        self._kill, self._is_guarded = list(kill), True
        try:
            yield
        finally:
            self._kill, self._is_guarded = [], False

    def _on_signal(self, _number: int, _frame: FrameType | None) -> None:
        self._count += 1
        if self._count > 1:
            for kill in self._kill:
                kill()
            if not self._is_guarded or self._count > 2:
                raise KeyboardInterrupt


def _numbers() -> list[signal.Signals]:
    return [getattr(signal, name) for name in NAMES if hasattr(signal, name)]
