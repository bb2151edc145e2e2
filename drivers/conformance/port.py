"""A port on loopback behind which an emulated device speaks, with the faults of a cable."""

import asyncio
from collections.abc import Callable, Coroutine
from typing import Any

Feed = Callable[[bytes, float], bytes]
"""Takes bytes of the driver and the monotonic time of their arrival; returns the device's answer."""
HOST = "127.0.0.1"
TEST_S = 60.0


def now_s() -> float:
    """Return the time of the running loop, which is the monotonic clock; a loop of a test may have its own."""
    return asyncio.get_running_loop().time()


def run_test(work: Coroutine[Any, Any, None]) -> None:
    """Run a test to its end. What a driver leaves running is not waited for: it may be what the test found."""

    async def in_time() -> None:
        async with asyncio.timeout(TEST_S):
            await work

    loop = asyncio.new_event_loop()
    try:
        loop.run_until_complete(in_time())
    finally:
        left = asyncio.all_tasks(loop)
        for task in left:
            task.cancel()
        if left:
            loop.run_until_complete(asyncio.wait(left, timeout=0.2))
        loop.close()


class EmulatorPort:
    """One TCP port for one client.

    silence: what comes is lost, and nothing is sent. dribble: one byte at a time.
    """

    def __init__(self, feed: Feed) -> None:
        self.silence = self.dribble = False
        self._feed = feed
        self._server: asyncio.Server | None = None
        self._writer: asyncio.StreamWriter | None = None
        self._number = 0
        self._held: list[bytes] | None = None

    @property
    def address(self) -> str:
        """Return the address for the driver's settings; the same after `replug`."""
        return f"tcp://{HOST}:{self._number}"

    @property
    def connected(self) -> bool:
        """Return whether a driver is connected."""
        return self._writer is not None and not self._writer.is_closing()

    async def start(self) -> None:
        """Listen."""
        self._server = await asyncio.start_server(self._serve, HOST, self._number)
        self._number = self._server.sockets[0].getsockname()[1]

    async def unplug(self) -> None:
        """Close the connection and refuse others."""
        if self._server is not None:
            self._server.close()
            self._server = None
        if self._writer is not None:
            self._writer.transport.abort()
            self._writer = None

    async def replug(self) -> None:
        """Accept connections again."""
        await self.unplug()
        await self.start()

    def hold(self) -> None:
        """Keep what the device sends until `release`, as a stalled link does."""
        self._held = self._held or []

    def release(self) -> None:
        """Send what was held, in one burst."""
        held, self._held = self._held or [], None
        self.send(b"".join(held))

    def send(self, data: bytes) -> None:
        """Send bytes to the driver; lost while there is none."""
        if self._held is not None:
            self._held.append(data)
        elif self.connected and not self.silence and self._writer is not None:
            for chunk in (data[at : at + 1] for at in range(len(data))) if self.dribble else (data,):
                self._writer.write(chunk)

    async def _serve(self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        if self._writer is not None:
            self._writer.transport.abort()
        self._writer = writer
        try:
            while data := await reader.read(4096):
                if not self.silence and (answer := self._feed(data, now_s())):
                    self.send(answer)
        except ConnectionError:
            pass
        finally:
            writer.close()
            if self._writer is writer:
                self._writer = None
