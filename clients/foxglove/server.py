"""`wallride foxglove`: the web server and the command.

A program of its own, a client like any other; it displays topics, and accepts settings and the e-stop, but no drive
command. The messages are the very bytes from zenoh.
"""

import argparse
import logging
from typing import Final

from aiohttp import web

from wallride.clients.connection import connected
from wallride.clients.door.auth import DoorAuth, door_auth, is_loopback
from wallride.clients.door.door import Door
from wallride.clients.door.listening import listening, login_token
from wallride.clients.ending import interrupted
from wallride.clients.foxglove.control import EStop, ViewedSettings
from wallride.clients.foxglove.viewer import LONGEST, PROTOCOLS, CarChannels, Served, Viewer

log = logging.getLogger("wallride.foxglove")

COMMAND = "foxglove"
PAGES: Final = frozenset({None, "file://", "https://app.foxglove.dev", "https://studio.foxglove.dev"})
"""Origins of the viewers: a program such as PlotJuggler states none, a desktop application opens its page as a file.
The token is what protects the car: these pages get it from the user, who enters the address."""


def application(served: Served, auth: DoorAuth) -> web.Application:
    """Return the web application: one WebSocket at the root."""
    door = Door(auth, log, longest=LONGEST, protocols=PROTOCOLS)

    async def visit(request: web.Request) -> web.StreamResponse:
        return await door.visit(request, lambda socket: Viewer(socket, served).run())

    async def goodbye(_app: web.Application) -> None:
        for socket in tuple(door.visits):
            await socket.close(code=1001)

    app = web.Application()
    app.router.add_get("/", visit)
    app.on_shutdown.append(goodbye)
    return app


async def run(options: argparse.Namespace) -> int:
    """Serve until interrupted; options as of `wallride.foxglove_options`."""
    here = is_loopback(options.host)
    pages = PAGES | {page.lower().rstrip("/") for page in options.pages}
    auth = door_auth(options.host, login_token(COMMAND), command=COMMAND, pages=pages)
    async with connected(options) as (bus, car):
        served = Served(car, CarChannels(bus, car), ViewedSettings(bus, car, may_change=here), EStop(bus, car))
        async with listening(application(served, auth), options.host, options.port) as place:
            address = f"ws://{place}/?token={auth.token}"
            options.print_line(f"{car}: open {address} in Foxglove, Lichtblick or PlotJuggler")
            if not here:
                options.print_line(
                    "with this address anyone can watch and press the e-stop; it goes over the network unencrypted"
                )
            await interrupted()
    return 0
