"""Registry of the cars on one or several endpoints, with a feed for each car that a page watches."""

import asyncio
import logging
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from wallride.clients.connection import Cars
from wallride.clients.fleet.links import FleetLink, open_link
from wallride.clients.monitor.feed import PageFeed, Watcher
from wallride.clients.monitor.history import CarHistories
from wallride.runtime.ending import end
from wallride.runtime.wire import topics
from wallride.runtime.wire.bus import Bus
from wallride.runtime.wire.network import RefusedError
from wallride.runtime.wire.teleop import session_text

log = logging.getLogger("wallride.monitor")

LINGER_S = 60.0
"""Time by which a feed outlives its last page: a reloaded page, or a phone that slept, finds its plots again."""
MAX_FEEDS = 32
START_ONE = "Start one: make sim here, or wallride run on the car."


@dataclass(slots=True)
class CarEndpoint:
    """One endpoint: the configuration of its sessions, and its cars.

    session: of the selected start of a car there, None for all. histories: of its cars, for a page that comes later.
    """

    endpoint: str
    config: Mapping[str, Any]
    session: int | None = None
    histories: CarHistories = field(init=False)
    link: FleetLink = field(init=False)
    cars: Cars = field(init=False)

    def __post_init__(self) -> None:
        self.histories = CarHistories(self.session)
        bus = Bus(self.config)
        self.link, self.cars = FleetLink(bus), Cars(bus)
        for topic in CarHistories.TOPICS:
            bus.subscribe(topics.key("*", topic), self.histories.take)

    @property
    def problem(self) -> str:
        """Return why there is no session with it, "" while there is."""
        return self.link.problem

    def options(self, keys: Path | None) -> list[str]:
        """Return the options of a command that is to reach the same cars. keys: folder of the keys, for tls."""
        return [
            "--connect", self.endpoint,
            *(["--keys", str(keys)] if keys is not None else []),
            *(["--session", session_text(self.session)] if self.session is not None else []),
        ]  # fmt: skip


class Relay:
    """Lives for as long as the server; feeds come and go with the pages."""

    def __init__(self, places: Sequence[CarEndpoint]) -> None:
        self._places = places
        self._feeds: dict[str, PageFeed] = {}
        self._running: dict[str, asyncio.Task[None]] = {}
        self._closing: dict[str, asyncio.TimerHandle] = {}

    @property
    def links(self) -> list[FleetLink]:
        """Return the session with each endpoint."""
        return [place.link for place in self._places]

    @property
    def names(self) -> list[str]:
        """Return the cars present now."""
        return sorted({name for place in self._places for name in place.cars.names})

    @property
    def problem(self) -> str:
        """Return the reason why there is no car to choose, with the remedy; "" when there is one."""
        if self.names:
            return ""
        unopened = [place for place in self._places if place.problem and place.endpoint.startswith("tls/")]
        secured = [f"{place.endpoint}: {place.problem}" for place in unopened]  # the reason may be a key
        where = ", ".join(place.endpoint for place in self._places)
        return "; ".join([f"No car at {where}. {START_ONE}", *secured])

    async def run(self) -> None:
        """Look for cars on every endpoint until cancelled; then close everything."""
        try:
            async with asyncio.TaskGroup() as group:
                for place in self._places:
                    group.create_task(_look(place))
        finally:
            for name in list(self._feeds):
                self._end(name)
            await end(*self._running.values())

    def watch(self, name: str, watcher: Watcher) -> PageFeed:
        """Add a listener to a car, which need not be there yet; RefusedError when there are too many."""
        if (closing := self._closing.pop(name, None)) is not None:
            closing.cancel()
        feed = self._feeds.get(name)
        if feed is None:
            if len(self._feeds) >= MAX_FEEDS:
                raise RefusedError("too many cars are being watched already")
            place = self.place_of(name)
            feed = self._feeds[name] = PageFeed(name, place.config, place.session, place.histories.of(name))
            self._running[name] = asyncio.create_task(feed.run(), name=f"feed {name}")
            self._running[name].add_done_callback(_say_why)
        feed.watchers.add(watcher)
        return feed

    def unwatch(self, feed: PageFeed, watcher: Watcher) -> None:
        """Remove a listener; the feed goes a while after the last one."""
        feed.watchers.discard(watcher)
        if not feed.watchers and feed.car not in self._closing and self._feeds.get(feed.car) is feed:
            self._closing[feed.car] = asyncio.get_running_loop().call_later(LINGER_S, self._end, feed.car)

    def place_of(self, name: str) -> CarEndpoint:
        """Return the endpoint at which a car is, the first one for a car that is not there."""
        return next((place for place in self._places if name in place.cars.names), self._places[0])

    def _end(self, name: str) -> None:
        if (closing := self._closing.pop(name, None)) is not None:
            closing.cancel()
        self._feeds.pop(name, None)
        self._running[name].cancel()


async def _look(place: CarEndpoint) -> None:
    """Keep one session with an endpoint: its cars, and what is plotted of them before a page comes."""
    try:
        await open_link(place.link)
        await asyncio.Event().wait()
    finally:
        await place.link.bus.close()


def _say_why(task: "asyncio.Task[None]") -> None:
    if not task.cancelled() and (error := task.exception()) is not None:
        log.error("%s ended: %s", task.get_name(), error)
