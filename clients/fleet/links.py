"""Sessions with several endpoints at once, of cars or routers: one that is away delays none of the others.

A screen on them lasts until Ctrl-C, with the e-stop to all cars under Space and Esc.
"""

import argparse
import asyncio
import sys
import time
from collections.abc import AsyncIterator, Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import asynccontextmanager
from dataclasses import dataclass

from wallride.clients.endpoints import endpoint_configs
from wallride.clients.fleet.stop import PERIOD_S, FleetStop
from wallride.clients.refreshing import RefreshedScreen
from wallride.clients.teleop import terminal
from wallride.runtime.ending import end
from wallride.runtime.host.terminal_text import one_line, say
from wallride.runtime.wire.bus import Bus

RETRY_S = 0.5
TOLD_AFTER_S = 2.0
UNANSWERED = "no answer yet; is the car or router there on?"
REFRESH_S = 0.2
STOP_KEYS = b" \x1b"
Keys = Mapping[int, tuple[str, Callable[[], None]]]
"""By the key's byte: what it does in words, and the function."""


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
async def fleet_links(options: argparse.Namespace) -> AsyncIterator[Sequence[FleetLink]]:
    """Yield a link for each endpoint of --connect; each opens as soon as it can. All are closed on every way out."""
    links = [FleetLink(Bus(config)) for _, config in endpoint_configs(options)]
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
            link.problem = str(error)
            await asyncio.sleep(RETRY_S)
        else:
            link.problem = ""


async def watch(
    options: argparse.Namespace,
    links: Sequence[FleetLink],
    lines: Callable[[], Iterable[str]],
    keys: Keys | None = None,
) -> None:
    """Show the lines until Ctrl-C; Space or Esc stops every car, other keys as given."""
    async with telling_what_is_awaited(lambda: "" if sys.stdout.isatty() else unopened(links)):
        await _watch(options, links, lines, keys or {})


async def _watch(
    options: argparse.Namespace, links: Sequence[FleetLink], lines: Callable[[], Iterable[str]], others: Keys
) -> None:
    stop = FleetStop(links, options.name, options.car)
    console = terminal.Console() if terminal.is_there() else None
    if console is not None:
        console.open()
    shown, shown_s, pressed = RefreshedScreen(options.print_line), 0.0, False
    try:
        while True:
            now_s = time.monotonic()
            typed = set(console.read() or b"") if console is not None else set()
            if typed & set(STOP_KEYS):
                pressed = True
                stop.press(now_s)
            stop.step(now_s)
            for key in typed & others.keys():
                others[key][1]()
            if now_s - shown_s >= REFRESH_S:
                shown_s = now_s
                foot = _foot(links, stop if pressed else None, others)
                rows = list(map(one_line, lines()))
                shown.show("\n".join([*rows, *map(one_line, foot)]), "; ".join(rows))
            await asyncio.sleep(PERIOD_S)
    finally:
        if console is not None:
            console.close()


def _foot(links: Sequence[FleetLink], stop: FleetStop | None, keys: Keys) -> Iterator[str]:
    yield ""
    yield from (f"{link.endpoint}: {link.problem}" for link in links if link.problem)
    if stop is None:
        others = "".join(f"; {chr(key)}: {words}" for key, (words, _) in keys.items())
        yield f"Space or Esc: e-stop to every car{others}"
    else:
        late = [car for car, took_s in stop.cars.items() if took_s is None]
        yield f"e-stop sent to every car{'; NOT CONFIRMED by ' + ', '.join(late) if late else ', all have latched'}"
