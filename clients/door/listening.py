"""Listening on a port, for as long as a block runs."""

import asyncio
import errno
import socket
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager

from aiohttp import web

from wallride.clients.connection import ConnectionProblemError
from wallride.clients.door.connections import QUIET, end_idle
from wallride.runtime.ending import end

EVERYWHERE = ("0.0.0.0", "::")  # noqa: S104 - compared with, not listened on
WHY_NOT = {
    errno.EADDRINUSE: "it is taken by another program; choose another with --port",
    errno.EACCES: "you may not use this port; choose another with --port",
    errno.EADDRNOTAVAIL: "this computer has no such address; choose one of its own with --host, or 0.0.0.0 for all",
}
SOMEWHERE = "192.0.2.1"
"""A documentation address (RFC 5737). Nothing is sent to it."""


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
