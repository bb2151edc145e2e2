"""`wallride monitor`: the web server. Serves the page, and one WebSocket per page; knows nothing about cars itself."""

import argparse
import asyncio
import contextlib
import errno
import logging
import signal
import socket
import time
import webbrowser
from collections.abc import AsyncIterator, Callable, Sequence
from contextlib import asynccontextmanager
from importlib.metadata import version
from pathlib import Path

from aiohttp import web

from clients.connection import ConnectionProblemError, endpoint_configs
from clients.monitor import assets
from clients.monitor.auth import PageAuth, is_loopback, page_auth
from clients.monitor.connections import MAX_PAGES, QUIET, end_idle, lasting, shortened
from clients.monitor.handover import handed_over
from clients.monitor.messages import LONGEST
from clients.monitor.qr import qr_lines
from clients.monitor.relay import CarEndpoint, Relay
from clients.monitor.session import Host, PageSession
from clients.monitor.token_file import login_token
from clients.teleop.shaping import InputShape
from runtime.host.rate_limited_log import RateLimitedLog

log = logging.getLogger("wallride.monitor")

PING_EVERY_S = 5.0
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

EVERYWHERE = ("0.0.0.0", "::")  # noqa: S104 - compared with, not listened on
SOMEWHERE = "192.0.2.1"
"""A documentation address (RFC 5737). Nothing is sent to it."""

GOODBYE = "The monitor was ended. Start it again: wallride monitor."
MAX_REASON_B = 123
"""Maximum length of the reason with which a WebSocket is closed (RFC 6455)."""

HOST: web.AppKey[Host] = web.AppKey("host", Host)
AUTH: web.AppKey[PageAuth] = web.AppKey("auth", PageAuth)
SESSIONS: "web.AppKey[set[web.WebSocketResponse]]" = web.AppKey("visits")
REFUSALS: web.AppKey[RateLimitedLog] = web.AppKey("refusals", RateLimitedLog)


def application(host: Host, auth: PageAuth) -> web.Application:
    """Return the web application."""
    files = assets.read_all()

    async def file(request: web.Request) -> web.Response:
        name = request.match_info.get("name") or assets.INDEX
        objection = _objection(request) if name == assets.INDEX else auth.objection(request.host, auth.token)
        if objection:
            return web.Response(status=403, text=f"wallride monitor: {objection}\n", headers=HEADERS)
        asset = files.get(name)
        if asset is None:
            return web.Response(status=404, text="wallride monitor: there is no such file\n", headers=HEADERS)
        return web.Response(body=asset.body, content_type=asset.content_type, charset="utf-8", headers=HEADERS)

    app = web.Application()
    app[HOST], app[AUTH], app[SESSIONS] = host, auth, set()
    app[REFUSALS] = RateLimitedLog(log, time.monotonic)
    app.router.add_get("/", file)
    app.router.add_get("/ws", _socket)
    app.router.add_get("/{name:.+}", file)
    app.on_shutdown.append(_say_goodbye)
    return app


async def _socket(request: web.Request) -> web.StreamResponse:
    origin, token = request.headers.get("Origin", ""), request.query.get("token", "")
    if objection := request.app[AUTH].socket_objection(request.host, origin, token):
        words = f"turned away a WebSocket from {request.remote}, origin {shortened(origin) or 'none'}: {objection}"
        request.app[REFUSALS].log("refused", words)
        return web.Response(status=403, text=f"wallride monitor: {objection}\n", headers=HEADERS)
    if len(request.app[SESSIONS]) >= MAX_PAGES:
        return web.Response(status=503, text="wallride monitor: too many pages are open\n", headers=HEADERS)
    socket = web.WebSocketResponse(heartbeat=PING_EVERY_S, compress=False, max_msg_size=2 * LONGEST)
    request.app[SESSIONS].add(socket)
    try:
        await socket.prepare(request)
        with lasting(request):
            await PageSession(socket, request.app[HOST]).run()
    except ConnectionError:
        log.debug("a page went away")
    finally:
        request.app[SESSIONS].discard(socket)
    return socket


