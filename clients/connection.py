"""Connection of a command: from its options to a session with a car that is known to be present."""

import argparse
import asyncio
import contextlib
import logging
import re
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

from clients.keys.diagnosis import nothing_heard, why_refused
from runtime.security.access_list import KeysError
from runtime.security.key_files import KeyFiles, client_keys
from runtime.wire import topics, zenoh_config
from runtime.wire.bus import Bus
from runtime.wire.teleop import Malformed, read_beat, session_text

log = logging.getLogger("wallride.client")

PORTS = {"tcp": 7447, "tls": 7448}
"""Ports by protocol; tls has one of its own: `[::]` includes loopback, where tcp listens already."""
KEYS = Path("~/.config/wallride/keys")
HIGHEST_PORT = 65535
ENDPOINT = re.compile(r"(tcp|tls)/(\[[0-9a-fA-F:.]+\]|[\w.-]+):(\d{1,5})")
FIND_TIMEOUT_S = 3.0
SETTLING_S = 0.2
"""Time after the first car's answer in which other cars can announce themselves."""


class ConnectionProblemError(Exception):
    """No connection to the car; the text is one line with the remedy."""


@asynccontextmanager
async def connected(options: argparse.Namespace) -> AsyncIterator[tuple[Bus, str]]:
    """Yield an open session and the car's name; the session is closed on every way out.

    options: as of `wallride.client_options.add_common`.
    """
    bus, keys = await _open(options)
    try:
        car = await find_car(bus, options.car, whose=keys.identity.name if keys is not None else "")
        if options.session is not None:
            await check_session(bus, car, options.session)
        yield bus, car
    finally:
        await bus.close()


async def open_bus(options: argparse.Namespace) -> Bus:
    """Return an open session; ConnectionProblemError without an answer from the endpoint or with rejected keys."""
    return (await _open(options))[0]


async def _open(options: argparse.Namespace) -> tuple[Bus, KeyFiles | None]:
    endpoint = endpoint_of(options.connect, with_keys=options.keys is not None)
    keys = keys_of(endpoint, options.keys)
    tls = keys.tls if keys is not None else None
    bus = Bus(zenoh_config.client_config(endpoint, tls))
    try:
        await bus.open()
    except OSError as error:
        if tls is not None:
            raise ConnectionProblemError(await asyncio.to_thread(why_refused, endpoint, tls)) from None
        local = "/127.0.0.1:" in endpoint
        question = (
            "does a car run here (wallride sim, wallride run)" if local else "is the car on and its network reachable"
        )
        raise ConnectionProblemError(
            f"cannot connect to {endpoint}: {question}? (another place: --connect; zenoh says: {error})"
        ) from None
    return bus, keys


async def find_car(bus: Bus, name: str | None, *, whose: str = "", timeout_s: float = FIND_TIMEOUT_S) -> str:
    """Return the name of the selected car; ConnectionProblemError when it is absent, or not unique.

    whose: the name on the certificate, "" without one; a car does not answer names that it does not list.
    """
    if name is not None and not re.fullmatch(r"[a-z0-9][a-z0-9_-]*", name):
        raise ConnectionProblemError(f"--car {name}: is not a car's name; write it like car1")
    found = Cars(bus)
    try:
        async with asyncio.timeout(timeout_s):
            while not found.names or (name is not None and name not in found.names):
                await found.changed()
        if name is not None:
            return name
        await asyncio.sleep(SETTLING_S)
    except TimeoutError:
        if whose and not found.names:
            raise ConnectionProblemError(nothing_heard(whose, bus.endpoint)) from None
        raise ConnectionProblemError(_nobody(bus, name, sorted(found.names))) from None
    if len(found.names) > 1:
        raise ConnectionProblemError(f"there are several cars: {', '.join(sorted(found.names))}; choose with --car")
    return next(iter(found.names), "")


