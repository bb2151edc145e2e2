"""Terminal access: keys without Enter and without echo, on POSIX and on Windows, restored afterwards."""

import contextlib
import os
import signal
import sys
from collections.abc import Callable
from typing import Any

from wallride.clients.teleop import key_bytes
from wallride.clients.teleop.key_bytes import KeyBytes
from wallride.clients.teleop.keyboard import KeyEvent, Quit, TerminalAnswer

ANSWER_TIMEOUT_S = 0.3
ASK_PERIOD_S = 0.2

if sys.platform == "win32":
    import msvcrt

    WINDOWS_ARROWS = {"H": b"\x1b[A", "P": b"\x1b[B", "M": b"\x1b[C", "K": b"\x1b[D"}

    class WindowsConsole:
        """Raw keys of a Windows console."""

        def open(self) -> None:
            """Do nothing: getwch neither waits for Enter nor echoes."""

        def close(self) -> None:
            """Do nothing."""

        def read(self, timeout_s: float = 0.0) -> bytes | None:  # noqa: ARG002 - the other console waits
            """Return the typed bytes; the console reports no releases, so no answer has to be awaited."""
            chunk = b""
            while msvcrt.kbhit():
                character = msvcrt.getwch()
                if character in {"\x00", "\xe0"}:
                    chunk += WINDOWS_ARROWS.get(msvcrt.getwch(), b"")
                else:
                    chunk += character.encode(errors="ignore")
            return chunk

    Console = WindowsConsole
else:
    import select
    import termios
    import tty

    class PosixConsole:
        """Raw keys of a POSIX terminal."""

        def __init__(self) -> None:
            self._fd = sys.stdin.fileno()
            self._before: list[Any] | None = None

        def open(self) -> None:
            """Take keys one by one, without echo; Ctrl-C stays a signal. A shell has set its own mode after Ctrl-Z."""
            self._before = termios.tcgetattr(self._fd)
            self._take_keys()
            signal.signal(signal.SIGCONT, self._take_keys)

        def close(self) -> None:
            """Put everything back."""
            signal.signal(signal.SIGCONT, signal.SIG_DFL)
            if self._before is not None:
                with contextlib.suppress(termios.error, OSError):  # the terminal may be gone
                    termios.tcsetattr(self._fd, termios.TCSADRAIN, self._before)

        def read(self, timeout_s: float = 0.0) -> bytes | None:
            """Return the typed bytes, b"" without any, None when the terminal is gone."""
            ready, _, _ = select.select([self._fd], [], [], timeout_s)
            if not ready:
                return b""
            try:
                return os.read(self._fd, 4096) or None
            except OSError:
                return None

        def _take_keys(self, *_: object) -> None:
            with contextlib.suppress(termios.error, OSError):
                tty.setcbreak(self._fd)

    Console = PosixConsole


class Terminal:
    """Key events of the terminal of this process. releases: it reports when a key goes up.

    want_releases: ask the terminal for kitty's protocol, which those that do not know it ignore.
    """

    def __init__(self, clock: Callable[[], float], *, want_releases: bool) -> None:
        self._clock = clock
        self._want_releases = want_releases
        self._console = Console()
        self._bytes = KeyBytes()
        self._asked_s = 0.0
        self.releases = False

    def __enter__(self) -> "Terminal":
        self._console.open()
        if self._want_releases and self._flags() is not None:
            _write(key_bytes.ENTER)
            self.releases = (self._flags() or 0) & key_bytes.RELEASES == key_bytes.RELEASES
            if not self.releases:
                _write(key_bytes.LEAVE)
        return self

    def __exit__(self, *_: object) -> None:
        if self.releases:
            _write(key_bytes.LEAVE)
        self._console.close()

    def poll(self) -> list[KeyEvent]:
        """Return the events since the last call; the loss of the terminal is a request to quit."""
        now_s = self._clock()
        if self.releases and now_s - self._asked_s >= ASK_PERIOD_S:
            self._asked_s = now_s
            _write(key_bytes.ASK)
        chunk = self._console.read()
        if chunk is None:
            return [Quit()]
        return self._bytes.feed(chunk, now_s)

    def _flags(self) -> int | None:
        """Return what the terminal grants of kitty's protocol, None without an answer."""
        _write(key_bytes.ASK)
        give_up_s = self._clock() + ANSWER_TIMEOUT_S
        while (left_s := give_up_s - self._clock()) > 0:
            chunk = self._console.read(left_s)
            if not chunk:
                return None
            for event in self._bytes.feed(chunk, self._clock()):
                if isinstance(event, TerminalAnswer):
                    return event.flags
        return None


def is_there() -> bool:
    """Return whether keys can be read at all."""
    return sys.stdin is not None and sys.stdin.isatty()


def _write(sequence: bytes) -> None:
    """Send a control sequence; the loss of the terminal shows at the next read."""
    with contextlib.suppress(OSError, ValueError):
        sys.stdout.flush()
        os.write(sys.stdout.fileno(), sequence)
