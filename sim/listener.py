"""A telemetry subscriber: what the runtime says about itself over zenoh, newest value per topic."""

import asyncio
import json
from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

from runtime import wire

if TYPE_CHECKING:
    import zenoh

CONNECT_TIMEOUT_S = 15.0
RETRY_S = 0.1


class Listener:
    """Subscribes to one car at a known endpoint.

    latest: the newest message of each topic.
    """

    def __init__(self, endpoint: str, car: str) -> None:
        self._endpoint = endpoint
        self._prefix = wire.key(car, "")
        self._session: zenoh.Session | None = None
        self._subscriber: zenoh.Subscriber[None] | None = None
        self.latest: dict[str, Mapping[str, Any]] = {}

    async def run(self) -> None:
        """Connect as soon as the runtime listens, then listen until cancelled."""
        try:
            self._session = await self._connect()
            if self._session is not None:
                self._subscriber = self._session.declare_subscriber(f"{self._prefix}**", self._on_sample)
                await asyncio.get_running_loop().create_future()
        finally:
            if self._session is not None:
                await asyncio.to_thread(self._session.close)

    async def _connect(self) -> "zenoh.Session | None":
        loop = asyncio.get_running_loop()
        give_up_s = loop.time() + CONNECT_TIMEOUT_S
        while loop.time() < give_up_s:
            try:
                return await asyncio.to_thread(_open_client, self._endpoint)
            except ConnectionError:
                await asyncio.sleep(RETRY_S)
        return None

    def _on_sample(self, sample: "zenoh.Sample") -> None:
        # zenoh's own thread: a single dictionary store is atomic, and nothing else is touched here.
        topic = str(sample.key_expr).removeprefix(self._prefix)
        self.latest[topic] = wire.decode(sample.payload.to_bytes())


def _open_client(endpoint: str) -> "zenoh.Session":
    """Open a client session; ConnectionError while nobody listens there."""
    import zenoh

    config = {
        "mode": "client",
        "connect": {"endpoints": [endpoint], "timeout_ms": 1000},
        "scouting": {"multicast": {"enabled": False}},
    }
    try:
        return zenoh.open(zenoh.Config.from_json5(json.dumps(config)))
    except zenoh.ZError as error:
        raise ConnectionError(str(error)) from error
