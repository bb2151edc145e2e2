"""`wallride cars`: every car at every endpoint with its state, and names that two cars want.

A status comes from another computer: a car with a fault, or one that was taken over, may send anything under its own
name. What does not fit the shape that screens read is refused whole, so that no reader meets a word where it expects
a number.
"""

import argparse
import asyncio
import json
import math
import time
from collections import Counter
from collections.abc import Callable, Iterator, Mapping, Sequence
from functools import partial
from typing import Annotated, Any, TypeVar

from pydantic import BaseModel, ConfigDict, StringConstraints

from wallride.clients.fleet.links import FleetLink, fleet_links, why_no_car
from wallride.clients.fleet.watching import watch
from wallride.clients.played import NOTHING_DRIVES, PlayedNames
from wallride.clients.status import headline
from wallride.runtime.host.terminal_text import one_line
from wallride.runtime.wire import topics

Short = Annotated[str, StringConstraints(max_length=64)]
Words = Annotated[str, StringConstraints(max_length=1000)]
WITHIN_S = 1.0
OLD_S = 1.0
MAX_STARTS = 8
"""Starts kept of one name, and of those that were refused it: a car may name a new session in every message."""
UNREADABLE = "its status cannot be read"
Row = Mapping[str, Any]
Shown = TypeVar("Shown")
TakeStatus = Callable[[str, Mapping[str, Any], float], None]


class _Part(BaseModel):
    """A part of the status: exact types, finite numbers; what else is in it is not read."""

    model_config = ConfigDict(strict=True, extra="ignore", allow_inf_nan=False)


class _Condition(_Part):
    state: Short = ""


class _Output(_Part):
    winner: Short
    reason: Words
    speed_mps: float | None
    measure: float | None = None


class _Battery(_Part):
    voltage_v: float | None = None
    trouble: Words | None = None


class _Error(_Part):
    mean_abs_m: float | None = None


class _Status(_Part):
    """Every field may be missing: cars of other versions say less."""

    session: Short | None = None
    version: Short | None = None
    state: Short | None = None
    stamp_s: float | None = None
    speed_mps: float | None = None
    condition: _Condition | None = None
    output: _Output | None = None
    gates: dict[Short, Words] | None = None
    battery: _Battery | None = None
    distance_error: _Error | None = None


def check_status(status: Mapping[str, Any]) -> None:
    """Refuse a status of another shape: ValueError. The race checks the pose by itself.

    Every number is finite, also in parts that are not read here: `wallride cars --json` passes all of them on, and one
    Infinity among them (JSON's 1e999) would keep other programs from reading the rows of all cars.
    """
    _Status.model_validate(dict(status))
    json.dumps(dict(status), allow_nan=False)


