"""`wallride stop`: the e-stop to one car or to all, by every endpoint, repeated until each car says that it latched."""

import argparse
import asyncio
import math
import secrets
import time
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial

from wallride.clients.connection import ConnectionProblemError
from wallride.clients.fleet.links import FleetLink, fleet_links, why_no_car
from wallride.clients.played import NOTHING_DRIVES, PlayedNames
from wallride.runtime.host.terminal_text import one_line
from wallride.runtime.wire import topics
from wallride.runtime.wire.network import BYTES
from wallride.runtime.wire.teleop import CarCondition, Command, Input, Malformed, Press, read_beat, session_text

PERIOD_S = 0.02
SETTLING_S = 0.5
"""Time for which cars may still appear once every endpoint has answered."""
GIVE_UP_S = 3.0
OLD_S = 1.0
"""Silence after which a start of a car has ended: it need not confirm what is pressed later."""
LEFT_S = 30.0
"""Time for which a car that has left is stopped and named as well: it may be out of reach, and driving."""
INSIST_S = 0.3
"""Time for which the e-stop is repeated after its confirmation: a car latched for another reason has to learn of it."""


@dataclass(frozen=True, slots=True)
class StopResult:
    """What became of the e-stop to one start of a car.

    session: of that start, "" for a car without a heartbeat. took_s: time from the press to its confirmation, None
    without one. refused_at: endpoint at which another car has its name, so that no command reaches it; "" elsewhere.
    """

    car: str
    session: str
    took_s: float | None
    refused_at: str = ""


class FleetStop:
    """The e-stop to every car on these links, or to one name."""

    def __init__(self, links: Sequence[FleetLink], name: str, only: str | None = None) -> None:
        self._links = links
        self._only = only
        self._command = Command(secrets.randbits(63) + 1, 0, 0, 0, Press.ESTOP, Input.PAGE, name=name)
        self._known: dict[tuple[FleetLink, str], None] = {}
        self._present: set[tuple[FleetLink, str]] = set()
        self._left_s: dict[tuple[FleetLink, str], float] = {}
        self._latched_s: dict[tuple[str, int], float | None] = {}
        self._heard_s: dict[tuple[str, int], float] = {}
        self._refused: dict[tuple[str, str], str] = {}
        self._refused_now: set[tuple[str, str]] = set()
        self._pressed_s: float | None = None
        self._played = [PlayedNames(link.bus) for link in links]
        for link in links:
            link.bus.watch(topics.key("*", topics.ALIVE), partial(self._on_token, link))
            link.bus.subscribe(topics.key("*", topics.BEAT), partial(self._on_beat, link))
            link.bus.watch(topics.key("*", f"{topics.REFUSED}/*"), partial(self._on_refused, link))

    def press(self, now_s: float) -> None:
        """Begin to send; call `step` from now on."""
        self._pressed_s = now_s
        self._heard_s = {start: at_s for start, at_s in self._heard_s.items() if now_s - at_s < OLD_S}
        self._latched_s = dict.fromkeys(self._heard_s)
        self.step(now_s)

    def end(self, now_s: float) -> None:
        """Send no more, and forget the cars that left LEFT_S ago; called again and again until the next press."""
        self._pressed_s = None
        left_s = {place: min(at_s, now_s) for place, at_s in self._left_s.items()}
        self._left_s = {place: at_s for place, at_s in left_s.items() if now_s - at_s < LEFT_S}
        self._known = {place: None for place in self._known if place in self._present or place in self._left_s}
        self._refused = {start: at for start, at in self._refused.items() if start in self._refused_now}

    def step(self, now_s: float) -> None:
        """Send the e-stop to every car that is known and has not confirmed it for long enough; 50 times a second."""
        if self._pressed_s is None:
            return
        for link, car in self._known:
            heard = [at_s for (name, _), at_s in self._latched_s.items() if name == car]
            if not heard or any(at_s is None or now_s - at_s < INSIST_S for at_s in heard):
                self._send(link, car)

    @property
    def left(self) -> Sequence[str]:
        """Return the names of the cars that have left, and would be stopped as well."""
        return sorted({car for _, car in self._left_s} - {car for _, car in self._present})

    @property
    def cars(self) -> Mapping[str, float | None]:
        """Return by name the time from the press until all cars of it had confirmed, None while one has not."""
        found: dict[str, float | None] = {}
        for one in self.results:
            before_s, took_s = found.get(one.car, 0.0), one.took_s
            found[one.car] = max(before_s, took_s) if before_s is not None and took_s is not None else None
        return found

    @property
    def recordings(self) -> Sequence[str]:
        """Return the names that are no cars but played recordings; the e-stop goes to them as well."""
        return sorted({car for _, car in self._known if self._is_recording(car)})

    def _is_recording(self, car: str) -> bool:
        return any(car in played for played in self._played) and not any(name == car for name, _ in self._heard_s)

    @property
    def results(self) -> Sequence[StopResult]:
        """Return what became of each start of each car, by name and session; several starts have one name wrongly."""
        pressed_s = self._pressed_s or 0.0
        found = []
        for name in sorted({car for _, car in self._known} | {car for car, _ in self._refused}):
            heard = {session_text(start): at_s for (car, start), at_s in self._latched_s.items() if car == name}
            for session, at_s in sorted(heard.items()):
                found.append(StopResult(name, session, at_s - pressed_s if at_s is not None else None))
            refused = {session: at for (car, session), at in self._refused.items() if car == name}
            found += [StopResult(name, each, None, at) for each, at in sorted(refused.items()) if each not in heard]
            if not heard and any(car == name for _, car in self._known) and not self._is_recording(name):
                found.append(StopResult(name, "", None))
        return found

    def _send(self, link: FleetLink, car: str) -> None:
        self._command = replace(self._command, sequence=self._command.sequence + 1)
        link.bus.put(topics.key(car, topics.COMMAND), self._command.pack(), encoding=BYTES, urgent=True)

    def _on_token(self, link: FleetLink, key: str, alive: bool) -> None:  # noqa: FBT001 - the bus's callback
        place = link, key.split("/")[1]
        if alive:
            self._present.add(place)
            self._left_s.pop(place, None)
            self._meet(*place)
        else:
            self._present.discard(place)
            self._left_s[place] = math.inf  # the next `end` knows the time

    def _on_refused(self, link: FleetLink, key: str, alive: bool) -> None:  # noqa: FBT001 - the bus's callback
        _, car, _, session = key.split("/")
        start = car, session
        if alive and self._only in {None, car}:
            self._refused[start] = link.endpoint
            self._refused_now.add(start)
            return
        self._refused_now.discard(start)
        if self._pressed_s is None:
            self._refused.pop(start, None)

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
    """Stop, and print a line for each car; exit code 0 when each has latched and every endpoint answered, else 1."""
    if not options.all and options.car is None:
        options.car = await _only_car(options)
    unusable: list[str] = []
    async with fleet_links(options, unusable) as links:
        stop = FleetStop(links, options.name, options.car)
        began_s = time.monotonic()
        stop.press(began_s)
        while not _is_over(stop, links, time.monotonic() - began_s):
            stop.step(time.monotonic())
            await asyncio.sleep(PERIOD_S)
        told = [] if stop.results or stop.recordings else await why_no_car(links)
        problems = [*_problems(links), *unusable]
        results, recordings = stop.results, stop.recordings
    for line in (*lines(results), *(f"{name:<16} {NOTHING_DRIVES}" for name in recordings)):
        options.print_line(one_line(line))
    for problem in problems if results else ():
        options.print_line(one_line(f"cars only there were not stopped: {problem}"))
    if not results and not recordings:
        options.print_line(one_line(_nothing_stopped(links, unusable, told)))
    return 0 if results and not problems and all(one.took_s is not None for one in results) else 1


