"""A lidar that maintains its connection: open the port, meet the sensor, measure, take leave, reconnect."""

import asyncio
import logging
from abc import ABC, abstractmethod
from collections.abc import Callable, Iterator
from dataclasses import replace
from typing import ClassVar, Final, Generic, Never, Protocol, TypeVar

from wallride.drivers.address import Address, SerialAddress, parse_address
from wallride.drivers.api import Clock, DriverError, Health, LinkLost, LinkState, ProtocolError, Reschedule, Scan
from wallride.drivers.lidar_settings import ConnectedLidarSettings
from wallride.drivers.link import ByteLink, Tap, open_link, until_lost

_log = logging.getLogger(__name__)

RETRY_DELAYS_S: Final = (0.1, 0.5, 1.0, 2.0)
"""Delays of the reconnection attempts. The first is short because most losses are a restart; the last one repeats."""
LATE_SAID_S: Final = 0.05
"""Delay from which a status says that the scans come late."""
_WATCH_PERIOD_S: Final = 0.1
_WATCH_SLACK_S: Final = 0.02


class Talk(Protocol):
    """Requests to a sensor over an open link."""

    link: ByteLink


TalkT = TypeVar("TalkT", bound=Talk)


class ConnectedLidar(ABC, Generic[TalkT]):
    """A `Lidar` (see wallride.drivers.api) but for its protocol.

    health: its present condition. bauds: usual speeds of a serial line, the likeliest first. dtr: state of that line at
    the opening of the port.
    clear_s: moves the checks of the stream to a better moment.
    """

    leaves_after: ClassVar[tuple[type[BaseException], ...]] = (asyncio.CancelledError,)
    """What ends a connection with the commands that stop the sensor."""

    def __init__(
        self,
        settings: ConnectedLidarSettings,
        bauds: tuple[int, ...],
        clock: Clock,
        clear_s: Reschedule,
        *,
        dtr: bool = True,
    ) -> None:
        self._bauds = bauds
        self._clock = clock
        self._clear_s = clear_s
        self._dtr = dtr
        self.health = Health()
        self._address = parse_address(settings.address)
        self._speed_known = "baud=" in settings.address
        self._logged = self.health.link
        self._failures = 0
        self._talk: TalkT | None = None
        self.tap: Tap | None = None

    @abstractmethod
    async def _meet(self, link: ByteLink) -> TalkT:
        """Quieten the sensor, whatever its state; LinkLost where nothing of it answers."""

    @abstractmethod
    async def _measure(self, talk: TalkT, on_scan: Callable[[Scan], None]) -> Never:
        """Stream, and restart the stream as long as a restart brings scans."""

    @abstractmethod
    async def _say_goodbye(self, talk: TalkT) -> None:
        """Stop the sensor before the port is closed; a link that is lost takes no command."""

    async def _who(self, talk: TalkT) -> str:  # noqa: ARG002 - some have to ask once more
        """Return the identity of the sensor just met."""
        return self.health.identity

    async def identify(self) -> tuple[Address, str]:
        """Meet the sensor once; return where it answered, and its identity. It is left quiet, the port closed.

        DriverError where nothing of its protocol answers, or what answers cannot be used.
        """
        talk = await self._reach()
        try:
            return self._address, await until_lost(talk.link, self._who(talk))
        finally:
            await self._say_goodbye(talk)
            talk.link.close()

    @property
    def reading_s(self) -> float:
        """Duration of the newest bytes' read from the kernel."""
        return self._talk.link.reading_s if self._talk is not None else 0.0

    async def run(self, on_scan: Callable[[Scan], None]) -> Never:
        """Deliver scans without end; see `Lidar` in wallride.drivers.api. Raises only for a bug, or by `on_scan`."""
        while True:
            try:
                await self._serve(on_scan)
            except DriverError as trouble:
                self._say(LinkState.FAULTY if isinstance(trouble, ProtocolError) else LinkState.ABSENT, str(trouble))
            delay_s = RETRY_DELAYS_S[min(self._failures, len(RETRY_DELAYS_S) - 1)]
            self._failures += 1
            await asyncio.sleep(delay_s)
            self.health.count("reconnect")

    async def _serve(self, on_scan: Callable[[Scan], None]) -> Never:
        """Use one connection until it is lost."""
        self._talk = talk = await self._reach()
        try:
            await until_lost(talk.link, self._measure(talk, on_scan))
        except self.leaves_after:
            await self._say_goodbye(talk)
            raise
        finally:
            talk.link.close()
        raise AssertionError("unreachable: measuring never ends by itself")

    async def _reach(self) -> TalkT:
        """Open the link and meet the sensor; on a serial port try the usual speeds, the last good one first."""
        silence: LinkLost | None = None
        for address in self._candidates():
            link = await open_link(address, self._clock, dtr=self._dtr)
            link.tap = self.tap
            try:
                talk = await until_lost(link, self._meet(link))
            except LinkLost as error:
                link.close()
                silence = silence or error
            except BaseException:
                link.close()
                raise
            else:
                self._address, self._speed_known = address, True
                return talk
        raise silence or LinkLost(f"{self._address}: no speed to try")

    def _candidates(self) -> Iterator[Address]:
        address = self._address
        if not isinstance(address, SerialAddress):
            yield address
            return
        first = (address.baud,) if self._speed_known else ()
        yield from (replace(address, baud=baud) for baud in dict.fromkeys((*first, *self._bauds)))

    def _watch_begin_s(self) -> float:
        """Return a time for `_next_watch` to count from: together with other timers."""
        return self._clock() // _WATCH_PERIOD_S * _WATCH_PERIOD_S

    async def _next_watch(self, last_s: float) -> float:
        """Wait for the next of ten checks of the stream a second; return the time that was meant."""
        next_s = self._clear_s(max(last_s + _WATCH_PERIOD_S, self._clock()), _WATCH_SLACK_S)
        await asyncio.sleep(next_s - self._clock())
        return next_s

    def _note(self, identity: str) -> None:
        if self.health.identity not in {"", identity}:
            self.health.count("another sensor")
        self.health.identity = identity

    def _say(self, link: LinkState, message: str) -> None:
        self.health.link = link
        self.health.message = message
        self._log_changes()

    def _log_changes(self) -> None:
        """Log each change of state once; READY is set by the stream, which must not log."""
        if self.health.link is not self._logged:
            self._logged = self.health.link
            level = logging.INFO if self._logged in {LinkState.READY, LinkState.STARTING} else logging.WARNING
            _log.log(level, "lidar %s: %s", self._logged, self.health.message)
