"""A radio link between operator and car: a TCP relay on loopback that can be made to stall, and recovers in a burst."""

import asyncio
import contextlib
import time

COMMAND_BYTES = 60
"""A command is longer than this on the wire; zenoh's own signs of life are not."""


class Radio:
    """Relays bytes while it works; while it is stalled it keeps them, and brings them all late, in one burst.

    last_command_s: when it last brought something of a command's size to the car.
    """

    def __init__(self, car_port: int) -> None:
        self._car_port = car_port
        self.last_command_s = 0.0
        self._server: asyncio.Server | None = None
        self._works = asyncio.Event()
        self._works.set()
        self._relays: set[asyncio.Task[None]] = set()

    @property
    def endpoint(self) -> str:
        """Where the operator connects."""
        assert self._server is not None
        return f"tcp/127.0.0.1:{self._server.sockets[0].getsockname()[1]}"

    async def start(self) -> None:
        """Listen."""
        self._server = await asyncio.start_server(self._relay, "127.0.0.1", 0)

    def stall(self) -> None:
        """Let nothing through from now on, in either direction."""
        self._works.clear()

    def recover(self) -> None:
        """Let everything through that waited."""
        self._works.set()

    async def close(self) -> None:
        """Cut every connection."""
        assert self._server is not None
        self._server.close()
        for relay in self._relays:
            relay.cancel()
        await asyncio.gather(*self._relays, return_exceptions=True)

    async def _relay(self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        to_car = await asyncio.open_connection("127.0.0.1", self._car_port)
        pipes = [
            asyncio.create_task(self._pipe(reader, to_car[1], to_car=True)),
            asyncio.create_task(self._pipe(to_car[0], writer, to_car=False)),
        ]
        for pipe in pipes:
            self._relays.add(pipe)
            pipe.add_done_callback(self._relays.discard)

    async def _pipe(self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter, *, to_car: bool) -> None:
        with contextlib.suppress(ConnectionError), contextlib.closing(writer):
            while data := await reader.read(65536):
                await self._works.wait()
                writer.write(data)
                if to_car and len(data) > COMMAND_BYTES:
                    self.last_command_s = time.monotonic()
                await writer.drain()
