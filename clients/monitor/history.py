"""History of one car's last minutes as a page plots them, for a page that is opened or comes back later. Pure."""

import math
import struct
from collections import deque
from collections.abc import Mapping
from typing import Any

from wallride.runtime.wire import topics
from wallride.runtime.wire.teleop import session_text

MAX_HISTORY_S = 300.0
MAX_CARS = 32
APART_S = 0.2
"""Minimum distance of samples; a plot of minutes has fewer pixels than that."""
NAMES = ("error", "asked", "sent", "driven", "steering", "latency", "round_trip")
_FLOAT32 = struct.Struct("<4xf")


class Track:
    """Values of one line over time; the oldest go after MAX_HISTORY_S."""

    def __init__(self) -> None:
        self._samples: deque[tuple[float, float]] = deque(maxlen=round(MAX_HISTORY_S / APART_S))

    def is_due(self, at_s: float) -> bool:
        """Return whether a sample now is far enough from the last one."""
        return not self._samples or at_s - self._samples[-1][0] >= APART_S

    def add(self, at_s: float, value: object) -> None:
        """Keep a value; NaN and infinity are kept as None, which a plot shows as a gap."""
        number = float(value) if isinstance(value, int | float) and math.isfinite(value) else math.nan
        self._samples.append((at_s, number))

    def fields(self, now_s: float) -> dict[str, list[float | None]]:
        """Return ages [ms], oldest first, and values."""
        kept = [(at_s, value) for at_s, value in self._samples if now_s - at_s <= MAX_HISTORY_S]
        return {
            "age_ms": [round((now_s - at_s) * 1000) for at_s, _ in kept],
            "value": [round(value, 5) if math.isfinite(value) else None for _, value in kept],
        }


class PlotHistory:
    """Collects the plotted values of a car."""

    def __init__(self) -> None:
        self._tracks = {name: Track() for name in NAMES}

    def take(self, topic: str, payload: bytes, arrival_s: float) -> None:
        """Add a sample of a topic; an invalid one is left out, as the page leaves it out."""
        try:
            if topic == topics.DISTANCE_ERROR and self._tracks["error"].is_due(arrival_s):
                self._tracks["error"].add(arrival_s, _FLOAT32.unpack(payload)[0])
            elif topic == topics.STATUS and self._tracks["driven"].is_due(arrival_s):
                self._take_status(topics.decode(payload), arrival_s)
        except (AttributeError, OverflowError, ValueError, TypeError, struct.error):
            return

    def take_round_trip(self, seconds: float | None, at_s: float) -> None:
        """Add a measured round trip [s], None for one without an answer."""
        self._tracks["round_trip"].add(at_s, None if seconds is None else seconds * 1000)

    def fields(self, now_s: float) -> dict[str, Any]:
        """Return every line as plain values; speeds in m/s, steering in rad, latencies in ms, the error in m."""
        return {name: track.fields(now_s) for name, track in self._tracks.items()}

    def _take_status(self, status: Mapping[str, Any], at_s: float) -> None:
        output, latency = status.get("output") or {}, status.get("scan_to_motor_ms") or {}
        self._tracks["asked"].add(at_s, output.get("asked_mps"))
        self._tracks["sent"].add(at_s, output.get("speed_mps"))
        self._tracks["driven"].add(at_s, status.get("speed_mps"))
        self._tracks["steering"].add(at_s, output.get("steering_rad"))
        self._tracks["latency"].add(at_s, latency.get("p99"))


class CarHistories:
    """Plot histories of the cars at one endpoint, kept while no page watches them.

    session: the selected start of a car there, None for any; without a status of it nothing of that car is kept.
    """

    TOPICS = (topics.STATUS, topics.DISTANCE_ERROR)

    def __init__(self, session: int | None = None) -> None:
        self._session = None if session is None else session_text(session)
        self._cars: dict[str, PlotHistory] = {}
        self._selected: set[str] = set()

    def of(self, car: str) -> PlotHistory:
        """Return the history of a car, an empty one where nothing was received; at most MAX_CARS are kept."""
        found = self._cars.get(car) or PlotHistory()
        if len(self._cars) < MAX_CARS:
            self._cars[car] = found
        return found

    def take(self, key: str, payload: bytes, arrival_s: float) -> None:
        """Add a sample of any car."""
        _, car, topic = key.split("/", 2)
        if self._is_selected(car, topic, payload):
            self.of(car).take(topic, payload, arrival_s)

    def _is_selected(self, car: str, topic: str, payload: bytes) -> bool:
        if self._session is None:
            return True
        if topic == topics.STATUS:
            try:
                is_it = topics.decode(payload).get("session") == self._session
            except (ValueError, TypeError):
                return False
            (self._selected.add if is_it else self._selected.discard)(car)
        return car in self._selected
