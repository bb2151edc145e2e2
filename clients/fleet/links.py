"""Sessions with several endpoints at once, of cars or routers: one that is away delays none of the others."""

import argparse
import asyncio
import math
import sys
import time
from collections.abc import AsyncIterator, Callable, Sequence
from contextlib import asynccontextmanager
from dataclasses import dataclass
from functools import partial

from wallride.clients.endpoints import endpoint_configs
from wallride.clients.keys.diagnosis import nothing_heard, why_refused
from wallride.runtime.ending import end
from wallride.runtime.host.terminal_text import one_line, say
from wallride.runtime.security.key_files import KeyFiles
from wallride.runtime.wire import topics
from wallride.runtime.wire.bus import Bus

RETRY_S = 0.5
TOLD_AFTER_S = 2.0
QUIET_S = 1.0
"""Time after which an open session by keys should have shown a car."""
UNANSWERED = "no answer yet; is the car or router there on?"


@dataclass(eq=False, slots=True)
class FleetLink:
    """The session with one endpoint. problem: why there is none, "" while there is.

    keys: None without. opened_s: on the monotonic clock. has_shown: whether any car was there, however long ago.
    """

    bus: Bus
    problem: str = UNANSWERED
    keys: KeyFiles | None = None
    opened_s: float = math.inf
    has_shown: bool = False

    @property
    def endpoint(self) -> str:
        """Its address."""
        return self.bus.endpoint


@asynccontextmanager
async def fleet_links(
    options: argparse.Namespace, unusable: list[str] | None = None
) -> AsyncIterator[Sequence[FleetLink]]:
    """Yield a link for each endpoint of --connect; each opens as soon as it can. All are closed on every way out.

    unusable: as of `endpoint_configs`.
    """
    links = [FleetLink(Bus(config), keys=keys) for _, config, keys in endpoint_configs(options, unusable)]
    for link in links:
        link.bus.watch(topics.key("*", topics.ALIVE), partial(_on_token, link))
    opening = [asyncio.create_task(open_link(link)) for link in links]
    try:
        yield links
    finally:
        await end(*opening)
        await asyncio.gather(*(link.bus.close() for link in links))


@asynccontextmanager
async def telling_what_is_awaited(words: Callable[[], str]) -> AsyncIterator[None]:
    """Say once on standard error what the block waits for, after TOLD_AFTER_S. words: "" where it waits for nothing."""

    async def tell() -> None:
        await asyncio.sleep(TOLD_AFTER_S)
        if told := words():
            say(f"wallride: {told}", file=sys.stderr)

    telling = asyncio.create_task(tell(), name="what is awaited")
    try:
        yield
    finally:
        await end(telling)


def unopened(links: Sequence[FleetLink]) -> str:
    """Return the endpoints without a session, or with one at which nothing is heard, with the reason."""
    waiting = "; ".join([*(f"{link.endpoint}: {link.problem}" for link in links if link.problem), *unheard(links)])
    return f"waiting for a car: {one_line(waiting)}" if waiting else ""


def unheard(links: Sequence[FleetLink]) -> list[str]:
    """Return a sentence for each session by keys that has been open for long enough and has shown no car."""
    since_s = time.monotonic() - QUIET_S
    return [
        nothing_heard(link.keys.identity.name, link.endpoint)
        for link in links
        if link.keys is not None and not link.has_shown and link.opened_s <= since_s
    ]


async def why_no_car(links: Sequence[FleetLink]) -> list[str]:
    """Return for each link by keys that has shown no car why, as `wallride status` says it; takes up to about 3 s."""
    refused = await asyncio.gather(*(_why_unopened(link) for link in links))
    opened_s = [link.opened_s for link in links if link.keys is not None and not link.problem and not link.has_shown]
    await asyncio.sleep(max([0.0, *(at_s + QUIET_S - time.monotonic() for at_s in opened_s)]))
    return [*filter(None, refused), *unheard(links)]


async def _why_unopened(link: FleetLink) -> str:
    """Return why there is no session by keys; "" where there is one by now, or no keys."""
    if link.keys is None or not link.problem:
        return ""
    told = await asyncio.to_thread(why_refused, link.endpoint, link.keys.tls)
    return told if link.problem else ""


def _on_token(link: FleetLink, _key: str, alive: bool) -> None:  # noqa: FBT001 - the bus's callback
    link.has_shown |= alive


async def open_link(link: FleetLink) -> None:
    """Open the session, again and again until it is."""
    while link.problem:
        try:
            await link.bus.open()
        except OSError as error:
            link.problem = f"{error} (why: wallride status --connect {link.endpoint})"
            await asyncio.sleep(RETRY_S)
        else:
            link.problem, link.opened_s = "", time.monotonic()