def _objection(request: web.Request) -> str:
    return request.app[AUTH].objection(request.host, request.query.get("token", ""))


async def _say_goodbye(app: web.Application) -> None:
    words = farewell_words(app[HOST].farewell).encode()[:MAX_REASON_B].decode(errors="ignore").encode()
    visits = app[SESSIONS]
    for visit in tuple(visits):
        await visit.close(code=1001, message=words)


def farewell_words(file: Path | None) -> str:
    """Return the sentence that pages show after the end: the file's, or the usual one."""
    try:
        words = file.read_text(encoding="utf-8", errors="replace").strip() if file is not None else ""
    except OSError:  # not written: there is nothing more to tell than the usual
        words = ""
    return words or GOODBYE


@asynccontextmanager
async def serving(host: Host, address: str, port: int, *, any_port: bool = False) -> AsyncIterator[str]:
    """Serve while the block runs; yields the address of the page. ConnectionProblemError when the port is taken.

    any_port: whether another port will do when this one is taken.
    """
    auth = page_auth(address, login_token())
    runner = web.AppRunner(
        application(host, auth), access_log=None, handler_cancellation=True, shutdown_timeout=2.0, logger=QUIET
    )
    await runner.setup()
    jobs = (host.relay.run(), host.overview.run(), end_idle(runner))
    helpers = [asyncio.create_task(job) for job in jobs]
    try:
        place = await _listen(runner, address, port, any_port=any_port)
        yield f"http://{place}/?token={auth.token}"
    finally:
        await runner.cleanup()  # the pages first: a driving page is stopped while there is still a link
        for helper in helpers:
            helper.cancel()
        await asyncio.gather(*helpers, return_exceptions=True)


async def _listen(runner: web.AppRunner, address: str, port: int, *, any_port: bool) -> str:
    for attempt in (port, 0) if any_port else (port,):
        try:
            await web.TCPSite(runner, address.strip("[]"), attempt).start()
            break
        except OSError as error:
            problem = error
    else:
        why = "it is taken by another program" if problem.errno == errno.EADDRINUSE else problem.strerror or problem
        raise ConnectionProblemError(f"cannot listen on {address}:{port}: {why}; choose another with --port")
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


async def run(options: argparse.Namespace) -> int:
    """Serve until interrupted; options as of `wallride.monitor_options`."""
    feel = InputShape(max_speed_mps=options.max_speed, max_steering_rad=options.max_steering)
    endpoints = places(options)
    relay = Relay(endpoints)
    view = "#all" if len(endpoints) > 1 and not options.car else ""
    host = Host(
        relay, options.name, feel, version("wallride"), options.car or "", farewell=options.farewell,
        keys=options.keys, config=options.config,
    )  # fmt: skip
    port = options.default_port if options.port is None else options.port
    async with serving(host, options.host, port, any_port=options.port is None) as served:
        url = served + view
        options.print_line(f"the monitor is at {url}")
        if not is_loopback(options.host):
            options.print_line("with this address anyone can drive the car; it goes over the network unencrypted")
            if code := qr_lines(url):
                options.print_line(code)
        with contextlib.ExitStack() as stack:
            if options.browser:
                address = stack.enter_context(handed_over(url))
                await asyncio.to_thread(_open_browser, address, options.print_line)
            await _interrupted()
    return 0


def places(options: argparse.Namespace) -> Sequence[CarEndpoint]:
    """Return the endpoints to search for cars: those of --connect."""
    return [CarEndpoint(endpoint, config, options.session) for endpoint, config in endpoint_configs(options)]


def _open_browser(url: str, print_line: Callable[[str], object]) -> None:
    if not webbrowser.open(url):
        print_line("no browser could be opened from here; open the address by hand")


async def _interrupted() -> None:
    stop, loop = asyncio.Event(), asyncio.get_running_loop()
    for number in (signal.SIGINT, signal.SIGTERM):
        with contextlib.suppress(NotImplementedError):  # Windows: Ctrl-C ends asyncio.run by itself
            loop.add_signal_handler(number, stop.set)
    await stop.wait()
