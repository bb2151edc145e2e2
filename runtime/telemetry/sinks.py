"""Sinks of telemetry: zenoh here, a recorder or a live view elsewhere. All receive the same bytes."""

import math
from typing import Protocol

from runtime.ros.definitions import encoding
from runtime.settings.telemetry import RatesHz
from runtime.wire import topics

EARLY_SHARE = 0.2
"""Share of its period by which a message may come early: a lidar's 25 ms are not always 25 ms."""
ASK_EVERY_S = 0.2
"""Period of the check for subscribers, and so the longest wait of a new one for its first message."""


class Sink(Protocol):
    """A consumer of messages. Neither call may wait: both are made in the car's event loop."""

    def claim(self, topic: str, at_s: float, *, urgent: bool = False) -> bool:
        """Claim the next message of a topic; an unclaimed one is not even written.

        at_s: time of the value, on the monotonic clock. urgent: a change, not a repetition; rates do not delay it.
        """
        ...

    def take(self, topic: str, schema: str, stamp_s: float, payload: bytes) -> None:
        """Take one message that was claimed.

        schema: its ROS 2 type, "" for JSON. stamp_s: of the measurement, on the monotonic clock.
        """
        ...


class Publisher(Protocol):
    """The part of a bus that is needed here."""

    def put(self, key: str, payload: bytes, *, encoding: str) -> None:
        """Publish without waiting."""
        ...

    def wanted(self, key: str, *, encoding: str) -> bool:
        """Tell whether the key has a subscriber."""
        ...


class ZenohSink:
    """Sends the topics that have subscribers, each at most at its rate."""

    def __init__(self, bus: Publisher, car: str, rates: RatesHz) -> None:
        self._bus = bus
        self._car = car
        self._due_s: dict[str, float] = {}
        self._not_before_s: dict[str, float] = {}
        self._heard: dict[str, bool] = {}
        self._asked_s = -math.inf
        self._names: dict[str, tuple[str, str]] = {}
        self.limit(rates)

    def limit(self, rates: RatesHz) -> None:
        """Apply other rates from now on."""
        rates_hz: dict[str, float] = rates.model_dump()
        self._periods_s = {topic: 1 / rate_hz for topic, rate_hz in rates_hz.items() if rate_hz > 0}
        self._not_before_s.clear()

    def claim(self, topic: str, at_s: float, *, urgent: bool = False) -> bool:
        """Tell whether the topic is due and has a subscriber."""
        if not urgent and at_s < self._not_before_s.get(topic, -math.inf):
            return False
        period_s = self._periods_s.get(topic)
        if period_s is None or not self._is_heard(topic, at_s):
            return False
        due_s = self._due_s.get(topic, -math.inf)
        # On a grid, so that the mean rate is right; after a silence the grid restarts.
        self._due_s[topic] = due_s = (due_s if due_s > at_s - period_s else at_s) + period_s
        self._not_before_s[topic] = due_s - EARLY_SHARE * period_s
        return True

    def take(self, topic: str, schema: str, stamp_s: float, payload: bytes) -> None:  # noqa: ARG002 - both are in the payload
        """Send it; a slow or vanished reader loses it."""
        key, kind = self._name(topic)
        self._bus.put(key, payload, encoding=kind)

    def _is_heard(self, topic: str, at_s: float) -> bool:
        """Tell whether there is a subscriber: checked now and then, because a check costs more than most messages."""
        if at_s - self._asked_s > ASK_EVERY_S:
            self._asked_s = at_s
            self._heard.clear()
        heard = self._heard.get(topic)
        if heard is None:
            key, kind = self._name(topic)
            heard = self._heard[topic] = self._bus.wanted(key, encoding=kind)
        return heard

    def _name(self, topic: str) -> tuple[str, str]:
        name = self._names.get(topic)
        if name is None:
            name = self._names[topic] = (topics.key(self._car, topic), encoding(topic))
        return name
