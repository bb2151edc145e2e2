"""Sinks of telemetry: zenoh here, a recorder or a live view elsewhere. All receive the same bytes."""

import math
from collections.abc import Callable, Mapping
from typing import Protocol

from wallride.runtime.ros.definitions import encoding
from wallride.runtime.settings.telemetry import RatesHz
from wallride.runtime.wire import topics

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

    def take(self, topic: str, schema: str, stamp_s: float, payload: bytes) -> None:
        """Take one message that was claimed.

        schema: its ROS 2 type, "" for JSON. stamp_s: of the measurement, on the monotonic clock.
        """


class Publisher(Protocol):
    """The part of a bus that is needed here."""

    def put(self, key: str, payload: bytes, *, encoding: str) -> None:
        """Publish without waiting."""

    def wanted(self, key: str, *, encoding: str) -> bool:
        """Tell whether the key has a subscriber."""


class TopicGate:
    """Selects the messages that are due and have a subscriber, each topic at most at its rate.

    is_wanted: tells whether a topic has a subscriber; asked now and then, because it costs more than most messages.
    """

    def __init__(self, is_wanted: Callable[[str], bool]) -> None:
        self._is_wanted = is_wanted
        self._periods_s: dict[str, float] = {}
        self._due_s: dict[str, float] = {}
        self._not_before_s: dict[str, float] = {}
        self._heard: dict[str, bool] = {}
        self._asked_s = -math.inf

    def limit(self, rates_hz: Mapping[str, float]) -> None:
        """Apply other rates from now on; topics that are not named, or have a rate of 0, are never due."""
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

    def _is_heard(self, topic: str, at_s: float) -> bool:
        if at_s - self._asked_s > ASK_EVERY_S:
            self._asked_s = at_s
            self._heard.clear()
        heard = self._heard.get(topic)
        if heard is None:
            heard = self._heard[topic] = self._is_wanted(topic)
        return heard


class ZenohSink:
    """Sends the topics that have subscribers, each at most at its rate."""

    def __init__(self, bus: Publisher, car: str, rates: RatesHz) -> None:
        self._bus = bus
        self._names = {topic: (topics.key(car, topic), encoding(topic)) for topic in topics.TELEMETRY}
        self._gate = TopicGate(self._is_wanted)
        self.claim = self._gate.claim
        self.limit(rates)

    def limit(self, rates: RatesHz) -> None:
        """Apply other rates from now on."""
        self._gate.limit(rates.model_dump())

    def take(self, topic: str, schema: str, stamp_s: float, payload: bytes) -> None:  # noqa: ARG002 - both are in the payload
        """Send it; a slow or vanished reader loses it."""
        key, kind = self._names[topic]
        self._bus.put(key, payload, encoding=kind)

    def _is_wanted(self, topic: str) -> bool:
        key, kind = self._names[topic]
        return self._bus.wanted(key, encoding=kind)
