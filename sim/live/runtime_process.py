"""The unmodified runtime as a child process: started, monitored, and stopped as by systemd."""

import asyncio
import ctypes
import math
import os
import signal
import sys
from collections import deque
from collections.abc import Sequence
from pathlib import Path

WALLRIDE = (sys.executable, "-P", "-m", "wallride")
"""The command, which takes no modules from the working folder: `signal.py` there may be a student's."""
STOP_TIMEOUT_S = 20.0
"""Timeout of a stop: closing a recording on a busy computer with a slow disk takes seconds."""
REMEMBERED_LINES = 400
_LIBC = ctypes.CDLL(None) if sys.platform == "linux" else None
_PR_SET_PDEATHSIG = 1


class WallrideProcess:
    """A `wallride` command with its log captured.

    log: the last lines that it printed.
    exit_code: None while it runs.
    """

    def __init__(self, arguments: Sequence[str], program: Sequence[str] = WALLRIDE) -> None:
        self._command = [*program, *arguments]
        self._process: asyncio.subprocess.Process | None = None
        self._reader: asyncio.Task[None] | None = None
        self.log: deque[str] = deque(maxlen=REMEMBERED_LINES)

    @property
    def pid(self) -> int:
        """Return the process id, once started."""
        assert self._process is not None, "start() first"  # noqa: S101 - a bug in the caller
        return self._process.pid

    @property
    def exit_code(self) -> int | None:
        """Return the exit code, None while it runs."""
        return self._process.returncode if self._process is not None else None

    async def start(self) -> None:
        """Start the process."""
        self._process = await asyncio.create_subprocess_exec(
            *self._command,
            stdin=asyncio.subprocess.DEVNULL,
            stdout=asyncio.subprocess.PIPE,
            stderr=asyncio.subprocess.STDOUT,
            process_group=0,  # Ctrl-C of the terminal is for the parent, which then stops the child in order
            preexec_fn=_end_with_parent if _LIBC is not None else None,
        )
        self._reader = asyncio.create_task(self._read_log(), name="runtime log")

    def kill(self, number: signal.Signals = signal.SIGKILL) -> None:
        """Send a signal."""
        if self._process is not None and self._process.returncode is None:
            self._process.send_signal(number)

    async def wait(self) -> int:
        """Wait for the end and return the exit code."""
        assert self._process is not None, "start() first"  # noqa: S101 - a bug in the caller
        code = await self._process.wait()
        if self._reader is not None:
            await self._reader
        return code

    async def stop(self) -> int:
        """Request a stop (SIGTERM); kill it after a timeout. Returns the exit code."""
        self.kill(signal.SIGTERM)
        try:
            async with asyncio.timeout(STOP_TIMEOUT_S):
                return await self.wait()
        except TimeoutError:
            self.kill(signal.SIGKILL)
            return await self.wait()

    async def end(self) -> None:
        """Kill the process and wait for its end; does nothing if it never started."""
        if self._process is not None:
            self.kill()
            await self.wait()

    async def _read_log(self) -> None:
        assert self._process is not None  # noqa: S101 - only start() calls this
        assert self._process.stdout is not None  # noqa: S101 - it was asked for
        async for line in self._process.stdout:
            self.log.append(line.decode(errors="replace").rstrip())


class RuntimeProcess(WallrideProcess):
    """`wallride run`."""

    def __init__(
        self,
        config: Path,
        assignments: Sequence[str],
        options: Sequence[str] = (),
        program: Sequence[str] = WALLRIDE,
    ) -> None:
        settings = [argument for assignment in assignments for argument in ("--set", assignment)]
        super().__init__(["run", str(config), *settings, *options], program)


def cpu_s_of(pid: int) -> float:
    """Return the processor time that a process has used [s]; NaN where the system does not tell."""
    try:
        fields = Path(f"/proc/{pid}/stat").read_text(encoding="utf-8").rpartition(")")[2].split()
        return (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")
    except (OSError, ValueError, IndexError):
        return math.nan


def _end_with_parent() -> None:
    """Make the kernel end this process when its parent is gone, however that ended."""
    if _LIBC is not None:
        _LIBC.prctl(_PR_SET_PDEATHSIG, signal.SIGTERM)
