"""Requests to a sensor over an open link: quieten it, read its identity and its clock. Every wait is bounded."""

import asyncio
import contextlib
import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Final

from wallride.drivers.api import LinkLost, ProtocolError
from wallride.drivers.hokuyo.codec import ReplyBlock, ScipDeframer, command
from wallride.drivers.hokuyo.replies import SensorParameters, decode_number, fields, is_healthy
from wallride.drivers.hokuyo.timing import ClockReading
from wallride.drivers.link import ByteLink

REPLY_TIMEOUT_S: Final = 0.3
"""Maximum wait for a reply. Vendor code waits 140 ms; twice that allows for a busy computer."""
SETTLE_S: Final = 0.15
_QUIETEN_TRIES: Final = 4
_IDENTIFY_TRIES: Final = 3
_CLOCK_READINGS: Final = 3
_PROMPT_S: Final = 0.005
"""Round trip of a clock reading that needs no better one."""


class Conversation:
    """One request at a time; replies are distinguished from a running stream by their echo.

    asked_s, answered_s: when the last answered request was first sent, and when its reply was read.
    quickest_s: the shortest such round trip since it was last set to infinity. No byte of the sensor takes longer to
        arrive, as long as the link stays as it is.
    """

    def __init__(self, link: ByteLink, count: Callable[[str], None]) -> None:
        self.link = link
        self.deframer = ScipDeframer(count)
        self.asked_s = self.answered_s = -math.inf
        self.quickest_s = math.inf
        self._question = b""
        self._answer: asyncio.Future[ReplyBlock] | None = None
        self.listen()

    def listen(self) -> None:
        """Take the link's bytes (back) from their last reader."""
        self.link.listen(self._on_bytes)

    async def ask(self, line: bytes, *, timeout_s: float = REPLY_TIMEOUT_S) -> ReplyBlock:
        """Send a command line and return the block that echoes it; all else is dropped. LinkLost if none comes."""
        return await self._ask(line, timeout_s, self.link.clock())

    async def _ask(self, line: bytes, timeout_s: float, first_asked_s: float) -> ReplyBlock:
        self._question = line.rstrip(b"\n")
        self._answer = asyncio.get_running_loop().create_future()
        try:
            self.link.write(line)
            async with asyncio.timeout(timeout_s):
                reply = await self._answer
            self.asked_s = first_asked_s
            self.quickest_s = min(self.quickest_s, self.answered_s - first_asked_s)
            return reply
        except TimeoutError as error:
            question = self._question.decode("ascii")
            raise LinkLost(
                f"{self.link.address}: no answer to {question} within {timeout_s:g} s (a Hokuyo? baud rate? power?)"
            ) from error
        finally:
            self._answer = None

    async def ask_patiently(self, line: bytes, *, tries: int) -> ReplyBlock:
        """Repeat a request without a reply; the last failure is raised. `until_lost` ends it when the link is lost.

        On a late link the reply to one try comes during the next: the round trip counts from the first.
        """
        first_asked_s = self.link.clock()
        for _ in range(tries - 1):
            with contextlib.suppress(LinkLost):
                return await self._ask(line, REPLY_TIMEOUT_S, first_asked_s)
        return await self._ask(line, REPLY_TIMEOUT_S, first_asked_s)

    def _on_bytes(self, chunk: bytes, read_at_s: float) -> None:
        for block in self.deframer.feed(chunk):
            if self._answer is not None and not self._answer.done() and block.echo == self._question:
                self.answered_s = read_at_s
                self._answer.set_result(block)


async def quieten(talk: Conversation) -> None:
    """Bring a sensor in any state to SCIP 2 with the laser off: it may be streaming, in time-sync mode, or in SCIP 1.1.

    The recipe of urg_library 1.2.7: an empty line ends a half-sent command, then all input is dropped for a while.
    """
    talk.link.write(b"\n")
    await asyncio.sleep(SETTLE_S)
    talk.deframer.reset()
    for _ in range(_QUIETEN_TRIES):
        reply = await talk.ask_patiently(command("QT"), tries=2)
        if reply.status in {"00", "0"}:
            return
        if len(reply.status) == 1:
            await talk.ask_patiently(command("SCIP2.0"), tries=2)
        else:
            await talk.ask_patiently(command("TM2"), tries=2)
    raise ProtocolError(
        f"{talk.link.address}: QT is answered with status {reply.status} again and again (power-cycle it)"
    )


@dataclass(frozen=True, slots=True)
class SensorIdentity:
    """Identity of the sensor. state_text: STAT of II, "" when the sensor does not report it. untold: what it kept."""

    parameters: SensorParameters
    firmware: str
    serial: str
    state_text: str
    untold: tuple[str, ...] = ()

    @property
    def name(self) -> str:
        """Model, firmware and serial number in one line."""
        details = [("firmware", self.firmware), ("serial", self.serial)]
        return ", ".join([self.parameters.model, *(f"{what} {text}" for what, text in details if text)])

    @property
    def summary(self) -> str:
        """Identity of a healthy sensor in one line; with its own state text when it does not report itself healthy."""
        parameters = self.parameters
        text = f"{parameters.model}, {parameters.beam_count} beams, {parameters.rate_hz:g} Hz"
        if self.state_text and not is_healthy(self.state_text):
            text += f"; it says of itself: {self.state_text}"
        return "".join([text, *(f"; it does not tell its {what}" for what in self.untold)])


async def identify(talk: Conversation) -> SensorIdentity:
    """Query a quiet sensor for PP, VV and II. PP must be complete; the other two are for people."""
    version = await _told(talk, "VV", tries=_IDENTIFY_TRIES)
    reply = await talk.ask_patiently(command("PP"), tries=_IDENTIFY_TRIES)
    if reply.status != "00":
        raise ProtocolError(f"{talk.link.address}: PP is refused with status {reply.status} (power-cycle it)")
    parameters = SensorParameters.from_fields(fields(reply))
    state = await _told(talk, "II", tries=1)
    untold = tuple(what for what, told in (("version (VV)", version), ("state (II)", state)) if not told)
    return SensorIdentity(parameters, version.get("FIRM", ""), version.get("SERI", ""), state.get("STAT", ""), untold)


async def _told(talk: Conversation, line: str, *, tries: int) -> dict[str, str]:
    """Return what the sensor tells; nothing where no whole reply comes."""
    try:
        return fields(await talk.ask_patiently(command(line), tries=tries))
    except LinkLost:
        return {}


async def read_clock(talk: Conversation) -> ClockReading | None:
    """Read a quiet sensor's counter (TM0, TM1, TM2); None when it does not tell it. It is left ready to measure."""
    try:
        if (await talk.ask(command("TM0"))).status not in {"00", "02"}:
            return None
        reading = await _best_reading(talk)
        await talk.ask(command("TM2"))
    except LinkLost:  # of a lost link, the write raises it again
        talk.link.write(command("TM2"))  # should it have heard the rest
        return None
    return reading


async def _best_reading(talk: Conversation) -> ClockReading | None:
    best: ClockReading | None = None
    for _ in range(_CLOCK_READINGS):
        reply = await talk.ask(command("TM1"))  # never repeated: a late reply would pass as that to the next
        sensor_ms = decode_number(reply.lines[0]) if reply.status == "00" and len(reply.lines) == 1 else None
        if sensor_ms is None or len(reply.lines[0]) != 4:
            break
        reading = ClockReading(sensor_ms, talk.asked_s, talk.answered_s)
        if best is None or reading.round_trip_s < best.round_trip_s:
            best = reading
        if best.round_trip_s <= _PROMPT_S:
            break
    return best
