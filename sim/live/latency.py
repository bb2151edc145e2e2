"""Scan-to-motor latency, measured outside the runtime: last byte of a scan written -> next motor command read."""

from collections.abc import Mapping

import numpy as np


class LatencyProbe:
    """Pairs each scan with the first motor command that arrives after it.

    The mux also speaks on its own tick, so about one command in twenty answers no scan but comes just after one;
    that shortens a few samples and lengthens none.
    """

    def __init__(self) -> None:
        self._waiting_since_s: float | None = None
        self.samples_s: list[float] = []

    def scan_sent(self, at_s: float) -> None:
        """Record the end of a scan's last byte; an earlier scan without an answer is dropped."""
        self._waiting_since_s = at_s

    def command_received(self, at_s: float) -> None:
        """Record the arrival of a motor command."""
        if self._waiting_since_s is not None:
            self.samples_s.append(at_s - self._waiting_since_s)
            self._waiting_since_s = None

    def summary_ms(self) -> Mapping[str, float | None]:
        """Return p50, p99, p99_9 and max in milliseconds; None without samples."""
        if not self.samples_s:
            return dict.fromkeys(("p50", "p99", "p99_9", "max"))
        milliseconds = np.array(self.samples_s) * 1000
        p50, p99, p99_9 = np.percentile(milliseconds, [50, 99, 99.9])
        return {
            "p50": round(float(p50), 3),
            "p99": round(float(p99), 3),
            "p99_9": round(float(p99_9), 3),
            "max": round(float(milliseconds.max()), 3),
        }
