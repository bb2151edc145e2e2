"""Listening on a port, for as long as a block runs, and the token in the page's address.

The token is kept until its user logs out or the machine restarts, so that a page that is open on a phone finds the
server again. It lies where only its user can read it ($XDG_RUNTIME_DIR, cleared by the system); without such a place
every start has a secret of its own.
"""

import asyncio
import errno
import os
import re
import secrets
import socket
import stat
from collections.abc import AsyncIterator, Mapping
from contextlib import asynccontextmanager
from pathlib import Path

from aiohttp import web

from wallride.clients.connection import ConnectionProblemError
from wallride.clients.door.door import QUIET, end_idle
from wallride.runtime.ending import end

EVERYWHERE = ("0.0.0.0", "::")  # noqa: S104 - compared with, not listened on
WHY_NOT = {
    errno.EADDRINUSE: "it is taken by another program; choose another with --port",
    errno.EACCES: "you may not use this port; choose another with --port",
    errno.EADDRNOTAVAIL: "this computer has no such address; choose one of its own with --host, or 0.0.0.0 for all",
}
SOMEWHERE = "192.0.2.1"
"""A documentation address (RFC 5737). Nothing is sent to it."""
BYTES = 12
_WORD = re.compile(r"[A-Za-z0-9_-]{16}")


@asynccontextmanager
async def listening(app: web.Application, address: str, port: int, *, any_port: bool = False) -> AsyncIterator[str]:
    """Serve an application while the block runs; yields host and port. ConnectionProblemError when the port is taken.

    any_port: whether another port will do when this one is taken.
    """
    runner = web.AppRunner(app, access_log=None, handler_cancellation=True, shutdown_timeout=2.0, logger=QUIET)
    await runner.setup()
    guard = asyncio.create_task(end_idle(runner))
    try:
        yield await _listen(runner, address, port, any_port=any_port)
    finally:
        await runner.cleanup()  # the pages first: a driving page is stopped while there is still a link
        await end(guard)


async def _listen(runner: web.AppRunner, address: str, port: int, *, any_port: bool) -> str:
    for attempt in (port, 0) if any_port else (port,):
        try:
            await web.TCPSite(runner, address.strip("[]"), attempt).start()
            break
        except OSError as error:
            problem = error
    else:  # Python 3.13 gives no number where the computer has none of the addresses
        why = WHY_NOT.get(problem.errno or errno.EADDRNOTAVAIL, f"{problem.strerror}; choose another with --host")
        raise ConnectionProblemError(f"cannot listen on {address}:{port}: {why}")
    name = _address_here() if address in EVERYWHERE else address.strip("[]")
    return f"{f'[{name}]' if ':' in name else name}:{runner.addresses[0][1]}"


def _address_here() -> str:
    """Return the address under which others probably reach this machine; reads only its routing table."""
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as probe:
        try:
            probe.connect((SOMEWHERE, 9))
        except OSError:
            return socket.gethostname()
        return str(probe.getsockname()[0])


def login_token(command: str = "monitor", environment: Mapping[str, str] = os.environ) -> str:
    """Return the token of this login for a command's server, made at its first use."""
    fresh = secrets.token_urlsafe(BYTES)
    folder = environment.get("XDG_RUNTIME_DIR")
    if not folder:
        return fresh
    path = Path(folder) / file_name(command)
    try:
        descriptor = os.open(path, os.O_WRONLY | os.O_CREAT | os.O_EXCL | os.O_NOFOLLOW | os.O_CLOEXEC, 0o600)
    except FileExistsError:
        return _read(path) or fresh
    except OSError:  # a place that cannot be written to keeps nothing
        return fresh
    with os.fdopen(descriptor, "w") as file:
        file.write(fresh)
    return fresh


def file_name(command: str) -> str:
    """Return the name of the file; each server has a token of its own, because they may do different things."""
    return f"wallride-{command}-secret"


def _read(path: Path) -> str:
    """Return the kept token, "" unless it is valid and readable only by its user."""
    try:
        with os.fdopen(os.open(path, os.O_RDONLY | os.O_NOFOLLOW | os.O_NONBLOCK | os.O_CLOEXEC)) as file:
            about = os.fstat(file.fileno())
            private = stat.S_ISREG(about.st_mode) and about.st_uid == os.geteuid() and not about.st_mode & 0o077
            text = file.read(64) if private else ""
    except OSError:
        return ""
    return text if _WORD.fullmatch(text) else ""
