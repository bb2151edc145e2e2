"""Duration of each stage between a scan's bytes and the motor's, since the start. Under a microsecond per stage.

A histogram with buckets a sixteenth of an octave wide: no sample is kept, nothing grows, and a percentile is accurate
to 3 %. On the hot path, `begin` and `end` only read the clock; `count` fills the histograms off it.
"""

import gc
import math
from bisect import bisect_left
from collections import deque
from collections.abc import Sequence
from itertools import accumulate
from typing import Any, Literal

from wallride.drivers.api import Clock

SUB_BITS = 4
_SUB = 1 << SUB_BITS
_TICKS_PER_S = 1e7
"""Resolution of the histogram: times are counted in 0.1 us; below 1.6 us every tick has its own bucket."""
_OCTAVES = 32
SUMMED_EVERY_S = 1.0
MAX_UNCOUNTED = 256
"""Maximum number of waiting durations: a second of ticks without a scan; beyond it the oldest are lost."""


class Histogram:
    """Counts durations; `fields` summarizes them."""

    __slots__ = ("_counts", "longest_s", "total")

    def __init__(self) -> None:
        self._counts = [0] * (_SUB * _OCTAVES)
        self.longest_s = 0.0
        self.total = 0

    def add(self, seconds: float) -> None:
        """Count one; negative ones count as 0, those above 100 minutes as 100 minutes."""
        ticks = int(seconds * _TICKS_PER_S)
        shift = ticks.bit_length() - SUB_BITS - 1
        bucket = (shift << SUB_BITS) + (ticks >> shift) if shift > 0 else max(ticks, 0)
        self._counts[min(bucket, len(self._counts) - 1)] += 1
        self.total += 1
        if seconds > self.longest_s:
            self.longest_s = seconds

    def quantiles_s(self, shares: Sequence[float]) -> list[float]:
        """Return the duration that each share of the samples did not exceed, to 3 %; zeros without samples."""
        if not self.total:
            return [0.0] * len(shares)
        seen = list(accumulate(self._counts))
        buckets = [bisect_left(seen, max(1.0, share * self.total)) for share in shares]
        return [min(_middle_ticks(bucket) / _TICKS_PER_S, self.longest_s) for bucket in buckets]

    def fields(self) -> dict[str, float]:
        """Return count, and p50, p99, p99_9 and max in microseconds."""
        p50_s, p99_s, p99_9_s = self.quantiles_s((0.5, 0.99, 0.999))
        times_s = {"p50": p50_s, "p99": p99_s, "p99_9": p99_9_s, "max": self.longest_s}
        return {"count": self.total, **{name: round(time_s * 1e6, 1) for name, time_s in times_s.items()}}


Uncounted = deque[tuple[Histogram, float]]


class TimedStage:
    """One stage of the hot path, from `begin` to `end`."""

    __slots__ = ("_began_s", "_clock", "_uncounted", "histogram")

    def __init__(self, clock: Clock, uncounted: "Uncounted | None" = None) -> None:
        self._clock = clock
        self._began_s = 0.0
        self._uncounted = uncounted if uncounted is not None else deque(maxlen=0)
        self.histogram = Histogram()

    def begin(self) -> None:
        """Note the start."""
        self._began_s = self._clock()

    def end(self) -> None:
        """Note the end."""
        self._uncounted.append((self.histogram, self._clock() - self._began_s))


class StageTimer:
    """All timing statistics of the car: stages, the whole path, the loop's lag, garbage collections.

    missed_ticks: deadlines of the mux's tick that passed while the loop was busy.
    """

    def __init__(self, clock: Clock) -> None:
        self._clock = clock
        self._uncounted: Uncounted = deque(maxlen=MAX_UNCOUNTED)
        self.read = Histogram()
        self.decode = Histogram()
        self.safety = TimedStage(clock, self._uncounted)
        self.follow = TimedStage(clock, self._uncounted)
        self.mux = TimedStage(clock, self._uncounted)
        self.write = TimedStage(clock, self._uncounted)
        self.scan_to_motor = Histogram()
        self.loop_lag = Histogram()
        self.collections = [Histogram() for _ in range(3)]
        self.missed_ticks = 0
        self._collecting_since_s = 0.0
        self._summary: dict[str, Any] = {}
        self._summed_s = -math.inf

    def on_scan(self, received_s: float, reading_s: float) -> None:
        """Note a scan that was decoded just now. reading_s: duration of the read from the kernel."""
        self._uncounted.append((self.read, reading_s))
        self._uncounted.append((self.decode, self._clock() - received_s - reading_s))

    def count(self) -> None:
        """Count the durations since the last call; call it when nothing is waiting, at least after every scan."""
        while self._uncounted:
            histogram, took_s = self._uncounted.popleft()
            histogram.add(took_s)

    def on_tick(self, late_s: float, missed: int) -> None:
        """Note the delay of the loop after a deadline."""
        self.loop_lag.add(late_s)
        self.missed_ticks += missed

    def watch_collections(self) -> None:
        """Time the garbage collector from now on, until `ignore_collections`."""
        gc.callbacks.append(self._on_collection)

    def ignore_collections(self) -> None:
        """Undo `watch_collections`; harmless when repeated."""
        if self._on_collection in gc.callbacks:
            gc.callbacks.remove(self._on_collection)

    def fields(self) -> dict[str, Any]:
        """Return all statistics as plain values, times in microseconds; what never occurred is left out.

        Computed at most once a second: it is read ten times as often.
        """
        if self._clock() - self._summed_s >= SUMMED_EVERY_S:
            self.count()
            self._summed_s = self._clock()
            histograms = {name: histogram.fields() for name, histogram in self._named() if histogram.total}
            self._summary = {**histograms, "missed_ticks": self.missed_ticks}
        return self._summary

    def table(self) -> list[str]:
        """Return the same as lines of text."""
        self.count()
        lines = [f"{'us':<16}{'count':>9}{'p50':>9}{'p99':>9}{'p99.9':>9}{'max':>9}"]
        for name, histogram in self._named():
            if histogram.total:
                row = histogram.fields()
                times = "".join(f"{row[column]:9.0f}" for column in ("p50", "p99", "p99_9", "max"))
                lines.append(f"{name:<16}{histogram.total:9d}{times}")
        return lines

    def _named(self) -> list[tuple[str, Histogram]]:
        """Return the stages in the order of a scan's path, then that whole path: its rest is the loop's own time."""
        return [
            ("read", self.read),
            ("decode", self.decode),
            ("safety", self.safety.histogram),
            ("follow", self.follow.histogram),
            ("mux", self.mux.histogram),
            ("write", self.write.histogram),
            ("scan_to_motor", self.scan_to_motor),
            ("loop_lag", self.loop_lag),
            *((f"gc{generation}", pauses) for generation, pauses in enumerate(self.collections)),
        ]

    def _on_collection(self, phase: Literal["start", "stop"], info: dict[str, int]) -> None:
        if phase == "start":
            self._collecting_since_s = self._clock()
        else:
            self.collections[info["generation"]].add(self._clock() - self._collecting_since_s)


def _middle_ticks(bucket: int) -> float:
    """Return the middle of a bucket, in ticks of 0.1 us."""
    if bucket < 2 * _SUB:
        return bucket + 0.5
    shift = (bucket >> SUB_BITS) - 1
    return (bucket - (shift << SUB_BITS) + 0.5) * (1 << shift)
