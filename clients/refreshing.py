"""A screen that is drawn again and again: in place on a terminal; elsewhere one line a second, without codes."""

import math
import sys
import time
from collections.abc import Callable

from wallride.runtime.host.terminal_text import CLEAR_SCREEN

LINE_EVERY_S = 1.0


class RefreshedScreen:
    """print_line: as of a command's options. is_terminal: None for what standard output is."""

    def __init__(
        self,
        print_line: Callable[[str], object],
        *,
        is_terminal: bool | None = None,
        clock: Callable[[], float] = time.monotonic,
    ) -> None:
        self._print_line = print_line
        self._is_terminal = sys.stdout.isatty() if is_terminal is None else is_terminal
        self._clock = clock
        self._said_s = -math.inf

    def show(self, screen: str, line: str) -> None:
        """Draw the screen; into a pipe or a file say the line, at most once a second."""
        if self._is_terminal:
            self._print_line(CLEAR_SCREEN + screen)
        elif (now_s := self._clock()) - self._said_s >= LINE_EVERY_S:
            self._said_s = now_s
            self._print_line(line)
