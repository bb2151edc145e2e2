"""Names on the bus that are no cars: recordings that `wallride replay --publish` plays under a car's name."""

import asyncio
from collections.abc import Iterator
from typing import Final

from wallride.runtime.wire import topics
from wallride.runtime.wire.bus import Bus

NOTHING_DRIVES: Final = "a recording is played here; nothing drives"
SETTLING_S: Final = 0.2
"""Time in which tokens and a car's heartbeat come."""


class PlayedNames:
    """The names that announce a recording and of which no heartbeat is heard: a recording has none, every car has."""

    def __init__(self, bus: Bus, car: str = "*") -> None:
        self._announced: set[str] = set()
        self._alive: set[str] = set()
        bus.watch(topics.key(car, topics.PLAYED), self._on_token)
        bus.subscribe(topics.key(car, topics.BEAT), self._on_beat)

    def __contains__(self, car: object) -> bool:
        """Tell whether what has this name is a recording."""
        return car in self._announced and car not in self._alive

    def __iter__(self) -> Iterator[str]:
        """Yield the names of recordings."""
        return iter(sorted(self._announced - self._alive))

    def _on_token(self, key: str, alive: bool) -> None:  # noqa: FBT001 - the bus's callback
        name = key.split("/")[1]
        if alive:
            self._announced.add(name)
        else:
            self._announced.discard(name)

    def _on_beat(self, key: str, _payload: bytes, _arrival_s: float) -> None:
        self._alive.add(key.split("/")[1])


async def why_silent(bus: Bus, car: str, otherwise: str) -> str:
    """Return why a car does not let itself be driven: it is a recording, or the reason given. bus: closed soon."""
    played = PlayedNames(bus, car)
    await asyncio.sleep(SETTLING_S)
    return NOTHING_DRIVES if car in played else otherwise
