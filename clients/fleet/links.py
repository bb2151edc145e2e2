"""Sessions with several endpoints at once, of cars or routers: one that is away delays none of the others."""

import argparse
import asyncio
import sys
from collections.abc import AsyncIterator, Callable, Sequence
from contextlib import asynccontextmanager
from dataclasses import dataclass

from wallride.clients.endpoints import endpoint_configs
from wallride.runtime.ending import end
from wallride.runtime.host.terminal_text import one_line, say
from wallride.runtime.wire.bus import Bus

RETRY_S = 0.5
TOLD_AFTER_S = 2.0
UNANSWERED = "no answer yet; is the car or router there on?"


@dataclass(eq=False, slots=True)
class FleetLink:
    """The session with one endpoint. problem: why there is none, "" while there is."""

    bus: Bus
    problem: str = UNANSWERED

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
    links = [FleetLink(Bus(config)) for _, config in endpoint_configs(options, unusable)]
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
    """Return the endpoints without a session, with the reason."""
    waiting = "; ".join(f"{link.endpoint}: {link.problem}" for link in links if link.problem)
    return f"waiting for a car: {one_line(waiting)}" if waiting else ""


async def open_link(link: FleetLink) -> None:
    """Open the session, again and again until it is."""
    while link.problem:
        try:
            await link.bus.open()
        except OSError as error:
            link.problem = f"{error} (why: wallride status --connect {link.endpoint})"
            await asyncio.sleep(RETRY_S)
        else:
            link.problem = ""
