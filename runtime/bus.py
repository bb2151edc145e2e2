"""The zenoh session of the car: opened in a thread, never blocking, never in the way of driving.

The only module of the car that imports zenoh, and it does so late, because a car must be able to stop before it can
talk. Loopback only until keys exist; the car is its own router, so that users install nothing.
"""

import asyncio
import json
import logging
import socket
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    import zenoh

log = logging.getLogger("wallride.bus")


class Bus:
    """Publishes bytes; before the session is open, and after it closed, they are dropped and counted.

    endpoint: where it listens; known for certain once it is open.
    """

    def __init__(self, listen: str) -> None:
        self.endpoint = listen
        self._session: zenoh.Session | None = None
        self.dropped = 0

    async def open(self) -> None:
        """Open the session; when the port is taken use a free one and say so."""
        try:
            self._session = await asyncio.to_thread(_open_session, self.endpoint)
        except OSError as error:
            free = free_endpoint()
            log.warning("telemetry cannot listen on %s (%s); using %s instead", self.endpoint, error, free)
            self.endpoint = free
            self._session = await asyncio.to_thread(_open_session, free)
        log.info("telemetry on %s", self.endpoint)

    def put(self, key: str, payload: bytes) -> None:
        """Publish without waiting: a slow or vanished reader loses samples, the car loses nothing."""
        if self._session is None:
            self.dropped += 1
            return
        import zenoh

        self._session.put(
            key, payload, congestion_control=zenoh.CongestionControl.DROP, encoding=zenoh.Encoding.APPLICATION_JSON
        )

    async def close(self) -> None:
        """Close the session; harmless when it never opened."""
        session, self._session = self._session, None
        if session is not None:
            await asyncio.to_thread(session.close)


def free_endpoint() -> str:
    """Return a loopback endpoint whose port nobody uses at this moment."""
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        return f"tcp/127.0.0.1:{probe.getsockname()[1]}"


def _open_session(listen: str) -> "zenoh.Session":
    """Open a router on one endpoint; OSError when it cannot listen there."""
    import zenoh

    config = zenoh.Config.from_json5(
        json.dumps(
            {
                "mode": "router",
                "listen": {"endpoints": [listen]},
                "connect": {"endpoints": []},
                "scouting": {"delay": 0, "multicast": {"enabled": False}, "gossip": {"enabled": False}},
            }
        )
    )
    try:
        return zenoh.open(config)
    except zenoh.ZError as error:
        reason = str(error).splitlines()[0]
        raise OSError(reason) from error
