"""A telemetry subscriber: what the runtime says about itself over zenoh, newest value per topic."""

import asyncio
import struct
from collections.abc import Mapping
from typing import Any

from runtime import wire, zenoh_config
from runtime.bus import Bus

CONNECT_TIMEOUT_S = 15.0
RETRY_S = 0.1
TOPICS = (wire.STATUS, wire.DISTANCE_ERROR)
"""Only what is shown: whatever is subscribed to, the runtime has to write."""
_FLOAT32 = struct.Struct("<4xf")


class Listener:
    """Subscribes to one car at a known endpoint.

    latest: the newest message of each topic; `distance_error` as {"error_m": metres}.
    """

    def __init__(self, endpoint: str, car: str) -> None:
        self._endpoint = endpoint
        self._prefix = wire.key(car, "")
        self.latest: dict[str, Mapping[str, Any]] = {}

    async def run(self) -> None:
        """Connect as soon as the runtime listens, then listen until cancelled."""
        bus = Bus(zenoh_config.client_config(self._endpoint, None))
        for topic in TOPICS:
            bus.subscribe(self._prefix + topic, self._on_sample)
        try:
            if await self._opened(bus):
                await asyncio.get_running_loop().create_future()
        finally:
            await bus.close()

    async def _opened(self, bus: Bus) -> bool:
        loop = asyncio.get_running_loop()
        give_up_s = loop.time() + CONNECT_TIMEOUT_S
        while loop.time() < give_up_s:
            try:
                await bus.open()
            except OSError:
                await asyncio.sleep(RETRY_S)
            else:
                return True
        return False

    def _on_sample(self, key: str, payload: bytes, _arrival_s: float) -> None:
        topic = key.removeprefix(self._prefix)
        if topic == wire.DISTANCE_ERROR:
            (error_m,) = _FLOAT32.unpack(payload)
            self.latest[topic] = {"error_m": error_m}
        else:
            self.latest[topic] = wire.decode(payload)
