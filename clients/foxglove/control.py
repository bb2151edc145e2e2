"""Rights of a viewer of `wallride foxglove`: read and change settings, and press the e-stop. It cannot drive.

Only a viewer on this machine may change settings, because the token of its address is not encrypted on the network; the
e-stop is for every viewer, because it only stops.
"""

import asyncio
import math
import secrets
import time
from collections.abc import Callable, Collection, Mapping, Sequence
from typing import Any

from wallride.clients.connection import ConnectionProblemError
from wallride.clients.monitor.driving import INSIST_S
from wallride.clients.parameters import ask
from wallride.clients.teleop.inputs import Control, Inputs
from wallride.clients.teleop.pilot import Pilot
from wallride.clients.teleop.shaping import InputShape
from wallride.runtime.wire import topics
from wallride.runtime.wire.bus import Bus
from wallride.runtime.wire.network import RefusedError
from wallride.runtime.wire.teleop import Input, Malformed, read_beat

NAME = "foxglove"
PERIOD_S, PRESSED_STEPS = 0.02, 25
UNCONFIRMED = "the car did not confirm the e-stop: stop it by hand"
ANSWER_WITHIN_S = 4.0
BYTES = "application/octet-stream"


class EStop:
    """Presses the e-stop of a car, as an operator's client does: half a second, and on until the car confirms it."""

    def __init__(self, bus: Bus, car: str) -> None:
        self._bus = bus
        self._car = car
        self._pilot = Pilot(secrets.randbits(63) + 1, NAME, InputShape())
        self._steps_left, self._until_s = 0, 0.0
        self._tell: set[Callable[[str], None]] = set()
        self._pressing: asyncio.Task[None] | None = None
        bus.subscribe(topics.key(car, topics.BEAT), self._hear)

    def press(self, tell: Callable[[str], None]) -> None:
        """Hold the e-stop from now on until a beat from after it says that it is latched, at most INSIST_S.

        tell: is told where none did.
        """
        self._steps_left, self._until_s = PRESSED_STEPS, time.monotonic() + INSIST_S
        self._tell.add(tell)
        if self._pressing is None or self._pressing.done():
            self._pressing = asyncio.ensure_future(self._hold())

    def _hear(self, _key: str, payload: bytes, arrival_s: float) -> None:
        try:
            self._pilot.hear(read_beat(payload), arrival_s)
        except Malformed:
            return  # the next one comes 50 ms later

    async def _hold(self) -> None:
        while self._steps_left > 0 or (self._is_pending and time.monotonic() < self._until_s):
            pressed, now_s = frozenset({Control.ESTOP} if self._steps_left > 0 else ()), time.monotonic()
            self._steps_left -= 1
            held = Inputs(Input.SCRIPT, live=True, event_s=now_s, pressed=pressed, device=NAME)
            self._put(self._pilot.step(held, now_s).pack())
            await asyncio.sleep(PERIOD_S)
        for tell in self._tell if self._is_pending else ():
            tell(UNCONFIRMED)
        self._tell.clear()
        self._put(self._pilot.goodbye(Input.SCRIPT).pack())

    @property
    def _is_pending(self) -> bool:
        return self._pilot.situation is None or self._pilot.situation.stop_pending

    def _put(self, payload: bytes) -> None:
        self._bus.put(topics.key(self._car, topics.COMMAND), payload, encoding=BYTES, urgent=True)


class ViewedSettings:
    """A car's settings as a viewer sees them. may_change: whether viewers may change them."""

    def __init__(self, bus: Bus, car: str, *, may_change: bool) -> None:
        self._bus = bus
        self._car = car
        self._may_change = may_change

    async def get(self, names: Collection[str]) -> list[dict[str, object]]:
        """Return settings, all of them when none is named; none while the car does not answer."""
        found = await self._ask("list", under="")
        return [
            described(one["name"], one["value"])
            for one in (found or {}).get("parameters", ())
            if not names or one["name"] in names
        ]

    async def set(self, values: Mapping[str, object]) -> list[dict[str, object]]:
        """Change settings, by the car's own rules; returns the car's values afterwards."""
        if self._may_change and values:
            await self._ask("set", values=values, by=NAME)
        return await self.get(values) if values else []

    async def _ask(self, what: str, **question: object) -> Mapping[str, Any] | None:
        try:
            return await ask(self._bus, self._car, what, ANSWER_WITHIN_S, **question)
        except (ConnectionProblemError, RefusedError):
            return None  # a rejection shows by the old value in the answer


def described(name: str, value: object) -> dict[str, object]:
    """Return a setting in the types of viewers; what they have no type for as text."""
    if isinstance(value, bool | str):
        return {"name": name, "value": value}
    if isinstance(value, int | float):
        number = float(value)
        return {"name": name, "value": number, "type": "float64"} if math.isfinite(number) else _text(name, value)
    if isinstance(value, Sequence):
        return _text(name, ", ".join(map(str, value)))
    return _text(name, "" if value is None else value)


def _text(name: str, value: object) -> dict[str, object]:
    return {"name": name, "value": str(value)}
