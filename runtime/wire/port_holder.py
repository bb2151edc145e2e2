"""The car that holds a wanted port: identified over the port itself, so that the error can name it."""

import asyncio
import contextlib

from wallride.runtime.wire import topics, zenoh_config
from wallride.runtime.wire.bus import Bus
from wallride.runtime.wire.endpoints import is_tls
from wallride.runtime.wire.teleop import Malformed, read_beat, session_text

ASK_FOR_S = 1.5
STRANGER = "another program"


def taken_sentence(endpoint: str, holder: str) -> str:
    """Return the message to the owner of a car whose port is taken."""
    return (
        f"{endpoint} is taken by {holder}; end it first, or let this car listen elsewhere:"
        " --set telemetry.listen=tcp/127.0.0.1:PORT"
    )


async def holder_of(endpoint: str) -> str:
    """Return the name of the car that listens there, with its session; STRANGER when it is no car, or needs keys."""
    if is_tls(endpoint):
        return STRANGER
    sessions: dict[str, str] = {}
    heard = asyncio.Event()

    def on_token(key: str, alive: bool) -> None:  # noqa: FBT001 - the bus's callback
        if alive:
            sessions.setdefault(key.split("/")[1], "")

    def on_beat(key: str, payload: bytes, _arrival_s: float) -> None:
        with contextlib.suppress(Malformed):
            sessions[key.split("/")[1]] = session_text(read_beat(payload).car_session)
            heard.set()

    bus = Bus(zenoh_config.client_config(endpoint, None))
    bus.watch(topics.key("*", topics.ALIVE), on_token)
    bus.subscribe(topics.key("*", topics.BEAT), on_beat)
    try:
        with contextlib.suppress(OSError, TimeoutError):
            async with asyncio.timeout(ASK_FOR_S):
                await bus.open()
                await heard.wait()
    finally:
        await bus.close()
    cars = [f"the car {name}{f' (session {session})' if session else ''}" for name, session in sorted(sessions.items())]
    return " and ".join(cars) or STRANGER
