"""Requests to a sensor over an open link: quieten it, read its identity. Every wait is bounded."""

import asyncio
import contextlib
from collections.abc import Callable, Coroutine
from dataclasses import dataclass
from typing import Any, Final, TypeVar

from drivers.api import LinkLost, ProtocolError
from drivers.hokuyo.codec import ReplyBlock, ScipDeframer, command
from drivers.hokuyo.replies import SensorParameters, fields, is_healthy
from drivers.link import ByteLink

T = TypeVar("T")

REPLY_TIMEOUT_S: Final = 0.3
"""Maximum wait for a reply. Vendor code waits 140 ms; twice that allows for a busy computer."""
SETTLE_S: Final = 0.15
_QUIETEN_TRIES: Final = 4
_IDENTIFY_TRIES: Final = 3


class Conversation:
    """One request at a time; replies are distinguished from a running stream by their echo."""

    def __init__(self, link: ByteLink, count: Callable[[str], None]) -> None:
        self.link = link
        self.deframer = ScipDeframer(count)
        self._question = b""
        self._answer: asyncio.Future[ReplyBlock] | None = None
        self.listen()

    def listen(self) -> None:
        """Take the link's bytes (back) from their last reader."""
        self.link.listen(self._on_bytes)

    async def ask(self, line: bytes, *, timeout_s: float = REPLY_TIMEOUT_S) -> ReplyBlock:
        """Send a command line and return the block that echoes it; all else is dropped. LinkLost if none comes."""
        self._question = line.rstrip(b"\n")
        self._answer = asyncio.get_running_loop().create_future()
        try:
            self.link.write(line)
            async with asyncio.timeout(timeout_s):
                return await self._answer
        except TimeoutError as error:
            question = self._question.decode("ascii")
            raise LinkLost(
                f"{self.link.address}: no answer to {question} within {timeout_s:g} s (a Hokuyo? baud rate? power?)"
            ) from error
        finally:
            self._answer = None

    async def ask_patiently(self, line: bytes, *, tries: int) -> ReplyBlock:
        """Repeat a request without a reply; the last failure is raised. `until_lost` ends it when the link is lost."""
        for _ in range(tries - 1):
            with contextlib.suppress(LinkLost):
                return await self.ask(line)
        return await self.ask(line)

    def _on_bytes(self, chunk: bytes, _read_at_s: float) -> None:
        for block in self.deframer.feed(chunk):
            if self._answer is not None and not self._answer.done() and block.echo == self._question:
                self._answer.set_result(block)


async def until_lost(link: ByteLink, work: Coroutine[Any, Any, T]) -> T:
    """Do the work, or raise LinkLost as soon as the link is lost; none of it is left running."""
    lost = asyncio.ensure_future(link.lost())
    working = asyncio.ensure_future(work)
    try:
        await asyncio.wait((lost, working), return_when=asyncio.FIRST_COMPLETED)
        if lost.done() and not working.done():
            lost.result()
        return await working
    finally:
        lost.cancel()
        working.cancel()
        await asyncio.gather(lost, working, return_exceptions=True)


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
