"""The car's sessions with routers: what it says goes there as well, what comes from there passes the same gates.

A router that is away, hangs or comes back costs the car nothing: the session opens in a thread, is tried again for
ever, and drops what it cannot send. At a router a car first looks whether its name is free. The second car of a name
takes no commands there, is seen as refused, and waits.
"""

import asyncio
import contextlib
import logging
from collections.abc import Callable, Mapping, Sequence
from typing import Any, Final, Never

from wallride.runtime.ending import end
from wallride.runtime.wire import topics
from wallride.runtime.wire.car_bus import CarBus
from wallride.runtime.wire.network import JSON, MAX_SAMPLE_BYTES, Receive, Reply

log = logging.getLogger("wallride.uplink")

RETRY_S: Final = 1.0
LOOK_EVERY_S: Final = 1.0
SETTLING_S: Final = 1.0
"""Time for which a car looks for another one of its name: longer than a session needs to be back at a router."""

Declare = Callable[[CarBus], None]


class Uplink:
    """The session with one router.

    session: of the car, under which it holds its name. bus: the session while the car has its name there, else None.
    problem: why nothing goes to this router, "" while it does.
    """

    def __init__(self, config: Mapping[str, Any], car: str) -> None:
        self._config = config
        self._car = car
        self._declared: list[Declare] = []
        self.bus: CarBus | None = None
        self._others: set[str] = set()
        self._news = asyncio.Event()
        self.session = "00000000"
        self.problem = "connecting"

    @property
    def endpoint(self) -> str:
        """Address of the router."""
        return str(self._config["connect"]["endpoints"][0])

    def declare(self, declare: Declare) -> None:
        """Declare on the session, at each admission; at once if the car is admitted."""
        self._declared.append(declare)
        if self.bus is not None:
            declare(self.bus)

    async def run(self) -> Never:
        """Keep the session until cancelled."""
        while True:
            bus = CarBus(self._config)
            try:
                await bus.open()
                await self._attend(bus)
            except OSError as error:
                if self.problem != (problem := str(error)):
                    log.warning("nothing goes to a router: %s", problem)
                self.problem = problem
                await asyncio.sleep(RETRY_S)
            finally:
                self.bus = None
                await bus.close()

    async def _attend(self, bus: CarBus) -> None:
        """Be at the router until the name is lost, or wait there until it is free."""
        self._others.clear()
        bus.watch(topics.key(self._car, f"{topics.ALIVE}/*"), self._on_holder)
        await asyncio.sleep(SETTLING_S)
        if self._others:
            await self._wait_refused(bus)
            return
        bus.announce(topics.key(self._car, f"{topics.ALIVE}/{self.session}"))
        for declare in tuple(self._declared):
            declare(bus)
        self.bus, self.problem = bus, ""
        log.info("at the router %s", self.endpoint)
        while not any(other < self.session for other in self._others):  # two at once: the lower session stays
            self.problem = "" if bus.has_router else "it does not answer"
            with contextlib.suppress(TimeoutError):
                async with asyncio.timeout(LOOK_EVERY_S):
                    await self._changed()
        self.bus = None
        self._say_taken()

    async def _wait_refused(self, bus: CarBus) -> None:
        self._say_taken()
        bus.announce(topics.key(self._car, f"{topics.REFUSED}/{self.session}"))
        while self._others:
            await self._changed()
        self.problem = "connecting"

    def _say_taken(self) -> None:
        self.problem = (
            f"another car is called {self._car} there (session {min(self._others)}): give this one another name"
        )
        log.error("%s: %s; nothing goes to this router", self.endpoint, self.problem)

    async def _changed(self) -> None:
        await self._news.wait()
        self._news.clear()

    def _on_holder(self, key: str, alive: bool) -> None:  # noqa: FBT001 - the bus's callback
        session = key.rpartition("/")[2]
        if session == self.session:
            return
        (self._others.add if alive else self._others.discard)(session)
        self._news.set()


class UplinkedBus(CarBus):
    """The car's own session, and one with each router."""

    def __init__(self, config: Mapping[str, Any], uplinks: Sequence[Uplink], *, any_port: bool = False) -> None:
        super().__init__(config, any_port=any_port)
        self._uplinks = tuple(uplinks)
        self._wanting: dict[str, list[CarBus]] = {}
        self._running: list[asyncio.Task[Never]] = []

    @property
    def routers(self) -> Mapping[str, str]:
        """Why nothing goes to a router, by its address; "" while it does."""
        return {uplink.endpoint: uplink.problem for uplink in self._uplinks}

    async def open(self) -> None:
        """Open the car's own session, and begin to look for the routers."""
        await super().open()
        self._running = [
            asyncio.create_task(uplink.run(), name=f"router {uplink.endpoint}") for uplink in self._uplinks
        ]

    async def close(self) -> None:
        """Close all sessions; one that hangs does not hold up the others."""
        own = asyncio.create_task(super().close())
        errors = await end(*self._running)
        await own
        for error in errors:
            raise error

    def poll(self) -> None:
        """Deliver what has come on any of the sessions."""
        super().poll()
        for bus in self._admitted():
            bus.poll()

    def put(self, key: str, payload: bytes, *, encoding: str = JSON, urgent: bool = False) -> None:
        """Publish on every session that has a subscriber, as far as that was asked."""
        super().put(key, payload, encoding=encoding, urgent=urgent)
        wanting = self._wanting.get(key)
        for bus in self._admitted():
            if wanting is None or bus in wanting:
                bus.put(key, payload, encoding=encoding, urgent=urgent)

    def wanted(self, key: str, *, encoding: str = JSON, urgent: bool = False) -> bool:
        """Tell whether a key has a subscriber on any of the sessions."""
        here = super().wanted(key, encoding=encoding, urgent=urgent)
        self._wanting[key] = [bus for bus in self._admitted() if bus.wanted(key, encoding=encoding, urgent=urgent)]
        return here or bool(self._wanting[key])

    def subscribe(self, key: str, receive: Receive, *, max_bytes: int = MAX_SAMPLE_BYTES) -> None:
        """Subscribe on every session."""
        super().subscribe(key, receive, max_bytes=max_bytes)
        self._everywhere(lambda bus: bus.subscribe(key, receive, max_bytes=max_bytes))

    def answer(self, key: str, reply: Reply) -> None:
        """Answer on every session."""
        super().answer(key, reply)
        self._everywhere(lambda bus: bus.answer(key, reply))

    def announce(self, key: str) -> None:
        """Hold a token on every session."""
        super().announce(key)
        self._everywhere(lambda bus: bus.announce(key))

    def _everywhere(self, declare: Declare) -> None:
        for uplink in self._uplinks:
            uplink.declare(declare)

    def _admitted(self) -> list[CarBus]:
        return [uplink.bus for uplink in self._uplinks if uplink.bus is not None]
