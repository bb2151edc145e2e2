"""A command on the car by ssh, with bounds on what it says and on its silence: a car may be taken over, or hang."""

import subprocess
import threading
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import suppress
from types import TracebackType
from typing import IO, Final, Self, cast

MAX_SAID_B: Final = 1 << 20
"""Maximum length of an answer; the facts of a car have a few kB, a list of wheels some ten."""
MAX_LINE_B: Final = 4096


class TooMuchError(Exception):
    """The car said more than an answer has; the command was ended."""


def _nothing() -> None:
    """End nothing: a program on this computer has its pipes alone."""


class CarProcess:
    """A process whose other end is not trusted; ended when it makes no progress for `silent_s`.

    merged: whether its errors are among its lines. disconnect: ends what holds its pipes open when it is killed.
    silent: whether it was ended so. words: what it said on standard error, at most MAX_SAID_B of it.
    """

    def __init__(
        self,
        command: Sequence[str],
        silent_s: float,
        *,
        merged: bool = False,
        disconnect: Callable[[], None] = _nothing,
    ) -> None:
        errors = subprocess.STDOUT if merged else subprocess.PIPE
        self.silent = False
        self._silent_s = silent_s
        self._disconnect = disconnect
        self._process = subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=errors)
        self._out, self._in = cast("IO[bytes]", self._process.stdout), cast("IO[bytes]", self._process.stdin)
        self._words = b""
        self._progress_s = time.monotonic()
        self._ended = threading.Event()
        jobs = [self._end_silent, *(() if merged else (self._hear_errors,))]
        self._helpers = [threading.Thread(target=job, daemon=True) for job in jobs]

    def __enter__(self) -> Self:
        """Begin to watch over it."""
        for helper in self._helpers:
            helper.start()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        """End it, unless it has ended."""
        if error is not None:
            self._stop()
        self.end()

    def write(self, data: bytes) -> int:
        """Write to its standard input; BrokenPipeError when it has ended."""
        written = self._in.write(data)
        self._progress_s = time.monotonic()
        return written

    def close_input(self) -> None:
        """Let it read the end of its input."""
        with suppress(BrokenPipeError):  # then its words say why
            self._in.close()

    def answer(self) -> str:
        """Return all that it prints; TooMuchError when that is more than MAX_SAID_B."""
        said = self._out.read(MAX_SAID_B + 1)
        if len(said) > MAX_SAID_B:
            raise TooMuchError
        return said.decode(errors="replace")

    def lines(self) -> Iterator[str]:
        """Yield its lines as they come, a long one in pieces."""
        while line := self._out.readline(MAX_LINE_B):
            self._progress_s = time.monotonic()
            yield line.decode(errors="replace").rstrip("\n")

    def end(self) -> int:
        """Wait for its end; returns its exit code."""
        self.close_input()
        code = self._process.wait()
        self._ended.set()
        for helper in self._helpers:
            helper.join()
        self._out.close()
        return code

    @property
    def words(self) -> str:
        """Return what it said on standard error."""
        return self._words.decode(errors="replace")

    def _hear_errors(self) -> None:
        pipe = cast("IO[bytes]", self._process.stderr)
        with pipe:
            self._words = pipe.read(MAX_SAID_B)
            while pipe.read(MAX_LINE_B):  # a full pipe would hold it up
                pass

    def _end_silent(self) -> None:
        while not self._ended.wait(min(1.0, self._silent_s / 4)):
            if time.monotonic() - self._progress_s > self._silent_s:
                self.silent = True
                self._stop()
                return

    def _stop(self) -> None:
        self._process.kill()
        self._disconnect()
