"""Requests to a turning lidar over an open link: one at a time, every wait bounded. And what else was heard there."""

import asyncio
import contextlib
import math
from typing import Final

from wallride.drivers.api import LinkLost
from wallride.drivers.link import ByteLink
from wallride.drivers.turning.replies import Reply, ReplyDeframer

REPLY_TIMEOUT_S: Final = 0.3
QUIET_S: Final = 0.03
"""Time without a byte after which a line counts as quiet."""
_QUIET_WITHIN_S: Final = 0.6
_HEARD_BYTES: Final = 256
_MIN_HEARD_BYTES: Final = 8


class LidarTalk:
    """One request at a time; everything that is no reply to it is dropped, except as a sign of what is on the port.

    quickest_s: the shortest round trip so far; infinity before the first.
    """

    def __init__(self, link: ByteLink) -> None:
        self.link = link
        self.quickest_s = math.inf
        self._deframer = ReplyDeframer()
        self._kinds: tuple[int, ...] = ()
        self._answer: asyncio.Future[Reply] | None = None
        self._heard = b""
        self._heard_s = -math.inf
        self._rest: list[bytes] = []
        self.listen()

    def listen(self) -> None:
        """Take the link's bytes (back) from their last reader."""
        self._deframer.reset()
        self.link.listen(self._on_bytes)

    def take_rest(self) -> bytes:
        """Return the bytes that followed the announcement of a stream, once."""
        rest, self._rest = b"".join(self._rest), []
        return rest

    async def ask(self, command: bytes, *kinds: int, timeout_s: float = REPLY_TIMEOUT_S) -> Reply:
        """Send a command and return the reply of one of these types. LinkLost, with what was heard, if none comes."""
        self._deframer.reset()
        self._heard, self._rest, self._kinds = b"", [], kinds
        self._answer = asyncio.get_running_loop().create_future()
        asked_s = self.link.clock()
        try:
            self.link.write(command)
            async with asyncio.timeout(timeout_s):
                reply = await self._answer
        except TimeoutError as error:
            raise LinkLost(f"{self.link.address}: no answer to {command.hex(' ')}: {self.heard}") from error
        finally:
            self._kinds, self._answer = (), None
        if not reply.streams:  # a stream is announced when the motor turns
            self.quickest_s = min(self.quickest_s, self.link.clock() - asked_s)
        return reply

    async def ask_patiently(self, command: bytes, *kinds: int, tries: int, timeout_s: float = REPLY_TIMEOUT_S) -> Reply:
        """Repeat a request without a reply; the last failure is raised. `until_lost` ends it when the link is lost."""
        for _ in range(tries - 1):
            with contextlib.suppress(LinkLost):
                return await self.ask(command, *kinds, timeout_s=timeout_s)
        return await self.ask(command, *kinds, timeout_s=timeout_s)

    async def become_quiet(self) -> None:
        """Wait until no more bytes come, for a while at most; what has come is dropped."""
        until_s = self.link.clock() + _QUIET_WITHIN_S
        while (  # noqa: ASYNC110 - it waits for nothing to happen
            self.link.clock() < until_s and self.link.clock() - self._heard_s < QUIET_S
        ):
            await asyncio.sleep(QUIET_S / 2)
        self._deframer.reset()
        self._heard = b""

    @property
    def heard(self) -> str:
        """What the port sent instead of an answer, in words, with the usual remedy."""
        return describe(self._heard)

    def _on_bytes(self, chunk: bytes, read_at_s: float) -> None:
        self._heard_s = read_at_s
        self._heard = (self._heard + chunk)[-_HEARD_BYTES:]
        if self._answer is None or self._answer.done():
            if self._answer is not None:
                self._rest.append(chunk)
            return
        for reply in self._deframer.feed(chunk):
            if reply.kind in self._kinds and not self._answer.done():
                self._answer.set_result(reply)
                if reply.streams:
                    self._rest = [self._deframer.rest]


def describe(raw: bytes) -> str:
    """Return what bytes that are no reply say about the device on a port."""
    if not raw:
        return "nothing came (power? cable? another speed of the line?)"
    if not raw.strip(b"\0"):
        return "only zero bytes came (weak 5 V supply? a broken adapter? another speed of the line?)"
    if raw.count(b"\xaa\x55") >= 2:  # once may be by chance
        return 'scan packets of a YDLIDAR came (lidar.driver = "ydlidar"; of one that does not answer, lidar.model)'
    if b"\xa5\x5a" in raw:
        return "a reply to something else came (another program's? power-cycle it)"
    if any(word in raw for word in (b"RPLIDAR", b"LIDAR System")):
        return "the greeting of a starting RPLIDAR came"
    if raw.count(b"\n\n") and raw.isascii():
        return 'text came, as a Hokuyo sends it (lidar.driver = "hokuyo")'
    if len(raw) < _MIN_HEARD_BYTES:
        return "a few stray bytes came (power? another speed of the line?)"
    return "other bytes came (another device? another speed of the line? a stream that does not stop)"
