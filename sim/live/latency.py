"""Scan-to-motor latency, measured outside the runtime: last byte of a scan written -> next motor command read.

And how often this computer kept the emulated devices themselves from running.
"""

import math
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from wallride.runtime.telemetry.screen_words import times

SHORTEST_S, LONGEST_S = 1e-6, 100.0
RESOLUTION = 0.001
"""Relative."""
MISSED_S = 0.15
"""Delay of a step of the emulated devices from which on a car may miss them: a motor controller's own timeout."""


class LatencyProbe:
    """Pairs each scan with the first motor command that arrives after it.

    The mux also speaks on its own tick, so about one command in twenty answers no scan but comes just after one;
    that shortens a few samples and lengthens none. The samples are counted by size, in steps of RESOLUTION.
    """

    def __init__(self) -> None:
        self._waiting_since_s: float | None = None
        self._counts = np.zeros(round(math.log(LONGEST_S / SHORTEST_S) / RESOLUTION) + 1, dtype=np.int64)
        self._max_s = 0.0

    def scan_sent(self, at_s: float) -> None:
        """Record the end of a scan's last byte; an earlier scan without an answer is dropped."""
        self._waiting_since_s = at_s

    def command_received(self, at_s: float) -> None:
        """Record the arrival of a motor command."""
        if self._waiting_since_s is not None:
            took_s = min(max(at_s - self._waiting_since_s, SHORTEST_S), LONGEST_S)
            self._counts[round(math.log(took_s / SHORTEST_S) / RESOLUTION)] += 1
            self._max_s = max(self._max_s, took_s)
            self._waiting_since_s = None

    def summary_ms(self) -> Mapping[str, float | None]:
        """Return p50, p99, p99_9 and max in milliseconds; None without samples."""
        counted = np.cumsum(self._counts)
        if not counted[-1]:
            return dict.fromkeys(("p50", "p99", "p99_9", "max"))
        places = np.searchsorted(counted, np.array([0.5, 0.99, 0.999]) * counted[-1])
        p50, p99, p99_9 = np.minimum(SHORTEST_S * np.exp(places * RESOLUTION), self._max_s) * 1000
        return {
            "p50": round(float(p50), 3),
            "p99": round(float(p99), 3),
            "p99_9": round(float(p99_9), 3),
            "max": round(self._max_s * 1000, 3),
        }


@dataclass(slots=True)
class HeldUp:
    """How often and how long this computer kept the emulated devices from running: then a car takes them for lost."""

    count: int = 0
    longest_s: float = 0.0

    def note(self, late_s: float) -> bool:
        """Take how late a step of the devices was; True where a car may have missed them."""
        is_missed = late_s >= MISSED_S
        self.count += is_missed
        self.longest_s = max(self.longest_s, late_s)
        return is_missed

    @property
    def words(self) -> str:
        """Return what it means, "" where nothing was held up for long."""
        if not self.count:
            return ""
        return (
            f"this computer is too busy to be a car: it held the emulated devices up {times(self.count)}, for up to"
            f" {self.longest_s:.2f} s; a device that the car lost then was there"
        )
