"""Bounds on connections to the web server: how many there are, and how long one lasts that is no page.

aiohttp waits for the rest of a request without an end. Every connection that is not a page with the token is closed
after IDLE_S, in whatever state it is; a browser opens another one when it needs it.
"""

import asyncio
import logging
import time
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Final, Never

from aiohttp import web

from wallride.runtime.host.terminal_text import one_line

IDLE_S: Final = 10.0
MAX_CONNECTIONS: Final = 64
MAX_VISITS: Final = 24
LOOK_EVERY_S: Final = 0.25
SHOWN_CHARACTERS: Final = 100
QUIET: Final = logging.getLogger("wallride.monitor.http")
"""Where aiohttp says what it thinks of a request: to no one, because anyone can make it say so."""
QUIET.disabled = True

_PAGES: set[asyncio.BaseProtocol] = set()


@contextmanager
def lasting(request: web.Request) -> Iterator[None]:
    """Let a connection last for this block: it is a page, which has shown the token."""
    _PAGES.add(request.protocol)
    try:
        yield
    finally:
        _PAGES.discard(request.protocol)


async def end_idle(runner: web.AppRunner) -> Never:
    """Close what has been open for too long without being a page, and the oldest of what is too many."""
    since_s: dict[asyncio.BaseProtocol, float] = {}
    while True:
        await asyncio.sleep(LOOK_EVERY_S)
        now_s = time.monotonic()
        server = runner.server
        others = [one for one in (server.connections if server is not None else ()) if one not in _PAGES]
        since_s = {one: since_s.get(one, now_s) for one in others}
        others.sort(key=since_s.__getitem__)
        too_many = max(0, len(others) - MAX_CONNECTIONS)
        for i, one in enumerate(others):
            if i < too_many or now_s - since_s[one] > IDLE_S:
                one.force_close()


def shortened(text: str) -> str:
    """Return what a stranger wrote, as it may stand in a log."""
    return one_line(text, SHOWN_CHARACTERS)
