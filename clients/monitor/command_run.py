"""Runs a `wallride` command in a process of its own: last in turn for the processor, on one core, bounded, cancellable.

What computes for seconds must not do so in the monitor, whose pages drive, and may be on the car's own computer.
"""

import asyncio
import contextlib
import os
import sys
from collections.abc import Awaitable, Callable, Sequence
from dataclasses import dataclass
from typing import Any, Final

LOWEST_PRIORITY: Final = 19
MAX_ANSWER_B: Final = 64 << 10
"""Maximum length of each of both outputs that is kept: its end."""
ONE_CORE: Final = {"OMP_NUM_THREADS": "1", "OPENBLAS_NUM_THREADS": "1"}
SAID_BY: Final = "wallride: "
"""Beginning of the line in which a command says what the user can correct."""


class CommandFailedError(Exception):
    """A command that did not do what it was run for; the text says why."""


@dataclass(frozen=True, slots=True)
class CommandAnswer:
    """Exit code, standard output and standard error of a command that ended by itself."""

    code: int
    out: str
    err: str

    @property
    def reason(self) -> str:
        """Return why it failed: its own sentence, else its last line, else its exit code."""
        lines = [line.strip() for line in self.err.splitlines() if line.strip()]
        said = [line.removeprefix(SAID_BY) for line in lines if line.startswith(SAID_BY)]
        return (said or lines or [f"it ended with exit code {self.code}"])[-1]


RunCommand = Callable[[Sequence[str], float], Awaitable[CommandAnswer]]
"""Runs `wallride WORDS...` for at most so many seconds."""


async def run_command(words: Sequence[str], within_s: float, program: str = "wallride") -> CommandAnswer:
    """Run `wallride WORDS...`, or another program of Python; kill it where this is cancelled, or after within_s.

    Nothing is imported from the working folder (-P), which may be another user's.

    Raises: CommandFailedError where it does not end in time; OSError where it cannot be started.
    """
    process = await asyncio.create_subprocess_exec(
        sys.executable, "-P", "-m", program, *words, stdin=asyncio.subprocess.DEVNULL, stdout=asyncio.subprocess.PIPE,
        stderr=asyncio.subprocess.PIPE, env={**os.environ, **ONE_CORE}, **_apart(),
    )  # fmt: skip
    try:
        _let_others_go_first(process.pid)
        async with asyncio.timeout(within_s):
            out, err = await asyncio.gather(_end_of(process.stdout), _end_of(process.stderr))
            return CommandAnswer(await process.wait(), out, err)
    except TimeoutError:
        raise CommandFailedError(f"`{program} {words[0]}` did not end within {within_s:.0f} s, and was ended") from None
    finally:
        if process.returncode is None:
            with contextlib.suppress(ProcessLookupError):
                process.kill()
            await process.wait()


async def _end_of(stream: asyncio.StreamReader | None) -> str:
    """Read a stream to its end; return the last MAX_ANSWER_B of it as text."""
    kept = b""
    while stream is not None and (piece := await stream.read(MAX_ANSWER_B)):
        kept = (kept + piece)[-MAX_ANSWER_B:]
    return kept.decode(errors="replace")


def _apart() -> dict[str, Any]:
    """Return what keeps a Ctrl-C of the terminal to the monitor, which then ends the command in order."""
    return {"process_group": 0} if os.name == "posix" else {}


def _let_others_go_first(pid: int) -> None:
    if hasattr(os, "setpriority"):
        with contextlib.suppress(OSError):  # it has ended already
            os.setpriority(os.PRIO_PROCESS, pid, LOWEST_PRIORITY)
