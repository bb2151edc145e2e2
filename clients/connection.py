"""Connection of a command: from its options to a session with a car that is known to be present."""

import argparse
import asyncio
import contextlib
import re
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager

from wallride.clients import CONNECT_VARIABLE
from wallride.clients.endpoints import (
    ConnectionProblemError,
    endpoint_configs,
    endpoint_of,
    given_by,
    keys_of,
    option_of,
    session_config,
)
from wallride.clients.fleet.search import at_one_endpoint
from wallride.clients.keys.diagnosis import nothing_heard, why_refused
from wallride.clients.played import NOTHING_DRIVES, SETTLING_S, PlayedNames
from wallride.runtime.security.key_files import KeyFiles
from wallride.runtime.wire import topics
from wallride.runtime.wire.bus import Bus
from wallride.runtime.wire.teleop import Malformed, read_beat, session_text

__all__ = [
    "Cars", "ConnectionProblemError", "another_car", "check_session", "connected", "endpoint_configs", "endpoint_of",
    "find_car", "given_by", "keys_of", "open_bus", "option_of", "with_one_endpoint",
]  # fmt: skip
"""What clients need; `wallride.clients.endpoints` is apart because the search of several endpoints needs it."""
FIND_TIMEOUT_S = 3.0


@asynccontextmanager
async def connected(options: argparse.Namespace, *, asks: bool = False) -> AsyncIterator[tuple[Bus, str]]:
    """Yield an open session and the car's name; the session is closed on every way out.

    options: as of `wallride.client_options.add_common`; of several endpoints that of the car is searched. asks: the car
    is to answer or to move, which a played recording does not; ConnectionProblemError says so.
    """
    options = await with_one_endpoint(options)
    bus, keys = await _open(options)
    try:
        played = PlayedNames(bus) if asks else ()
        car = await find_car(bus, options.car, whose=keys.identity.name if keys is not None else "")
        if car in played:
            await asyncio.sleep(SETTLING_S)  # the heartbeat of a car comes within it
        if car in played:
            raise ConnectionProblemError(f"{car} at {bus.endpoint}: {NOTHING_DRIVES}")
        if options.session is not None:
            await check_session(bus, car, options.session)
        yield bus, car
    finally:
        await bus.close()


async def with_one_endpoint(options: argparse.Namespace) -> argparse.Namespace:
    """Return the options with one endpoint: of several, separated by commas, that at which the car is.

    ConnectionProblemError when it is at none, or when several cars could be meant.
    """
    return await at_one_endpoint(options) if "," in options.connect else options


async def open_bus(options: argparse.Namespace) -> Bus:
    """Return an open session; ConnectionProblemError without an answer from the endpoint or with rejected keys."""
    return (await _open(options))[0]


async def _open(options: argparse.Namespace) -> tuple[Bus, KeyFiles | None]:
    given = given_by(options)
    endpoint = endpoint_of(options.connect, with_keys=options.keys is not None, given=given)
    keys = keys_of(endpoint, options.keys)
    tls = keys.tls if keys is not None else None
    bus = Bus(session_config(endpoint, keys))
    try:
        await bus.open()
    except OSError as error:
        if tls is not None:
            raise ConnectionProblemError(await asyncio.to_thread(why_refused, endpoint, tls)) from None
        local = "/127.0.0.1:" in endpoint
        question = (
            "does a car run here (wallride sim, wallride run)" if local else "is the car on and its network reachable"
        )
        place = f"another place: {option_of(options)}"
        if given == CONNECT_VARIABLE:
            place = f"the place is from {given}; {place}"
        raise ConnectionProblemError(
            f"cannot connect to {endpoint}: {question}? ({place}; zenoh says: {error})"
        ) from None
    return bus, keys


async def find_car(bus: Bus, name: str | None, *, whose: str = "", timeout_s: float = FIND_TIMEOUT_S) -> str:
    """Return the name of the selected car; ConnectionProblemError when it is absent, or not unique.

    whose: the name on the certificate, "" without one; a car does not answer names that it does not list.
    """
    if name is not None and not re.fullmatch(r"[a-z0-9][a-z0-9_-]*", name):
        raise ConnectionProblemError(f"{name!r} is not a car's name; write it like car1")
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
        raise ConnectionProblemError(_absent(bus, name, sorted(found.names))) from None
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


def _absent(bus: Bus, name: str | None, others: list[str]) -> str:
    if name is not None and others:
        return f"no car {name} at {bus.endpoint}; there is {', '.join(others)}"
    what = f"the car {name}" if name is not None else "a car"
    return f"connected to {bus.endpoint}, but {what} is not there"
