"""All cars at once, for the pages that look at them: a row for each, one e-stop for all, and the race.

Begins with the first page that looks, because heartbeats of every car are no traffic for a page on one of them.
"""

import asyncio
import time
from collections.abc import Mapping, Sequence
from contextlib import suppress
from functools import partial
from typing import Any, Never

from wallride.clients.fleet.cars import OLD_S, FleetView, Row, guarded
from wallride.clients.fleet.links import FleetLink
from wallride.clients.fleet.race import RaceControl
from wallride.clients.fleet.stop import PERIOD_S, FleetStop
from wallride.clients.status import headline
from wallride.clients.teleop.link_probe import WITHIN_S, LinkProbe
from wallride.runtime.ending import end
from wallride.runtime.wire import topics

STOPPING_S = 10.0
"""Time for which the e-stop is repeated to a car that does not confirm it, and to one that comes back meanwhile."""
SAID_S = 60.0
"""Time for which pages are told how it went."""
PROBE_EVERY_S = 2.0
LOOKING_S = 1.0


class CarsOverview:
    """What every page that looks at all cars is shown; one for the server."""

    def __init__(self, links: Sequence[FleetLink], name: str) -> None:
        self._links = links
        self._name = name
        self.race = RaceControl()
        self._parts: tuple[FleetView, FleetStop] | None = None
        self._probes: dict[str, LinkProbe] = {}
        self._probing: dict[str, asyncio.Task[None]] = {}
        self._pressed_s: float | None = None
        self._result: dict[str, float | None] = {}
        self._looked_s = 0.0

    def stop(self, now_s: float) -> None:
        """Send the e-stop to every car by every link, and repeat it until each confirms it."""
        self._pressed_s = now_s
        self._begin()[1].press(now_s)

    def fields(self, now_s: float) -> dict[str, Any]:
        """Return what a page shows; also counts as a look."""
        self._looked_s = now_s
        view, stop = self._begin()
        standings = {one.car: one.fields() for one in self.race.standings(now_s)}
        if self._pressed_s is not None and now_s - self._pressed_s < STOPPING_S:
            self._result = dict(stop.cars)
        rows = [
            {**guarded(_row, row), **self._link(row["car"], now_s), "race": standings.get(row["car"])}
            for row in view.fields(None, now_s)
        ]
        return {
            "cars": rows,
            "problems": [
                *(f"{link.endpoint}: {link.problem}" for link in self._links if link.problem),
                *(f"{car} is not heard any more: has it ended, or is its link gone?" for car in stop.left),
            ],
            "stop": self._stop_fields(now_s),
        }

    def unshown(self, error: Exception, now_s: float) -> dict[str, Any]:
        """Return what a page shows where `fields` failed: no car, the reason, and how the e-stop went."""
        problem = f"the cars cannot be shown: {error!r}; STOP ALL still goes to each of them"
        return {"cars": [], "problems": [problem], "stop": self._stop_fields(now_s)}

    async def run(self) -> Never:
        """Repeat the e-stop, and measure the links while a page looks; until cancelled."""
        try:
            while True:
                await asyncio.sleep(PERIOD_S)
                self._step(time.monotonic())
        finally:
            await end(*self._probing.values())

    def _begin(self) -> tuple[FleetView, FleetStop]:
        if self._parts is None:
            self._parts = FleetView(self._links, self.race.take), FleetStop(self._links, self._name)
        return self._parts

    def _step(self, now_s: float) -> None:
        if self._parts is None:
            return
        view, stop = self._parts
        if self._pressed_s is not None and now_s - self._pressed_s < STOPPING_S:
            stop.step(now_s)
            self._result = dict(stop.cars)
        else:
            stop.end(now_s)
        wanted = set(view.present) if now_s - self._looked_s < LOOKING_S else set()
        for car in self._probing.keys() - wanted:
            self._probing.pop(car).cancel()
            self._probes.pop(car)
        for car in wanted - self._probing.keys():
            self._probes[car] = probe = LinkProbe(partial(_ask, view, car))
            self._probing[car] = asyncio.create_task(_probe(probe), name=f"link to {car}")

    def _link(self, car: str, now_s: float) -> dict[str, Any]:
        """Return the round trip of the link, and whether it is slower than the car's patience with a driver."""
        probe = self._probes.get(car)
        took_s = probe.takes_s(now_s) if probe is not None else None
        return {"round_trip_s": took_s, "slow": probe is not None and took_s is not None and took_s > probe.patience_s}

    def _stop_fields(self, now_s: float) -> dict[str, Any] | None:
        if self._pressed_s is None or now_s - self._pressed_s > SAID_S:
            return None
        late = [car for car, took_s in self._result.items() if took_s is None]
        return {
            "age_s": now_s - self._pressed_s,
            "sending": bool(late) and now_s - self._pressed_s < STOPPING_S,
            "latched": len(self._result) - len(late),
            "late": late,
        }


async def _ask(view: FleetView, car: str, question: bytes) -> list[bytes]:
    """Ask a car by the first of its links that answers."""
    for link in view.links_of(car):
        with suppress(OSError, TimeoutError):
            if answers := await link.bus.ask(topics.key(car, f"{topics.PARAM}/get"), question, timeout_s=WITHIN_S):
                return answers
    return []


async def _probe(probe: LinkProbe) -> Never:
    while True:
        await probe.measure()
        await asyncio.sleep(PROBE_EVERY_S)


def _row(row: Row) -> dict[str, Any]:
    """Return a car's row: what a page shows of its status, null for what the car does not say."""
    status: Mapping[str, Any] = row["status"]
    condition, battery = status.get("condition") or {}, status.get("battery") or {}
    error = status.get("distance_error") or {}
    return {
        "car": row["car"],
        "session": status.get("session") or "",
        "endpoints": row["endpoints"],
        "trouble": row["trouble"],
        "age_s": row["age_s"],
        "old": row["age_s"] is None or row["age_s"] > OLD_S,
        "state": condition.get("state") or status.get("state") or "",
        "why": headline(status) if status else "",
        "speed_mps": status.get("speed_mps"),
        "error_m": error.get("mean_abs_m"),
        "battery_v": battery.get("voltage_v"),
        "battery_trouble": battery.get("trouble") or "",
    }