async def check_session(bus: Bus, car: str, session: int, *, timeout_s: float = FIND_TIMEOUT_S) -> None:
    """Return when this very start of a car answers; ConnectionProblemError when another one answers, or none."""
    heard: asyncio.Future[int] = asyncio.get_running_loop().create_future()

    def on_beat(_key: str, payload: bytes, _arrival_s: float) -> None:
        with contextlib.suppress(Malformed):
            beat = read_beat(payload)
            if not heard.done():
                heard.set_result(beat.car_session)

    bus.subscribe(topics.key(car, topics.BEAT), on_beat)
    try:
        async with asyncio.timeout(timeout_s):
            other = await heard
    except TimeoutError:
        raise ConnectionProblemError(f"{car} at {bus.endpoint} has no heartbeat: is it the car?") from None
    if other != session:
        raise ConnectionProblemError(another_car(car, bus.endpoint, session, other))


def another_car(car: str, endpoint: str, wanted: int, found: int) -> str:
    """Return the message for a user whose car has gone, and in whose place another one answers."""
    return (
        f"the car at {endpoint} is not the one that was meant: {car} has session {session_text(found)},"
        f" wanted was {session_text(wanted)}; it has ended, or was started again (leave --session out for any)"
    )


class Cars:
    """Present cars, by their liveliness tokens."""

    def __init__(self, bus: Bus) -> None:
        self.names: set[str] = set()
        self._news = asyncio.Event()
        bus.watch(topics.key("*", topics.ALIVE), self._on_token)

    async def changed(self) -> None:
        """Wait for a car's arrival or departure since the last return."""
        await self._news.wait()
        self._news.clear()

    def _on_token(self, key: str, alive: bool) -> None:  # noqa: FBT001 - the bus's callback
        name = key.split("/")[1]
        if alive:
            self.names.add(name)
        else:
            self.names.discard(name)
        self._news.set()


def endpoint_of(text: str, *, with_keys: bool = False) -> str:
    """Return a zenoh endpoint for a user's text: `car1.local`, `10.0.0.5:7447`, `tls/car1.local:7448`."""
    scheme, slash, place = text.rpartition("/")
    if not slash:
        scheme = "tls" if with_keys else "tcp"
    if not re.search(r":\d+$", place):
        place = f"{place}:{PORTS.get(scheme, PORTS['tcp'])}"
    endpoint = f"{scheme}/{place}"
    if not ENDPOINT.fullmatch(endpoint):
        raise ConnectionProblemError(
            f"--connect {text}: write tcp/HOST:PORT or tls/HOST:PORT, e.g. tls/car1.local:{PORTS['tls']}"
        )
    if not 1 <= int(place.rpartition(":")[2]) <= HIGHEST_PORT:
        raise ConnectionProblemError(f"--connect {text}: there is no such port; ports are 1 to {HIGHEST_PORT}")
    return endpoint


def endpoint_configs(options: argparse.Namespace) -> list[tuple[str, dict[str, Any]]]:
    """Return the endpoints of --connect, separated by commas, with the configuration of a session at each."""
    found = []
    for text in filter(None, (part.strip() for part in options.connect.split(","))):
        endpoint = endpoint_of(text, with_keys=options.keys is not None)
        keys = keys_of(endpoint, options.keys)
        found.append((endpoint, zenoh_config.client_config(endpoint, keys.tls if keys is not None else None)))
    if not found:
        raise ConnectionProblemError("--connect: name at least one endpoint, e.g. tcp/127.0.0.1:7447")
    return found


def keys_of(endpoint: str, folder: Path | None) -> KeyFiles | None:
    """Return the checked keys for an endpoint, None for tcp/, which has none; ConnectionProblemError when unusable."""
    if not endpoint.startswith("tls/"):
        return None
    try:
        keys = client_keys((folder or KEYS).expanduser(), datetime.now(UTC))
    except KeysError as error:
        raise ConnectionProblemError(f"{endpoint} needs keys: {error}") from None
    for warning in keys.warnings:
        log.warning("%s", warning)
    return keys


def _nobody(bus: Bus, name: str | None, others: list[str]) -> str:
    if name is not None and others:
        return f"no car {name} at {bus.endpoint}; there is {', '.join(others)}"
    what = f"the car {name}" if name is not None else "a car"
    return f"connected to {bus.endpoint}, but {what} is not there"
