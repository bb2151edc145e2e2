"""The door of a web server: every request passes `refusal`, every WebSocket `visit`.

aiohttp waits for the rest of a request without an end. So the number of connections is bounded, and every one that is
not a page with the token is closed after IDLE_S, in whatever state it is; a browser opens another when it needs it.
"""

import asyncio
import logging
import time
from collections.abc import Awaitable, Callable, Iterator, Sequence
from contextlib import contextmanager
from typing import Final, Never

from aiohttp import web

from wallride.clients.door.auth import DoorAuth
from wallride.runtime.host.rate_limited_log import RateLimitedLog
from wallride.runtime.host.terminal_text import one_line

PING_EVERY_S: Final = 5.0
"""Period of pings; the socket of a phone out of reach is closed after this and a half."""
ONLY_FROM_HERE = (
    "default-src 'none'; script-src 'self'; style-src 'self'; img-src 'self' data:; connect-src 'self';"
    " manifest-src 'self'; base-uri 'none'; form-action 'none'; frame-ancestors 'none'"
)
HEADERS = {
    "Content-Security-Policy": ONLY_FROM_HERE,
    "X-Content-Type-Options": "nosniff",
    "Referrer-Policy": "no-referrer",
    "Cross-Origin-Opener-Policy": "same-origin",
    "Cross-Origin-Resource-Policy": "same-origin",
    "Cache-Control": "no-cache",
}
"""Headers against requests to other hosts and frames of other sites (which could have STOP clicked, or Drive)."""
IDLE_S: Final = 10.0
MAX_CONNECTIONS: Final = 64
MAX_VISITS: Final = 24
LOOK_EVERY_S: Final = 0.25
SHOWN_CHARACTERS: Final = 100
QUIET: Final = logging.getLogger("wallride.monitor.http")
"""Where aiohttp says what it thinks of a request: to no one, because anyone can make it say so."""
QUIET.disabled = True

_PAGES: set[asyncio.BaseProtocol] = set()


class Door:
    """visits: the open WebSockets. longest: maximum length of a message from outside, in bytes.

    protocols: of the WebSockets, one of which a program must offer; none when it is empty.
    """

    def __init__(self, auth: DoorAuth, log: logging.Logger, *, longest: int, protocols: Sequence[str] = ()) -> None:
        self.auth = auth
        self.visits: set[web.WebSocketResponse] = set()
        self._log = log
        self._refusals = RateLimitedLog(log, time.monotonic)
        self._longest = longest
        self._protocols = tuple(protocols)

    def refusal(self, request: web.Request, *, token: str | None = None) -> web.Response | None:
        """Return the answer to a request that is turned away, None when it may come in. token: instead of its own."""
        shown = request.query.get("token", "") if token is None else token
        objection = self.auth.objection(request.host, shown)
        return self.answer(403, objection) if objection else None

    def answer(self, status: int, words: str) -> web.Response:
        """Return an answer in words."""
        text = f"wallride {self.auth.command}: {words}\n"
        return web.Response(status=status, text=text, headers=HEADERS)

    async def visit(
        self, request: web.Request, serve: Callable[[web.WebSocketResponse], Awaitable[None]]
    ) -> web.StreamResponse:
        """Open a WebSocket for a request that may come in, and serve it."""
        origin, token = request.headers.get("Origin"), request.query.get("token", "")
        if objection := self.auth.socket_objection(request.host, origin, token):
            page = shortened(origin or "") or "none"
            words = f"turned away a WebSocket from {request.remote}, origin {page}: {objection}"
            self._refusals.log("refused", words)
            return self.answer(403, objection)
        if len(self.visits) >= MAX_VISITS:
            return self.answer(503, "too many pages are open")
        socket = web.WebSocketResponse(
            heartbeat=PING_EVERY_S, compress=False, max_msg_size=self._longest, protocols=self._protocols
        )
        if self._protocols and socket.can_prepare(request).protocol is None:
            return self.answer(400, f"the program must speak {' or '.join(self._protocols)}")
        self.visits.add(socket)
        try:
            await socket.prepare(request)
            with lasting(request):
                await serve(socket)
        except ConnectionError:
            self._log.debug("a page went away")
        finally:
            self.visits.discard(socket)
        return socket


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
