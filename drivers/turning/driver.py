"""A turning lidar with a self-maintained connection: connect, identify, stream, monitor, restart, reconnect."""

import asyncio
import contextlib
import logging
import math
import time
from collections.abc import Callable, Iterator
from dataclasses import replace
from typing import Final, Never, Protocol

from wallride.drivers.address import Address, SerialAddress, parse_address
from wallride.drivers.api import (
    Clock,
    DriverError,
    Health,
    LinkLost,
    LinkState,
    ProtocolError,
    Reschedule,
    Scan,
    as_wanted,
)
from wallride.drivers.link import Tap, open_link, until_lost
from wallride.drivers.turning.conversation import LidarTalk
from wallride.drivers.turning.grid import AskMotion, Mount, standing
from wallride.drivers.turning.settings import TurningSettings
from wallride.drivers.turning.stream import StreamFacts, Turning, TurnStream

_log = logging.getLogger(__name__)

RETRY_DELAYS_S: Final = (0.1, 0.5, 1.0, 2.0)
"""Delays of the reconnection attempts. The first is short because most losses are a restart; the last one repeats."""
FIRST_SCAN_TIMEOUT_S: Final = 4.0
"""Time from the start of a stream to its first scan: the motor needs two seconds, and two turns settle."""
PROMPT_LINK_S: Final = 0.04
"""Round trip up to which a link counts as prompt: the sensor takes some of it to answer, and a scan that is dated too
early is as wrong as one that is dated too late."""
LATE_SAID_S: Final = 0.05
"""Delay from which a status says that the scans come late."""
SPEED_CHANGED: Final = 0.2
"""Share by which the speed of the head may differ from that at the start before a status says so."""
_WATCH_PERIOD_S: Final = 0.1
_WATCH_SLACK_S: Final = 0.02
_FAREWELL_TIMEOUT_S: Final = 0.3


class Kind(Protocol):
    """What is different in one kind of turning lidar.

    word: its name in messages. bauds: usual speeds of the line, the likeliest first. dtr: state of that line at the
    opening of the port.
    """

    word: str
    bauds: tuple[int, ...]
    dtr: bool

    async def meet(self, talk: LidarTalk, count: Callable[[str], None]) -> str:
        """Quieten the sensor, whatever its state, and return its identity. LinkLost where nothing of it answers."""
        ...

    async def start(self, talk: LidarTalk, count: Callable[[str], None]) -> StreamFacts:
        """Start the motor and the stream of the sensor just met; DriverError with its remedy where it refuses."""
        ...

    async def leave(self, talk: LidarTalk) -> None:
        """Stop the stream and the motor."""
        ...