def lines(results: Sequence[StopResult]) -> Iterator[str]:
    """Yield a line for each result; of several cars with one name each is told by its session."""
    names = Counter(one.car for one in results)
    for one in results:
        who = f"{one.car} (session {one.session or 'unknown'})" if names[one.car] > 1 or one.refused_at else one.car
        if one.refused_at:
            said = (
                f"is refused at {one.refused_at}, where another car has its name, and was not stopped: stop it by hand"
            )
        elif one.took_s is None:
            said = "DOES NOT CONFIRM: stop it by hand (keys of the role viewer or planner stop no car)"
        else:
            said = f"e-stop latched after {one.took_s:.2f} s"
        yield f"{who:<16} {said}"


def _is_over(stop: FleetStop, links: Sequence[FleetLink], passed_s: float) -> bool:
    if not links:
        return True
    waits = [one for one in stop.results if one.took_s is None and not one.refused_at]  # a refused one cannot confirm
    done = bool(stop.results) and not waits and not any(link.problem for link in links)
    return passed_s > GIVE_UP_S or (done and passed_s > SETTLING_S)


def _problems(links: Sequence[FleetLink]) -> list[str]:
    return [f"{link.endpoint} ({link.problem})" for link in links if link.problem]


def _nothing_stopped(links: Sequence[FleetLink], unusable: Sequence[str], told: Sequence[str]) -> str:
    """Return what became of an e-stop that reached no car, and what stops one then. told: as of `why_no_car`."""
    away = [*_problems([link for link in links if link.keys is None]), *unusable]
    why = "; ".join([*([f"cannot connect to {'; '.join(away)}"] if away else []), *told]) or "no car was found"
    return f"nothing was stopped: {why}. Stop the car by hand; --connect ENDPOINT is another place to look"


async def _only_car(options: argparse.Namespace) -> str:
    """Return the name of the only car; an error names them, because a guess would leave one of them driving."""
    unusable: list[str] = []
    async with fleet_links(options, unusable) as links:
        seen = FleetStop(links, options.name)
        await asyncio.sleep(SETTLING_S if links else 0.0)
        told = [] if seen.cars or seen.recordings else await why_no_car(links)
        names = [*seen.cars, *seen.recordings]
    if not names:
        raise ConnectionProblemError(_nothing_stopped(links, unusable, told))
    if len(names) > 1:
        raise ConnectionProblemError(
            f"nothing was stopped: there are several cars: {', '.join(names)}; stop all of them: wallride stop --all"
        )
    return names[0]
