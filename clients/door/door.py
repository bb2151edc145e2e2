"""The door of a web server: every request passes `refusal`, every WebSocket `visit`."""

import logging
import time
from collections.abc import Awaitable, Callable, Sequence
from typing import Final

from aiohttp import web

from wallride.clients.door.auth import DoorAuth
from wallride.clients.door.connections import MAX_VISITS, lasting, shortened
from wallride.runtime.host.rate_limited_log import RateLimitedLog

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
