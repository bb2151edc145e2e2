"""Where telemetry goes: zenoh here, a recorder or a live view elsewhere. All of them get the same bytes."""

import math
from typing import Protocol

from drivers.api import Clock
from runtime import wire
from runtime.ros.definitions import encoding
from runtime.telemetry_settings import RatesHz

ASK_EVERY_S = 0.2
"""A new subscriber waits at most so long for its first message."""
EARLY_SHARE = 0.2
"""News that come this much of a period early still count: a lidar's 25 ms are not always 25 ms."""


class Sink(Protocol):
    """A consumer of messages. Neither call may wait: both are made in the car's event loop."""

    def wants(self, topic: str, *, urgent: bool = False) -> bool:
        """Tell whether the next message of a topic would be taken; if nobody wants it, it is not even written.

        urgent: a change, not a repetition; rates do not hold it back.
        """
        ...

    def take(self, topic: str, schema: str, stamp_s: float, payload: bytes) -> None:
        """Take one message that was wanted.

        schema: its ROS 2 type, "" for JSON. stamp_s: seconds since 1970, as in the message's header.
        """
        ...


class Publisher(Protocol):
    """What of a bus is needed here."""

    def put(self, key: str, payload: bytes, *, encoding: str) -> None:
        """Publish without waiting."""
        ...

    def wanted(self, key: str, *, encoding: str) -> bool:
        """Tell whether anybody is subscribed."""
        ...


class ZenohSink:
    """Sends what somebody is subscribed to, each topic at most at its rate.

    rates: may be replaced while the car drives.
    """

    def __init__(self, bus: Publisher, car: str, rates: RatesHz, clock: Clock) -> None:
        self.rates = rates
        self._bus = bus
        self._car = car
        self._clock = clock
        self._next_s: dict[str, float] = {}
        self._heard: dict[str, bool] = {}
        self._asked_s = -math.inf
        self._names: dict[str, tuple[str, str]] = {}

    def wants(self, topic: str, *, urgent: bool = False) -> bool:
        """Tell whether the topic is due and somebody is subscribed."""
        rate_hz: float = getattr(self.rates, topic)
        if rate_hz <= 0:
            return False
        now_s = self._clock()
        if not urgent and now_s < self._next_s.get(topic, 0.0) - EARLY_SHARE / rate_hz:
            return False
        return self._is_heard(topic, now_s)

    def take(self, topic: str, schema: str, stamp_s: float, payload: bytes) -> None:  # noqa: ARG002 - both are in the payload
        """Send it; a slow or vanished reader loses it."""
        now_s, period_s = self._clock(), 1 / (getattr(self.rates, topic) or math.inf)
        due_s = self._next_s.get(topic, -math.inf)
        # On a grid, so that the mean rate is right; after a silence the grid begins anew.
        self._next_s[topic] = (due_s if due_s > now_s - period_s else now_s) + period_s
        key, kind = self._name(topic)
        self._bus.put(key, payload, encoding=kind)

    def _is_heard(self, topic: str, now_s: float) -> bool:
        """Tell whether somebody is subscribed: asked now and then, because asking costs more than most messages."""
        if now_s - self._asked_s > ASK_EVERY_S:
            self._asked_s = now_s
            self._heard.clear()
        heard = self._heard.get(topic)
        if heard is None:
            key, kind = self._name(topic)
            heard = self._heard[topic] = self._bus.wanted(key, encoding=kind)
        return heard

    def _name(self, topic: str) -> tuple[str, str]:
        name = self._names.get(topic)
        if name is None:
            name = self._names[topic] = (wire.key(self._car, topic), encoding(topic))
        return name
