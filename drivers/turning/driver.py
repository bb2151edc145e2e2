"""A turning lidar with a self-maintained connection: connect, identify, stream, monitor, restart, reconnect."""

import asyncio
import contextlib
import itertools
import math
import time
from abc import abstractmethod
from collections.abc import Callable
from typing import ClassVar, Final, Never

from wallride.drivers.api import Clock, DriverError, LinkLost, LinkState, Reschedule, Scan, as_wanted
from wallride.drivers.lidar import LATE_SAID_S, ConnectedLidar
from wallride.drivers.link import ByteLink, until_lost
from wallride.drivers.turning.conversation import LidarTalk
from wallride.drivers.turning.grid import AskMotion, Mount, standing
from wallride.drivers.turning.replies import Reply, decode_condition
from wallride.drivers.turning.settings import TurningSettings
from wallride.drivers.turning.stream import StreamFacts, Turning, TurnStream

FIRST_SCAN_TIMEOUT_S: Final = 4.0
"""Time from the start of a stream to its first scan and the head's usual speed: the motor needs two seconds, and two
turns settle."""
PROMPT_LINK_S: Final = 0.04
"""Round trip up to which a link counts as prompt: the sensor takes some of it to answer, and a scan that is dated too
early is as wrong as one that is dated too late."""
SPEED_CHANGED: Final = 0.2
"""Share by which the speed of the head may differ from the usual one before a status says so."""
STREAM_TIMEOUT_S: Final = 1.5
FAULT_STAYS: Final = (
    "it reports a fault that a reset does not clear (is the head blocked? power-cycle it; else have it repaired)"
)
_FAREWELL_TIMEOUT_S: Final = 0.3
_FAULT: Final = 2


class TurningLidar(ConnectedLidar[LidarTalk]):
    """A `Lidar` (see wallride.drivers.api) that turns a full circle, at a serial port or a bridge to one.

    word: its name in messages. bauds: usual speeds of the line, the likeliest first. clear_s: moves the checks of the
    stream to a better moment. motion: tells how the car moves, to take the motion out of a turn.
    """

    word: ClassVar[str]
    leaves_after: ClassVar = (asyncio.CancelledError, DriverError)

    def __init__(
        self,
        settings: TurningSettings,
        bauds: tuple[int, ...],
        *,
        clock: Clock = time.monotonic,
        clear_s: Reschedule = as_wanted,
        motion: AskMotion = standing,
    ) -> None:
        super().__init__(settings, bauds, clock, clear_s, dtr=False)  # set, it stops some motors and turns others
        self._settings = settings
        self._motion = motion
        self._mount = Mount(settings.yaw_rad, settings.mounted_upside_down)
        self._numbers = itertools.count()

    @abstractmethod
    async def _greet(self, talk: LidarTalk) -> str:
        """Quieten the sensor, whatever its state, and return its identity. LinkLost where nothing of it answers."""

    @abstractmethod
    async def _start(self, talk: LidarTalk) -> StreamFacts:
        """Start the motor and the stream of the sensor just met; DriverError with its remedy where it refuses."""

    @abstractmethod
    async def _leave(self, talk: LidarTalk) -> None:
        """Stop the stream and the motor."""

    async def _ask_stream(self, talk: LidarTalk, command: bytes, kind: int) -> Reply:
        """Return the announcement of a stream of a type."""
        try:
            return await talk.ask(command, kind, timeout_s=STREAM_TIMEOUT_S)
        except LinkLost as error:
            raise LinkLost(
                f"{talk.link.address}: it does not start measuring ({talk.heard}; is its supply strong enough?)"
            ) from error

    def _tells_fault(self, reply: Reply) -> bool:
        """Return whether a sensor reports a fault of itself; an error is counted."""
        condition = decode_condition(reply.payload)
        if condition is not None and condition.status:
            self.health.count(f"error {condition.code:#06x}")
        return condition is not None and condition.status == _FAULT

    async def _meet(self, link: ByteLink) -> LidarTalk:
        talk = LidarTalk(link)
        self._note(await self._greet(talk))
        return talk

    async def _measure(self, talk: LidarTalk, on_scan: Callable[[Scan], None]) -> Never:
        while True:
            self._say(LinkState.STARTING, f"{talk.link.address}: starting the motor and the stream")
            facts = await self._start(talk)
            link_s = talk.quickest_s if PROMPT_LINK_S < talk.quickest_s < math.inf else 0.0
            turning = Turning(self._mount, self._settings.stale_after_s, link_s, self._motion)
            stream = TurnStream(facts, turning, self.health, self._numbers.__next__, on_scan)
            started_s = self._clock()
            talk.link.listen(stream.on_bytes)
            stream.on_bytes(facts.rest, started_s)
            why = await self._watch(stream, facts, started_s)
            talk.listen()
            self._say(LinkState.FAULTY, f"{talk.link.address}: {why}")
            if stream.delivered_s is None:
                raise LinkLost(f"{talk.link.address}: {why}")
            self.health.count("restart")
            talk.quickest_s = math.inf  # the link may have become late, which the samples of a new stream do not tell
            self._note(await self._greet(talk))

    async def _watch(self, stream: TurnStream, facts: StreamFacts, started_s: float) -> str:
        """Check the stream ten times a second; return the reason for a restart."""
        next_s = self._watch_begin_s()
        usual_hz = math.nan
        while True:
            next_s = await self._next_watch(next_s)
            now_s = self._clock()
            if why := self._why_restart(stream, now_s, started_s):
                return why
            self._log_changes()
            if stream.delivered_s is None:
                continue
            self._failures = 0
            if math.isnan(usual_hz) or now_s - started_s < FIRST_SCAN_TIMEOUT_S:
                usual_hz = stream.turns_hz  # it may still spin up
            age_s = now_s - stream.delivered_s
            if stream.repetition.stored:
                self._say(LinkState.FAULTY, f"{self.word}: it repeats one turn: power-cycle it, check its cable")
            elif age_s > self._settings.degraded_after_s:
                self._say(LinkState.FAULTY, f"{self.word}: no scan for {age_s:.1f} s (cable, power, motor?)")
            elif self.health.link is LinkState.READY:
                self.health.message = _summary(facts, stream, usual_hz)

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
                await until_lost(talk.link, self._leave(talk))


def _summary(facts: StreamFacts, stream: TurnStream, usual_hz: float) -> str:
    """Return the condition of a stream that runs, in one line."""
    text = f"{facts.summary}, {stream.beams} beams, {usual_hz:.0f} Hz, {facts.range_max_m:g} m"
    if abs(stream.turns_hz - usual_hz) > SPEED_CHANGED * usual_hz:
        text += f"; its head turns at {stream.turns_hz:.1f} Hz (weak 5 V supply? something on it?)"
    if stream.late_s > LATE_SAID_S:
        text += f"; its scans come {stream.late_s:.2f} s late (network? a busy computer?)"
    return text