class TurningLidar:
    """A `Lidar` (see wallride.drivers.api) that turns a full circle, at a serial port or a bridge to one.

    clear_s: moves the checks of the stream to a better moment. motion: tells how the car moves, to take the motion out
    of a turn.
    """

    def __init__(
        self,
        kind: Kind,
        settings: TurningSettings,
        *,
        clock: Clock = time.monotonic,
        clear_s: Reschedule = as_wanted,
        motion: AskMotion = standing,
    ) -> None:
        self._kind = kind
        self._settings = settings
        self._clock = clock
        self._clear_s = clear_s
        self._motion = motion
        self._mount = Mount(settings.yaw_rad, settings.mounted_upside_down)
        self._health = Health()
        self._address = parse_address(settings.address)
        self._found = False
        self._logged = self._health.link
        self._failures = 0
        self._next_number = 0
        self._talk: LidarTalk | None = None
        self.tap: Tap | None = None

    @property
    def health(self) -> Health:
        """Its present condition."""
        return self._health

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
            self._health.count("reconnect")

    async def _serve(self, on_scan: Callable[[Scan], None]) -> Never:
        """Use one connection until it is lost."""
        self._talk = talk = await self._reach()
        try:
            await until_lost(talk.link, self._measure(talk, on_scan))
        except asyncio.CancelledError:
            await self._say_goodbye(talk)
            raise
        except DriverError:
            await self._say_goodbye(talk)
            raise
        finally:
            talk.link.close()
        raise AssertionError("unreachable: measuring never ends by itself")

    async def _reach(self) -> LidarTalk:
        """Open the link and meet the sensor; on a serial port try the usual speeds, the last good one first."""
        silence: LinkLost | None = None
        for address in self._candidates():
            link = await open_link(address, self._clock, dtr=self._kind.dtr)
            link.tap = self.tap
            talk = LidarTalk(link)
            try:
                identity = await until_lost(link, self._kind.meet(talk, self._health.count))
            except LinkLost as error:
                link.close()
                silence = silence or error
            except BaseException:
                link.close()
                raise
            else:
                self._address, self._found = address, True
                self._note(identity)
                return talk
        raise silence or LinkLost(f"{self._address}: no speed to try")

    def _candidates(self) -> Iterator[Address]:
        address = self._address
        if not isinstance(address, SerialAddress):
            yield address
            return
        named = self._found or "baud=" in self._settings.address
        first = (address.baud,) if named else ()
        yield from (replace(address, baud=baud) for baud in dict.fromkeys((*first, *self._kind.bauds)))

    async def _measure(self, talk: LidarTalk, on_scan: Callable[[Scan], None]) -> Never:
        """Stream, and restart the stream as long as a restart brings scans."""
        while True:
            self._say(LinkState.STARTING, f"{talk.link.address}: starting the motor and the stream")
            facts = await self._kind.start(talk, self._health.count)
            link_s = talk.quickest_s if PROMPT_LINK_S < talk.quickest_s < math.inf else 0.0
            turning = Turning(self._mount, self._settings.stale_after_s, link_s, self._motion)
            stream = TurnStream(facts, turning, self._health, self._take_number, on_scan)
            started_s = self._clock()
            talk.link.listen(stream.on_bytes)
            stream.on_bytes(facts.rest, started_s)
            why = await self._watch(stream, facts, started_s)
            talk.listen()
            self._say(LinkState.FAULTY, f"{talk.link.address}: {why}")
            if stream.delivered_s is None:
                raise LinkLost(f"{talk.link.address}: {why}")
            self._health.count("restart")
            self._note(await self._kind.meet(talk, self._health.count))

    async def _watch(self, stream: TurnStream, facts: StreamFacts, started_s: float) -> str:
        """Check the stream ten times a second; return the reason for a restart."""
        next_s = self._clock() // _WATCH_PERIOD_S * _WATCH_PERIOD_S  # together with other timers
        usual_hz = math.nan
        while True:
            next_s = self._clear_s(max(next_s + _WATCH_PERIOD_S, self._clock()), _WATCH_SLACK_S)
            await asyncio.sleep(next_s - self._clock())
            now_s = self._clock()
            if why := self._why_restart(stream, now_s, started_s):
                return why
            self._log_changes()
            if stream.delivered_s is None:
                continue
            self._failures = 0
            usual_hz = stream.turns_hz if math.isnan(usual_hz) else usual_hz
            age_s = now_s - stream.delivered_s
            if stream.repetition.stored:
                self._say(LinkState.FAULTY, f"{self._kind.word}: it repeats one turn: power-cycle it, check its cable")
            elif age_s > self._settings.degraded_after_s:
                self._say(LinkState.FAULTY, f"{self._kind.word}: no scan for {age_s:.1f} s (cable, power, motor?)")
            elif self._health.link is LinkState.READY:
                self._health.message = _summary(facts, stream, usual_hz)

    def _why_restart(self, stream: TurnStream, now_s: float, started_s: float) -> str:
        silent_s = self._settings.silent_after_s
        if stream.heard_s is None:
            late = now_s - started_s > max(FIRST_SCAN_TIMEOUT_S, silent_s)
            return "it was started, but no whole turn came (does its head turn? power-cycle it)" if late else ""
        if now_s - stream.heard_s > silent_s:
            return f"no whole turn for {now_s - stream.heard_s:.1f} s (is the head blocked? cable, power)"
        if stream.repetition.stored:
            return ""  # a restart would let the car go on for another REPEATED_M
        unused_s = now_s - (started_s if stream.delivered_s is None else stream.delivered_s)
        if unused_s > 2 * silent_s and (stream.delivered_s is not None or unused_s > FIRST_SCAN_TIMEOUT_S):
            if not stream.beams:
                return (
                    f"too few samples in a turn at {stream.turns_hz:.1f} Hz for a scan (a slower head? another mode?)"
                )
            return f"for {unused_s:.1f} s no usable scan; the last came {stream.late_s:.2f} s late (a busy computer?)"
        return ""

    async def _say_goodbye(self, talk: LidarTalk) -> None:
        """Stop stream and motor before closing; a link that is lost takes no command."""
        talk.listen()
        with contextlib.suppress(LinkLost, TimeoutError):
            async with asyncio.timeout(_FAREWELL_TIMEOUT_S):
                await until_lost(talk.link, self._kind.leave(talk))

    def _take_number(self) -> int:
        number, self._next_number = self._next_number, self._next_number + 1
        return number

    def _note(self, identity: str) -> None:
        if self._health.identity not in {"", identity}:
            self._health.count("another sensor")
        self._health.identity = identity

    def _say(self, link: LinkState, message: str) -> None:
        self._health.link = link
        self._health.message = message
        self._log_changes()

    def _log_changes(self) -> None:
        """Log each change of state once; READY is set by the stream, which must not log."""
        if self._health.link is not self._logged:
            self._logged = self._health.link
            level = logging.INFO if self._logged in {LinkState.READY, LinkState.STARTING} else logging.WARNING
            _log.log(level, "lidar %s: %s", self._logged, self._health.message)


def _summary(facts: StreamFacts, stream: TurnStream, usual_hz: float) -> str:
    """Return the condition of a stream that runs, in one line."""
    text = f"{facts.summary}, {stream.beams} beams, {usual_hz:.0f} Hz, {facts.range_max_m:g} m"
    if abs(stream.turns_hz - usual_hz) > SPEED_CHANGED * usual_hz:
        text += f"; its head turns at {stream.turns_hz:.1f} Hz (weak 5 V supply? something on it?)"
    if stream.late_s > LATE_SAID_S:
        text += f"; its scans come {stream.late_s:.2f} s late (network? a busy computer?)"
    return text
