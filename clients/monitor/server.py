"""`wallride monitor`: the web server. Serves the page, and one WebSocket per page; knows nothing about cars itself.

The browser is handed the page's address in a file that only this user can read, because an address on a command line,
as every opener of browsers has it, is shown to all users of a computer (ps).
"""

import argparse
import asyncio
import contextlib
import html
import io
import logging
import os
import sys
import tempfile
import webbrowser
from collections.abc import AsyncIterator, Callable, Iterator, Mapping, Sequence
from contextlib import asynccontextmanager, contextmanager
from dataclasses import dataclass
from importlib import resources
from importlib.metadata import version
from importlib.resources.abc import Traversable
from pathlib import Path

import segno
from aiohttp import web

from wallride.clients.connection import endpoint_configs
from wallride.clients.door.auth import DoorAuth, door_auth, is_loopback
from wallride.clients.door.door import HEADERS, Door
from wallride.clients.door.listening import listening, login_token
from wallride.clients.ending import stopping
from wallride.clients.fleet.links import telling_what_is_awaited
from wallride.clients.monitor.messages import LONGEST
from wallride.clients.monitor.relay import CarEndpoint, Relay
from wallride.clients.monitor.session import Host, PageSession
from wallride.clients.teleop.shaping import InputShape
from wallride.runtime.ending import end

INDEX = "index.html"
TYPES = {
    ".html": "text/html",
    ".css": "text/css",
    ".js": "text/javascript",
    ".svg": "image/svg+xml",
    ".webmanifest": "application/manifest+json",
}
log = logging.getLogger("wallride.monitor")

GOODBYE = "The monitor was ended. Start it again: wallride monitor."
MAX_REASON_B = 123
"""Maximum length of the reason with which a WebSocket is closed (RFC 6455)."""

HOST: web.AppKey[Host] = web.AppKey("host", Host)
DOOR: web.AppKey[Door] = web.AppKey("door", Door)
FULL_BLOCK = "█"
PAGE = """<!doctype html><meta charset="utf-8"><meta name="referrer" content="no-referrer"><title>wallride</title>
<meta http-equiv="refresh" content="0; url={address}"><p><a href="{address}">to the car</a></p>
"""


@dataclass(frozen=True, slots=True)
class Asset:
    """One file: its media type and its bytes."""

    content_type: str
    body: bytes


def read_all() -> dict[str, Asset]:
    """Return every file of the page by its path, such as `controls/hands.js`."""
    return dict(_files_in(resources.files("wallride.clients.monitor").joinpath("page"), ""))


def _files_in(folder: Traversable, path: str) -> Iterator[tuple[str, Asset]]:
    for file in folder.iterdir():
        content_type = TYPES.get("." + file.name.rpartition(".")[2])
        if file.is_dir():
            yield from _files_in(file, f"{path}{file.name}/")
        elif content_type is not None:
            yield path + file.name, Asset(content_type, file.read_bytes())


def application(host: Host, auth: DoorAuth) -> web.Application:
    """Return the web application."""
    files = read_all()
    door = Door(auth, log, longest=2 * LONGEST)

    async def file(request: web.Request) -> web.Response:
        name = request.match_info.get("name") or INDEX
        token = None if name == INDEX else auth.token  # the page's parts are no secret
        if refusal := door.refusal(request, token=token):
            return refusal
        asset = files.get(name)
        if asset is None:
            return door.answer(404, "there is no such file")
        return web.Response(body=asset.body, content_type=asset.content_type, charset="utf-8", headers=HEADERS)

    app = web.Application()
    app[HOST], app[DOOR] = host, door
    app.router.add_get("/", file)
    app.router.add_get("/ws", _socket)
    app.router.add_get("/lap-map/{name}.png", _picture)
    app.router.add_get("/{name:.+}", file)
    app.on_shutdown.append(_say_goodbye)
    return app


async def _socket(request: web.Request) -> web.StreamResponse:
    return await request.app[DOOR].visit(request, lambda socket: PageSession(socket, request.app[HOST]).run())


async def _picture(request: web.Request) -> web.Response:
    """Answer with a picture of the map of a lap; what the car saw is shown to those with the token alone."""
    door = request.app[DOOR]
    if refusal := door.refusal(request):
        return refusal
    body = await asyncio.to_thread(request.app[HOST].mapper.picture, request.match_info["name"])
    if body is None:
        return door.answer(404, "there is no such picture")
    return web.Response(body=body, content_type="image/png", headers=HEADERS)


async def _say_goodbye(app: web.Application) -> None:
    words = farewell_words(app[HOST].farewell).encode()[:MAX_REASON_B].decode(errors="ignore").encode()
    for visit in tuple(app[DOOR].visits):
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
    auth = door_auth(address, login_token())
    helpers = [asyncio.create_task(job) for job in (host.relay.run(), host.overview.run())]
    try:
        async with listening(application(host, auth), address, port, any_port=any_port) as place:
            yield f"http://{place}/?token={auth.token}"
    finally:
        await host.mapper.close()
        await end(*helpers)


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
    async with contextlib.AsyncExitStack() as stack:
        served = await stack.enter_async_context(serving(host, options.host, port, any_port=options.port is None))
        url, stop = served + view, asyncio.Event()
        stack.enter_context(stopping(stop))  # before the address is told: what is opened then is removed
        options.print_line(f"the monitor is at {url}")
        if not is_loopback(options.host):
            options.print_line("with this address anyone can drive the car; it goes over the network unencrypted")
            if code := qr_lines(url):
                options.print_line(code)
        await stack.enter_async_context(telling_what_is_awaited(lambda: relay.problem))
        if options.browser:
            address = stack.enter_context(handed_over(url))
            await asyncio.to_thread(_open_browser, address, options.print_line)
        await stop.wait()
    return 0


def places(options: argparse.Namespace) -> Sequence[CarEndpoint]:
    """Return the endpoints to search for cars: those of --connect."""
    return [CarEndpoint(endpoint, config, options.session) for endpoint, config, _ in endpoint_configs(options)]


def _open_browser(url: str, print_line: Callable[[str], object]) -> None:
    if not webbrowser.open(url):
        print_line("no browser could be opened from here; open the address by hand")


def qr_lines(address: str, encoding: str | None = None) -> str:
    """Return the code as lines of half blocks; "" where the terminal's encoding has none.

    encoding: of the terminal, by default that of standard output.
    """
    try:
        FULL_BLOCK.encode(encoding or sys.stdout.encoding or "ascii")
    except (UnicodeEncodeError, LookupError):
        return ""
    out = io.StringIO()
    segno.make(address, error="l", micro=False).terminal(out=out, border=2, compact=True)
    return out.getvalue().rstrip("\n")


@contextmanager
def handed_over(url: str, environment: Mapping[str, str] = os.environ) -> Iterator[str]:
    """Yield the file's address while the block runs. Its folder is this login's own, or a new one of mode 700."""
    place = environment.get("XDG_RUNTIME_DIR") or None
    with tempfile.TemporaryDirectory(prefix="wallride-monitor-", dir=place, ignore_cleanup_errors=True) as folder:
        file = Path(folder) / "page.html"
        with os.fdopen(os.open(file, os.O_WRONLY | os.O_CREAT | os.O_EXCL | os.O_CLOEXEC, 0o600), "w") as out:
            out.write(PAGE.format(address=html.escape(url)))
        yield file.as_uri()
