"""`wallride stop`: the e-stop to one car or to all, by every endpoint, repeated until each car says that it latched."""

import argparse
import asyncio
import secrets
import time
from collections.abc import Mapping, Sequence
from dataclasses import replace
from functools import partial

from clients.connection import ConnectionProblemError
from clients.fleet.links import FleetLink, fleet_links
from runtime.wire import topics
from runtime.wire.network import BYTES
from runtime.wire.teleop import CarCondition, Command, Input, Malformed, Press, read_beat

PERIOD_S = 0.02
SETTLING_S = 0.5
"""Time for which cars may still appear once every endpoint has answered."""
GIVE_UP_S = 3.0
OLD_S = 1.0
"""Silence after which a start of a car has ended: it need not confirm what is pressed later."""
INSIST_S = 0.3
"""Time for which the e-stop is repeated after its confirmation: a car latched for another reason has to learn of it."""


class FleetStop:
    """The e-stop to every car on these links, or to one name.

    cars: by name, the time until all starts of that car that were heard had latched, None while one has not.
    """

    def __init__(self, links: Sequence[FleetLink], name: str, only: str | None = None) -> None:
        self._links = links
        self._only = only
        self._command = Command(secrets.randbits(63) + 1, 0, 0, 0, Press.ESTOP, Input.PAGE, name=name)
        self._known: dict[tuple[FleetLink, str], None] = {}
        self._present: set[tuple[FleetLink, str]] = set()
        self._latched_s: dict[tuple[str, int], float | None] = {}
        self._heard_s: dict[tuple[str, int], float] = {}
        self._pressed_s: float | None = None
        for link in links:
            link.bus.watch(topics.key("*", topics.ALIVE), partial(self._on_token, link))
            link.bus.subscribe(
                topics.key("*", topics.BEAT),
                partial(self._on_beat, link),
            )

    def press(self, now_s: float) -> None:
        """Begin to send; call `step` from now on."""
        self._pressed_s = now_s
        self._heard_s = {start: at_s for start, at_s in self._heard_s.items() if now_s - at_s < OLD_S}
        self._latched_s = dict.fromkeys(self._heard_s)
        self.step(now_s)

    def end(self) -> None:
        """Send no more, and forget the cars that have left meanwhile."""
        self._pressed_s = None
        self._known = {place: None for place in self._known if place in self._present}

    def step(self, now_s: float) -> None:
        """Send the e-stop to every car that is known and has not confirmed it for long enough; 50 times a second."""
        if self._pressed_s is None:
            return
        for link, car in self._known:
            heard = [at_s for (name, _), at_s in self._latched_s.items() if name == car]
            if not heard or any(at_s is None or now_s - at_s < INSIST_S for at_s in heard):
                self._send(link, car)

    @property
    def cars(self) -> Mapping[str, float | None]:
        """Return the time from the press to the confirmation of each car, None without one."""
        pressed_s = self._pressed_s or 0.0
        found: dict[str, float | None] = {}
        for name in sorted({car for _, car in self._known}):
            heard = [at_s for (car, _), at_s in self._latched_s.items() if car == name]
            moments = [at_s for at_s in heard if at_s is not None]
            found[name] = max(moments) - pressed_s if heard and len(moments) == len(heard) else None
        return found

    def _send(self, link: FleetLink, car: str) -> None:
        self._command = replace(self._command, sequence=self._command.sequence + 1)
        link.bus.put(topics.key(car, topics.COMMAND), self._command.pack(), encoding=BYTES, urgent=True)

    def _on_token(self, link: FleetLink, key: str, alive: bool) -> None:  # noqa: FBT001 - the bus's callback
        place = link, key.split("/")[1]
        if alive:
            self._present.add(place)
            self._meet(*place)
            return
        self._present.discard(place)
        if self._pressed_s is None:  # one that leaves while it is pressed may be out of reach, and driving
            self._known.pop(place, None)

    def _on_beat(self, link: FleetLink, key: str, payload: bytes, arrival_s: float) -> None:
        car = key.split("/")[1]
        try:
            beat = read_beat(payload)
        except Malformed:
            return
        start = (car, beat.car_session)
        self._heard_s[start] = arrival_s
        latched = (
            self._pressed_s is not None and arrival_s > self._pressed_s and CarCondition.ESTOP_LATCHED in beat.flags
        )
        if self._latched_s.get(start) is None:
            self._latched_s[start] = arrival_s if latched else None
        self._meet(link, car)

    def _meet(self, link: FleetLink, car: str) -> None:
        if self._only in {None, car} and (link, car) not in self._known:
            self._known[link, car] = None
            if self._pressed_s is not None:
                self._send(link, car)


async def run(options: argparse.Namespace) -> int:
    """Stop; exit code 0 when every car that was found has latched and every endpoint answered, else 1."""
    if not options.all and options.car is None:
        options.car = await _only_car(options)
    async with fleet_links(options) as links:
        stop = FleetStop(links, options.name, options.car)
        began_s = time.monotonic()
        stop.press(began_s)
        while not _is_over(stop, links, time.monotonic() - began_s):
            stop.step(time.monotonic())
            await asyncio.sleep(PERIOD_S)
        problems = [f"{link.endpoint}: {link.problem}" for link in links if link.problem]
        cars = dict(stop.cars)
    for car, took_s in cars.items():
        said = f"e-stop latched after {took_s:.2f} s" if took_s is not None else "DOES NOT CONFIRM: stop it by hand"
        options.print_line(f"{car:<16} {said}")
    for problem in problems:
        options.print_line(f"cars only there were not stopped: {problem}")
    if not cars:
        options.print_line("no car was found")
    return 0 if cars and not problems and None not in cars.values() else 1


def _is_over(stop: FleetStop, links: Sequence[FleetLink], passed_s: float) -> bool:
    cars = stop.cars.values()
    done = bool(cars) and None not in cars and not any(link.problem for link in links)
    return passed_s > GIVE_UP_S or (done and passed_s > SETTLING_S)


async def _only_car(options: argparse.Namespace) -> str:
    """Return the name of the only car; an error names them, because a guess would leave one of them driving."""
    async with fleet_links(options) as links:
        seen = FleetStop(links, options.name)
        await asyncio.sleep(SETTLING_S)
        names = list(seen.cars)
    if len(names) != 1:
        found = f"there are several cars: {', '.join(names)}" if names else "no car was found"
        raise ConnectionProblemError(f"{found}; stop all of them: wallride stop --all")
    return names[0]
