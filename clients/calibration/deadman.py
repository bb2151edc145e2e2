"""The deadman of a calibration in a terminal: a key that is held, with the rules of `wallride teleop`."""

import time
from typing import Self

from wallride.clients.calibration.link import LetGoError
from wallride.clients.teleop.sources import KeySource
from wallride.clients.teleop.terminal import Terminal

PERIOD_S = 0.02


class AlwaysHeld:
    """Deadman of an emulated car, which no person has to watch."""

    key, again = "nothing", "It goes on by itself."

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        """Do nothing."""

    def is_held(self) -> bool:
        """Return that it is held."""
        return True

    def wait(self) -> None:
        """Return at once."""

    def renew(self) -> None:
        """Return at once."""


class TerminalDeadman:
    """Shift or M where the terminal reports releases, else a driving key that repeats, as W."""

    def __init__(self) -> None:
        self._terminal = Terminal(time.monotonic, want_releases=True)
        self._keys = KeySource(self._terminal, releases=False)

    def __enter__(self) -> Self:
        self._terminal.__enter__()
        self._keys = KeySource(self._terminal, releases=self._terminal.releases)
        return self

    def __exit__(self, *_: object) -> None:
        self._terminal.__exit__()

    @property
    def key(self) -> str:
        """Return the name of the key."""
        return "M" if self._terminal.releases else "W"

    @property
    def again(self) -> str:
        """Return what the operator does after a stall."""
        return f"Let go, and hold {self.key} again."

    def is_held(self) -> bool:
        """Return whether the key is held; LetGoError for Space, Esc or Ctrl-C, which end the calibration."""
        inputs = self._keys.poll(time.monotonic(), ready=True)
        if self._keys.leaving:
            raise LetGoError("ended by the operator")
        if inputs.wants_stop:
            raise LetGoError("stopped by the operator")
        return inputs.live and inputs.manual

    def wait(self) -> None:
        """Wait until the key is held."""
        while not self.is_held():
            time.sleep(PERIOD_S)

    def renew(self) -> None:
        """Wait until the key was released, and is held again."""
        while self.is_held():
            time.sleep(PERIOD_S)
        self.wait()
