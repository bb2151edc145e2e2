"""The one car that a command means, at several endpoints: a list in --connect or WALLRIDE_CONNECT is searched."""

import argparse
import asyncio
from collections.abc import Mapping, Sequence
from functools import partial
from typing import Final

from wallride.clients.endpoints import ConnectionProblemError, given_by
from wallride.clients.fleet.links import UNANSWERED, FleetLink, fleet_links
from wallride.runtime.wire import topics
from wallride.runtime.wire.teleop import Malformed, read_beat, session_text

PERIOD_S: Final = 0.05
WITHIN_S: Final = 3.0
SETTLING_S: Final = 0.3
"""Time after the last endpoint's answer in which cars, and their heartbeats, can still appear."""


class Sightings:
    """Which cars are at which endpoint. cars: by endpoint, in the order of the list, each name with its session.

    A session is "" until a heartbeat came.
    """

    def __init__(self, links: Sequence[FleetLink]) -> None:
        self._links = links
        self.cars: dict[str, dict[str, str]] = {link.endpoint: {} for link in links}
        for link in links:
            link.bus.watch(topics.key("*", topics.ALIVE), partial(self._on_token, link.endpoint))
            link.bus.subscribe(topics.key("*", topics.BEAT), partial(self._on_beat, link.endpoint))

    @property
    def have_answered(self) -> bool:
        """Whether every endpoint is open, or was found to be away."""
        return all(link.problem != UNANSWERED for link in self._links)

    @property
    def away(self) -> Mapping[str, str]:
        """Return the endpoints without a session, with the reason."""
        return {link.endpoint: link.problem for link in self._links if link.problem}

    def has(self, name: str | None) -> bool:
        """Tell whether this car was seen somewhere; None: any car."""
        return any(name in cars if name is not None else cars for cars in self.cars.values())

    def _on_token(self, endpoint: str, key: str, alive: bool) -> None:  # noqa: FBT001 - the bus's callback
        name = key.split("/")[1]
        if alive:
            self.cars[endpoint].setdefault(name, "")
        else:
            self.cars[endpoint].pop(name, None)

    def _on_beat(self, endpoint: str, key: str, payload: bytes, _arrival_s: float) -> None:
        name = key.split("/")[1]
        try:
            self.cars[endpoint][name] = session_text(read_beat(payload).car_session)
        except Malformed:
            return  # the next one comes in a moment


async def at_one_endpoint(options: argparse.Namespace) -> argparse.Namespace:
    """Return the options with the name and the only endpoint of the car that they mean, within about 3 s.

    ConnectionProblemError when there is none, when there are several and none was chosen, or two of one name.
    """
    async with fleet_links(options) as links:
        seen = Sightings(links)
        for _ in range(round(WITHIN_S / PERIOD_S)):
            if seen.have_answered and seen.has(options.car):
                break
            await asyncio.sleep(PERIOD_S)
        await asyncio.sleep(SETTLING_S)
        cars, away = seen.cars, seen.away
    session = session_text(options.session) if options.session is not None else ""
    name, endpoint = choose(cars, away, options.car, session, given_by(options))
    return argparse.Namespace(**{**vars(options), "car": name, "connect": endpoint})


def choose(
    cars: Mapping[str, Mapping[str, str]], away: Mapping[str, str], name: str | None, session: str, given: str
) -> tuple[str, str]:
    """Return name and endpoint of the car that is meant; ConnectionProblemError with what is where.

    cars: by endpoint, names with sessions. away: endpoints with the reason. session: of the wanted start, "" for any.
    given: the option or variable that lists the endpoints.
    """
    names = sorted({each for there in cars.values() for each in there if name in {None, each}})
    if not names:
        what = f"no car {name}" if name is not None else "no car"
        found = [f"{place}: {away.get(place) or ', '.join(sorted(there)) or 'no car'}" for place, there in cars.items()]
        raise ConnectionProblemError(f"{what} at the endpoints of {given}. {'; '.join(found)}")
    if len(names) > 1:
        raise ConnectionProblemError(
            f"there are several cars at the endpoints of {given}: {', '.join(names)}; choose with --car"
        )
    places = {place: there[names[0]] for place, there in cars.items() if names[0] in there}
    meant = [place for place, its in places.items() if its == session] if session else []
    if not meant and len({its for its in places.values() if its}) > 1:
        found = [f"session {its or 'unknown'} at {place}" for place, its in places.items()]
        raise ConnectionProblemError(
            f"two cars are called {names[0]}: {', '.join(found)}; choose with --session, and give one another car.name"
        )
    return names[0], (meant or list(places))[0]
