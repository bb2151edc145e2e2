"""A connection to a VESC for its settings: requests with replies, and no motor command ever.

The port is opened exclusively, so that no program that drives has it meanwhile.
"""

import asyncio
import time
from typing import Final, Self

from wallride.drivers.address import Address
from wallride.drivers.api import LinkLost, printable
from wallride.drivers.link import ByteLink, open_link
from wallride.drivers.vesc import codec, replies
from wallride.drivers.vesc.codec import Packet

ANSWER_S: Final = 1.0
ASKED_TIMES: Final = 3
WRITTEN_S: Final = 6.0
"""Patience for the reply to a write: the controller may erase a page of its flash memory first."""


class VescSettingsLink:
    """A VESC at the other end of a cable. said: lines of text that it printed meanwhile.

    Every method raises LinkLost where the cable is gone.
    """

    def __init__(self, link: ByteLink) -> None:
        self._link = link
        self._deframer = codec.VescDeframer()
        self._awaited: tuple[int, asyncio.Future[bytes]] | None = None
        self.said: list[str] = []
        link.listen(self._on_bytes)

    @classmethod
    async def open(cls, address: Address) -> Self:
        """Open the port; LinkLost with the obstacle and its remedy."""
        return cls(await open_link(address, time.monotonic))

    def close(self) -> None:
        """Release the port; harmless when repeated."""
        self._link.close()

    async def firmware(self) -> replies.Firmware | None:
        """Return what it says of itself; None where nothing there answers like a VESC."""
        payload = await self.ask(codec.plain(Packet.FW_VERSION))
        return None if payload is None else replies.decode_firmware(payload)

    async def values(self) -> replies.Values | None:
        """Return its values; None where it does not answer, or in the layout before firmware 3."""
        payload = await self.ask(codec.plain(Packet.GET_VALUES))
        return None if payload is None else replies.decode_values(payload)

    async def app_config(self) -> bytes | None:
        """Return its application configuration, from the signature on; None without an answer."""
        payload = await self.ask(codec.plain(Packet.GET_APPCONF))
        return None if payload is None else payload[1:]

    async def write_app_config(self, configuration: bytes) -> bool:
        """Let it take and store a configuration; False where it does not confirm that."""
        request = codec.plain(Packet.SET_APPCONF) + configuration
        return await self._ask_once(request, WRITTEN_S) is not None

    async def ask(self, request: bytes) -> bytes | None:
        """Return the reply with the request's packet id; None after several requests without one."""
        for _ in range(ASKED_TIMES):
            if (payload := await self._ask_once(request, ANSWER_S)) is not None:
                return payload
        return None

    async def _ask_once(self, request: bytes, patience_s: float) -> bytes | None:
        answer: asyncio.Future[bytes] = asyncio.get_running_loop().create_future()
        lost = asyncio.ensure_future(self._link.lost())
        self._awaited = request[0], answer
        try:
            self._link.write(codec.frame(request))
            await asyncio.wait((answer, lost), timeout=patience_s, return_when=asyncio.FIRST_COMPLETED)
            if answer.done():
                return answer.result()
            if lost.done():
                lost.result()
            return None
        finally:
            self._awaited = None
            lost.cancel()

    def _on_bytes(self, chunk: bytes, _read_at_s: float) -> None:
        for payload in self._deframer.feed(chunk):
            if payload[0] == Packet.PRINT:
                self.said.append(printable(payload[1:].rstrip(b"\0\n ")))
            elif self._awaited is not None and payload[0] == self._awaited[0] and not self._awaited[1].done():
                self._awaited[1].set_result(payload)


async def read_app_config(address: Address) -> bytes | None:
    """Return a VESC's application configuration, from the signature on; None where it cannot be had."""
    try:
        link = await VescSettingsLink.open(address)
    except LinkLost:
        return None
    try:
        return await link.app_config()
    except LinkLost:
        return None
    finally:
        link.close()
