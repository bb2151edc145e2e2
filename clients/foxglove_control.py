"""Rights of a viewer of `wallride foxglove`: read and change settings, and press the e-stop. It cannot drive.

The server's callbacks run in a thread of its own; all work here is passed to the loop. Only a viewer on this machine
may change settings, because the server knows no passwords; the e-stop is for every viewer, because it only stops.
"""

import asyncio
import secrets
import time
from collections.abc import Callable, Mapping, Sequence
from typing import TYPE_CHECKING, Any

from foxglove.websocket import AnyNativeParameterValue, Parameter, ServerListener

from clients.connection import ConnectionProblemError
from clients.parameters import ask
from clients.teleop.inputs import Control, Inputs
from clients.teleop.pilot import Pilot
from clients.teleop.shaping import InputShape
from runtime.wire import topics
from runtime.wire.bus import Bus
from runtime.wire.network import RefusedError
from runtime.wire.teleop import Input, Malformed, read_beat

if TYPE_CHECKING:
    from foxglove.websocket import ChannelView, Client, ClientChannel

E_STOP = "e_stop"
"""Topic of the e-stop: a message of any kind is a press."""
NAME = "foxglove"
PERIOD_S, PRESSED_STEPS = 0.02, 25
ANSWER_WITHIN_S = 4.0
BYTES = "application/octet-stream"


class EStop:
    """Presses the e-stop of a car, as an operator's client does: for half a second, each command echoing a beat."""

    def __init__(self, bus: Bus, car: str) -> None:
        self._bus = bus
        self._car = car
        self._pilot = Pilot(secrets.randbits(63) + 1, NAME, InputShape())
        bus.subscribe(topics.key(car, topics.BEAT), self._hear)

    def _hear(self, _key: str, payload: bytes, arrival_s: float) -> None:
        try:
            self._pilot.hear(read_beat(payload), arrival_s)
        except Malformed:
            return  # the next one comes 50 ms later

    async def press(self) -> None:
        """Hold the e-stop until the car has certainly received it, and leave."""
        for _ in range(PRESSED_STEPS):
            now_s = time.monotonic()
            held = Inputs(Input.SCRIPT, live=True, event_s=now_s, pressed=frozenset({Control.ESTOP}), device=NAME)
            self._put(self._pilot.step(held, now_s).pack())
            await asyncio.sleep(PERIOD_S)
        self._put(self._pilot.goodbye(Input.SCRIPT).pack())

    def _put(self, payload: bytes) -> None:
        self._bus.put(topics.key(self._car, topics.COMMAND), payload, encoding=BYTES, urgent=True)


class SubscriptionListener(ServerListener):
    """Passes the viewers' requests to the loop. wanted: gets the topic. may_change: whether settings may be changed."""

    def __init__(self, bus: Bus, car: str, wanted: Callable[[str], None], *, may_change: bool) -> None:
        self._loop = asyncio.get_running_loop()
        self._bus = bus
        self._car = car
        self._wanted = wanted
        self._may_change = may_change
        self._stop = EStop(bus, car)
        self._stops: set[int] = set()
        self._pressing: set[asyncio.Task[None]] = set()

    def on_subscribe(self, client: "Client", channel: "ChannelView") -> None:  # noqa: ARG002 - any viewer
        """Subscribe to a topic of the car."""
        self._loop.call_soon_threadsafe(self._wanted, channel.topic.removeprefix("/"))

    def on_client_advertise(self, client: "Client", channel: "ClientChannel") -> None:  # noqa: ARG002 - any viewer
        """Record which of a viewer's channels is the e-stop."""
        if channel.topic.strip("/") == E_STOP:
            self._stops.add(channel.id)

    def on_message_data(self, client: "Client", client_channel_id: int, data: bytes) -> None:  # noqa: ARG002 - a press
        """Press the e-stop; other channels are ignored."""
        if client_channel_id in self._stops:
            self._loop.call_soon_threadsafe(self._press)

    def on_get_parameters(
        self, client: "Client", param_names: list[str], request_id: str | None = None  # noqa: ARG002 - any viewer
    ) -> list[Parameter]:  # fmt: skip
        """Return settings, all of them when none is named; none while the car does not answer."""
        found = self._ask("list", under="")
        names = set(param_names)
        return [
            Parameter(one["name"], value=plain(one["value"]))
            for one in (found or {}).get("parameters", ())
            if not names or one["name"] in names
        ]

    def on_set_parameters(
        self, client: "Client", parameters: list[Parameter], request_id: str | None = None
    ) -> list[Parameter]:
        """Change settings, by the car's own rules; returns the car's values afterwards."""
        if self._may_change:
            self._ask("set", values={one.name: one.get_value() for one in parameters}, by=NAME)
        return self.on_get_parameters(client, [one.name for one in parameters], request_id)

    def _press(self) -> None:
        task = asyncio.ensure_future(self._stop.press())
        self._pressing.add(task)
        task.add_done_callback(self._pressing.discard)

    def _ask(self, what: str, **question: object) -> Mapping[str, Any] | None:
        waiting = asyncio.run_coroutine_threadsafe(
            ask(self._bus, self._car, what, ANSWER_WITHIN_S, **question), self._loop
        )
        try:
            return waiting.result(ANSWER_WITHIN_S)
        except (ConnectionProblemError, RefusedError, TimeoutError):
            return None  # a rejection shows by the old value in the answer


def plain(value: object) -> AnyNativeParameterValue:
    """Return a setting's value in the types of viewers; a list of others than numbers as text."""
    if isinstance(value, bool | str | float):
        return value
    if isinstance(value, int):
        return float(value)
    if isinstance(value, Sequence):
        return ", ".join(map(str, value))
    return "" if value is None else str(value)
