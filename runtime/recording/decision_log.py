"""The decision log: all inputs and results of decisions, in order and exactly; the source of a replay.

The hot path adds references, which takes less than a microsecond; another thread drains and encodes them
(`decision_codec`). Floats survive bit for bit (JSON's shortest form reads back as the same float64). Ranges are not in
the log: the recording holds a LaserScan for every delivered scan, its MCAP sequence number is the scan's, and its
ranges are the very float32 values.

Time is in the log too. A law or the mux that reads the clock while it decides gets the same readings in a replay:
`times_s` are those of one event, in order. For that, they all must read `DecisionLog.clock`.
"""

import itertools
from collections import deque
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from wallride.drivers.api import Clock, Correction, MotorState, Scan
from wallride.runtime.arbitration.command import Output, QueueEntry, Source
from wallride.runtime.control.guidance import Guidance
from wallride.runtime.control.perception.own_parts import KnownParts
from wallride.runtime.settings.tree import Settings

MAX_EVENTS = 8192
"""Maximum number of waiting events, about half a minute; of more the oldest are lost, which shows as a gap in their
numbers."""


@dataclass(frozen=True, slots=True)
class ScanEvent:
    """A delivered scan: all of it but its ranges."""

    number: int
    sequence: int
    stamp_s: float
    received_s: float
    angle_min_rad: float
    angle_step_rad: float
    range_min_m: float
    range_max_m: float
    beams: int
    ray_s: float = 0.0
    correction: Correction | None = None
    """0.0 and None also in recordings from before they were kept."""

    def scan(self, ranges_m: npt.NDArray[np.float32]) -> Scan:
        """Return the delivered scan, given the ranges of the LaserScan with the same sequence number."""
        return Scan(
            self.stamp_s, self.received_s, self.angle_min_rad, self.angle_step_rad, self.range_min_m,
            self.range_max_m, ranges_m, self.sequence, self.ray_s, correction=self.correction,
        )  # fmt: skip


@dataclass(frozen=True, slots=True)
class SafetyEvent:
    """Safety took in a scan, with this motor state; its speed limit was put right after."""

    number: int
    sequence: int
    motor: MotorState | None
    times_s: tuple[float, ...]


@dataclass(frozen=True, slots=True)
class FollowerEvent:
    """The follower answered a scan, with this motor state; its command was put right after."""

    number: int
    sequence: int
    motor: MotorState | None
    times_s: tuple[float, ...]
    guidance: Guidance


@dataclass(frozen=True, slots=True)
class OlderEvent:
    """An entry that was put or withdrawn: earlier versions kept them beside the decisions, which have them too."""

    number: int


@dataclass(frozen=True, slots=True)
class DecisionEvent:
    """A decision of the mux.

    times_s: the first is the decision's own time. elapsed_s: since the last decision.
    live: sources of the entries in force, most urgent first.
    words: the entries of sources that are no laws, as far as they differ from those of the last step; at the first step
        of a message all of them, so that a log may begin anywhere.
    """

    number: int
    times_s: tuple[float, ...]
    elapsed_s: float
    live: tuple[Source, ...]
    words: Mapping[Source, QueueEntry]
    output: Output


@dataclass(frozen=True, slots=True)
class SettingsEvent:
    """Settings came into force, the first ones included; as `Settings.model_validate` takes them."""

    number: int
    settings: Mapping[str, Any]


@dataclass(frozen=True, slots=True)
class OwnPartsEvent:
    """The laws received the known parts of the car from an earlier run, or None."""

    number: int
    parts: KnownParts | None


Event = ScanEvent | SafetyEvent | FollowerEvent | OlderEvent | DecisionEvent | SettingsEvent | OwnPartsEvent
LAWS = (Source.SAFETY, Source.NAVIGATION)  # a tuple is searched by identity first: five times as fast as a set
Heard = Sequence[Source | QueueEntry]
"""The entries in force: a law's by its source, other sources' in full."""


Entry = tuple[int, str, tuple[Any, ...]]
"""One event as the hot path leaves it, references only: its number since the process started, its kind, its parts."""


class DecisionLog:
    """Collects events. One thread adds (the car's loop), one drains.

    most: 0 is a log that keeps nothing, for a car without a recorder.
    """

    def __init__(self, clock: Clock, most: int = MAX_EVENTS) -> None:
        self._clock = clock
        self._entries: deque[Entry] = deque(maxlen=most)
        self._numbers = itertools.count()
        self._times_s: list[float] = []

    def clock(self) -> float:
        """Return the time, and record it for the current event."""
        now_s = self._clock()
        self._times_s.append(now_s)
        return now_s

    def begin(self) -> None:
        """Begin an event: the clock's readings from here on belong to it."""
        self._times_s = []

    def add_scan(self, scan: Scan) -> None:
        """Note that a scan was delivered."""
        self._entries.append((next(self._numbers), "scan", (scan,)))

    def add_safety(self, scan: Scan, motor: MotorState | None) -> None:
        """Note, after `begin`, that safety took in a scan."""
        self._entries.append((next(self._numbers), "look", (scan, motor, self._end())))

    def add_follower(self, scan: Scan, motor: MotorState | None, guidance: Guidance) -> None:
        """Note, after `begin`, what the follower answered."""
        self._entries.append((next(self._numbers), "follow", (scan, motor, self._end(), guidance)))

    def add_decision(self, elapsed_s: float, live: Sequence[QueueEntry], output: Output) -> None:
        """Note, after `begin`, a decision. live: the entries in force.

        Of a law's entry only the source is kept: its assessment refers to a scan and all that was computed from it.
        """
        heard = [word.source if word.source in LAWS else word for word in live]
        self._entries.append((next(self._numbers), "step", (self._end(), elapsed_s, heard, output)))

    def add_settings(self, settings: Settings) -> None:
        """Note the settings in force from here on."""
        self._entries.append((next(self._numbers), "settings", (settings,)))

    def add_own_parts(self, parts: KnownParts | None) -> None:
        """Note the car's own parts as the laws received them."""
        self._entries.append((next(self._numbers), "parts", (parts,)))

    def drain(self) -> list[Entry]:
        """Remove and return all events, oldest first; may be called in another thread than the rest."""
        return [self._entries.popleft() for _ in range(len(self._entries))]

    def _end(self) -> list[float]:
        """Return the times of the completed event; the clock's next readings belong to no event."""
        times_s, self._times_s = self._times_s, []
        return times_s