class FleetView:
    """What every car at some links says, by its start: two cars of one name are two rows.

    take: called with the car, its status and the time of arrival, for each status that can be read. One that cannot is
    the trouble of its car's rows, and nothing of it is used.
    """

    def __init__(self, links: Sequence[FleetLink], take: TakeStatus | None = None) -> None:
        self._links = links
        self._take = take
        self._status: dict[tuple[str, str], Mapping[str, Any]] = {}
        self._heard_s: dict[tuple[str, str], float] = {}
        self._unreadable_s: dict[str, float] = {}
        self._where: dict[tuple[str, str], dict[str, None]] = {}
        self._present: dict[str, dict[str, None]] = {}
        self._refused: dict[tuple[str, str], str] = {}
        self._played = [PlayedNames(link.bus) for link in links]
        for link in links:
            bus = link.bus
            bus.subscribe(topics.key("*", topics.STATUS), partial(self._on_status, link))
            bus.watch(topics.key("*", topics.ALIVE), partial(self._on_token, link))
            bus.watch(topics.key("*", f"{topics.REFUSED}/*"), partial(self._on_refused, link))

    def fields(self, only: str | None, now_s: float) -> list[dict[str, Any]]:
        """Return a row for each car that is present: name, endpoints, age_s of its status, status, trouble."""
        wanted = sorted(name for name, places in self._present.items() if places and only in {None, name})
        starts = [start for start in self._status if start[0] in wanted and self._is_present(start, now_s)]
        double = {name for name, count in Counter(name for name, _ in starts).items() if count > 1}
        silent = [(name, "") for name in wanted if name not in {start[0] for start in starts}]
        rows = [self._row(start, now_s, twice=start[0] in double) for start in sorted([*starts, *silent])]
        rows += [
            {"car": car, "endpoints": [place], "age_s": None, "status": {}, "trouble": f"session {session} is refused:"
             " another car has its name there; give it another car.name"}
            for (car, session), place in sorted(self._refused.items()) if only in {None, car}
        ]  # fmt: skip
        return rows

    @property
    def present(self) -> list[str]:
        """Return the names of the cars that are there."""
        return [name for name, places in self._present.items() if places]

    def links_of(self, car: str) -> list[FleetLink]:
        """Return the links at which a car is there."""
        return [link for link in self._links if link.endpoint in self._present.get(car, ())]

    def silent(self, now_s: float) -> list[str]:
        """Return the cars that are present and of which no status has come."""
        return [row["car"] for row in self.fields(None, now_s) if row["age_s"] is None and not row["trouble"]]

    def _row(self, start: tuple[str, str], now_s: float, *, twice: bool) -> dict[str, Any]:
        heard_s = self._heard_s.get(start)
        unreadable = now_s - self._unreadable_s.get(start[0], -math.inf) < OLD_S
        troubles = [
            UNREADABLE if unreadable else "",
            f"two cars are called so; this one has session {start[1]}" if twice else "",
            f"{NOTHING_DRIVES}; it says" if any(start[0] in played for played in self._played) else "",
        ]
        return {
            "car": start[0],
            "endpoints": list(self._where.get(start) or self._present[start[0]]),
            "age_s": round(now_s - heard_s, 3) if heard_s is not None else None,
            "status": dict(self._status.get(start, {})),
            "trouble": "; ".join(filter(None, troubles)),
        }

    def _is_present(self, start: tuple[str, str], now_s: float) -> bool:
        """Tell whether this start of a car is the newest heard, or still speaks."""
        newest_s = max(at_s for (name, _), at_s in self._heard_s.items() if name == start[0])
        return self._heard_s[start] == newest_s or now_s - self._heard_s[start] < OLD_S

    def _on_status(self, link: FleetLink, key: str, payload: bytes, arrival_s: float) -> None:
        car = key.split("/")[1]
        try:
            status = topics.decode(payload)
            check_status(status)
        except (ValueError, TypeError):
            self._unreadable_s[car] = arrival_s
            return
        start = car, str(status.get("session") or "")
        if start not in self._status:
            self._make_room(car)
        self._status[start], self._heard_s[start] = status, arrival_s
        self._where.setdefault(start, {})[link.endpoint] = None
        if self._take is not None:
            self._take(car, status, arrival_s)

    def _make_room(self, car: str) -> None:
        """Forget the starts of a car that were heard longest ago, so that there is a place for one more."""
        known = sorted((start for start in self._heard_s if start[0] == car), key=lambda start: self._heard_s[start])
        for start in known[: max(0, len(known) - MAX_STARTS + 1)]:
            del self._status[start], self._heard_s[start], self._where[start]

    def _on_token(self, link: FleetLink, key: str, alive: bool) -> None:  # noqa: FBT001 - the bus's callback
        places = self._present.setdefault(key.split("/")[1], {})
        if alive:
            places[link.endpoint] = None
        else:
            places.pop(link.endpoint, None)

    def _on_refused(self, link: FleetLink, key: str, alive: bool) -> None:  # noqa: FBT001 - the bus's callback
        _, car, _, session = key.split("/")
        if not alive:
            self._refused.pop((car, session), None)
        elif sum(name == car for name, _ in self._refused) < MAX_STARTS:
            self._refused[car, session] = link.endpoint


async def run(options: argparse.Namespace) -> int:
    """Print the cars present, once or until interrupted; exit code 1 when there is none."""
    async with fleet_links(options) as links:
        view = FleetView(links)
        if options.watch:
            await watch(options, links, lambda: list(table(view.fields(options.car, time.monotonic()))) or ["no car"])
        await asyncio.sleep(WITHIN_S)
        told = await why_no_car(links)
        rows = view.fields(options.car, time.monotonic())
        away = [f"{link.endpoint}: {link.problem}" for link in links if link.problem and link.keys is None]
    if options.json:
        options.print_line(json.dumps({_name(row): {**row["status"], **_about(row)} for row in rows}, indent=2))
    else:
        for line in [*table(rows), *away, *told] or [f"no car at {', '.join(link.endpoint for link in links)}"]:
            options.print_line(line)
    return 0 if rows else 1


def guarded(show: Callable[[Row], Shown], row: Row) -> Shown:
    """Show a row; one that cannot be shown is shown without its status, so that it takes no other row away."""
    try:
        return show(row)
    except Exception:  # noqa: BLE001 - the status is another computer's, and the rows of all cars depend on it
        return show({**row, "status": {}, "trouble": row["trouble"] or UNREADABLE})


def table(rows: Sequence[Row]) -> Iterator[str]:
    """Yield a line for each car: name, version, state, and why it does (not) move."""
    for row in rows:
        yield one_line(guarded(_line, row))


def _line(row: Row) -> str:
    status = row["status"]
    version = status.get("version") or "?"
    state = (status.get("condition") or {}).get("state") or status.get("state")
    state = state or ("" if row["trouble"] else "says nothing")
    age_s = row["age_s"]
    said = [row["trouble"], f"silent for {age_s:.0f} s" if age_s is not None and age_s > OLD_S else ""]
    words = "; ".join(filter(None, [*said, headline(status) if status else ""]))
    return f"{row['car']:<16} {version:<10} {state:<18} {words}".rstrip()


def _name(row: Row) -> str:
    return f"{row['car']} {row['trouble']}" if row["trouble"] else str(row["car"])


def _about(row: Row) -> dict[str, Any]:
    return {name: row[name] for name in ("endpoints", "age_s", "trouble")}
