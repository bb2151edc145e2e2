"""`wallride topic`: lists topics, their rate and volume, and prints their messages.

A subscriber changes what a car does: it writes only topics that have a subscriber. `hz` and `bw` of one topic
subscribe to that one alone.
"""

import argparse
import asyncio
import contextlib
import itertools
import json
import math
import statistics
import time
from collections import deque
from collections.abc import AsyncIterator, Callable
from dataclasses import dataclass, field

from wallride.clients.connection import ConnectionProblemError, connected
from wallride.clients.decoding import UnreadableError, as_json, as_text, decode
from wallride.runtime.ros.definitions import TYPES
from wallride.runtime.wire import topics
from wallride.runtime.wire.bus import Bus

KINDS = {**TYPES, **dict.fromkeys(topics.JSON_TOPICS, "JSON"), topics.BEAT: "wallride beat"}
LISTEN_S = 1.5
WINDOW = 1000
MAX_WAITING = 1000
REPORT_EVERY_S = 1.0
SILENT_S, SILENT_GAPS = 2.5, 2.5
"""Time without a message, and so many of the longest gap before it, after which a topic counts as silent."""
SLOWEST_S = 5.0
"""Period of the slowest topics by default, `map` and `line`."""
FIRST_WITHIN_S = 6.0
"""Timeout after which a topic without messages gets a sentence instead of an empty screen."""
PrintLine = Callable[[str], object]
Sample = tuple[str, bytes, float]
"""Topic, payload, arrival on this machine's monotonic clock [s]."""


@dataclass(slots=True)
class RateMeter:
    """Counts arrivals. The newest WINDOW of them are kept."""

    arrivals_s: deque[float] = field(default_factory=lambda: deque(maxlen=WINDOW))
    sizes: deque[int] = field(default_factory=lambda: deque(maxlen=WINDOW))

    def add(self, arrival_s: float, size: int) -> None:
        """Count one sample."""
        self.arrivals_s.append(arrival_s)
        self.sizes.append(size)

    @property
    def silent_after_s(self) -> float:
        """Return the time without a message after which this topic has fallen silent."""
        longest_s = max((b - a for a, b in itertools.pairwise(self.arrivals_s)), default=SLOWEST_S)
        return max(SILENT_S, SILENT_GAPS * longest_s)

    def clear(self) -> None:
        """Forget all samples."""
        self.arrivals_s.clear()
        self.sizes.clear()

    @property
    def rate_hz(self) -> float:
        """Return the mean rate; NaN before the second sample."""
        span_s = self._span_s
        return (len(self.arrivals_s) - 1) / span_s if span_s > 0 else math.nan

    @property
    def bytes_per_s(self) -> float:
        """Return the mean volume of payload; NaN before the second sample."""
        span_s = self._span_s
        return (sum(self.sizes) - self.sizes[0]) / span_s if span_s > 0 else math.nan

    def rate_line(self) -> str:
        """Return rate and regularity in a line."""
        gaps_s = [b - a for a, b in itertools.pairwise(self.arrivals_s)]
        if not gaps_s:
            return "one sample so far"
        spread_s = statistics.pstdev(gaps_s)
        return (
            f"{self.rate_hz:6.2f} Hz   gaps min {min(gaps_s) * 1000:.1f} ms, max {max(gaps_s) * 1000:.1f} ms,"
            f" deviation {spread_s * 1000:.1f} ms   ({len(self.arrivals_s)} samples)"
        )

    def fields(self) -> dict[str, int | float | None]:
        """Return rate and volume as plain values, None where they are not known yet."""
        rate_hz, bytes_per_s = self.rate_hz, self.bytes_per_s
        return {
            "samples": len(self.arrivals_s),
            "rate_hz": round(rate_hz, 2) if math.isfinite(rate_hz) else None,
            "bytes_per_s": round(bytes_per_s, 1) if math.isfinite(bytes_per_s) else None,
        }

    def volume_line(self) -> str:
        """Return the volume in a line."""
        if len(self.sizes) < 2:
            return "one sample so far"
        mean = statistics.fmean(self.sizes)
        return (
            f"{self.bytes_per_s / 1000:8.2f} kB/s   {self.bytes_per_s * 8 / 1e6:.3f} Mbit/s"
            f"   {mean:.0f} bytes a sample   ({len(self.sizes)} samples)"
        )

    @property
    def _span_s(self) -> float:
        return self.arrivals_s[-1] - self.arrivals_s[0] if len(self.arrivals_s) > 1 else 0.0


async def run(options: argparse.Namespace) -> int:
    """Run `wallride topic ACTION`; options as of `wallride.topic_options`."""
    topic = ""
    if options.action != "list":
        options.car, topic = split_topic(options.topic, options.car)
    async with connected(options) as (bus, car):
        match options.action:
            case "list":
                await list_topics(bus, car, options.print_line, seconds=options.seconds, as_json=options.json)
            case "echo":
                await echo(bus, car, topic, options)
            case _:
                await measure(bus, car, topic, options)
    return 0


def split_topic(text: str, car: str | None) -> tuple[str | None, str]:
    """Return car and topic of a user's text: `scan`, `/scan` or `wallride/car1/scan`."""
    name = text.strip("/")
    parts = name.split("/")
    if parts[0] == topics.ROOT and len(parts) == len(("root", "car", "topic")):
        if car not in {None, parts[1]}:
            raise ConnectionProblemError(
                f"{text} is a topic of {parts[1]}, but --car says {car}; leave one of them out"
            )
        car, name = parts[1], parts[2]
    if name not in KINDS:
        raise ConnectionProblemError(f"{text}: is not a topic; there are {', '.join(KINDS)}")
    return car, name


async def samples(bus: Bus, car: str, topic: str) -> AsyncIterator[Sample]:
    """Yield the samples received, `*` for every topic; ConnectionProblemError if none comes at first."""
    waiting: asyncio.Queue[Sample] = asyncio.Queue(MAX_WAITING)
    prefix = topics.key(car, "")

    def hear(key: str, payload: bytes, arrival_s: float) -> None:
        with contextlib.suppress(asyncio.QueueFull):  # a terminal slower than the car
            waiting.put_nowait((key.removeprefix(prefix), payload, arrival_s))

    bus.subscribe(topics.key(car, topic), hear)
    try:
        async with asyncio.timeout(FIRST_WITHIN_S):
            yield await waiting.get()
    except TimeoutError:
        raise ConnectionProblemError(_nothing_on(car, topic)) from None
    while True:
        yield await waiting.get()


def _nothing_on(car: str, topic: str) -> str:
    return (
        f"{car} says nothing on {topic}: a silent voice has no topic, and a rate of 0 turns one off"
        " (`wallride topic list` shows what is on the air)"
    )


async def list_topics(
    bus: Bus, car: str, print_line: PrintLine, *, seconds: float = LISTEN_S, as_json: bool = False
) -> None:
    """Subscribe to everything for a moment, then print the topics received."""
    meters = {topic: RateMeter() for topic in KINDS}
    prefix = topics.key(car, "")

    def hear(key: str, payload: bytes, arrival_s: float) -> None:
        meter = meters.get(key.removeprefix(prefix))
        if meter is not None:
            meter.add(arrival_s, len(payload))

    bus.subscribe(topics.key(car, "*"), hear)
    await asyncio.sleep(seconds)
    if as_json:
        print_line(
            json.dumps(
                [{"topic": topic, "type": kind, **meters[topic].fields()} for topic, kind in KINDS.items()], indent=2
            )
        )
        return
    for topic, kind in KINDS.items():
        meter = meters[topic]
        if not meter.arrivals_s:
            heard = "silent"
        elif math.isnan(meter.rate_hz):
            heard = "once"
        else:
            heard = f"{meter.rate_hz:.1f} Hz, {meter.bytes_per_s / 1000:.1f} kB/s"
        print_line(f"{topic:<15} {kind:<42} {heard}")


async def measure(bus: Bus, car: str, topic: str, options: argparse.Namespace) -> None:
    """Print rate or volume once a second; `options.count` lines, then end. A topic that falls silent begins anew."""
    meter = RateMeter()
    line = meter.rate_line if options.action == "hz" else meter.volume_line
    began_s = heard_s = time.monotonic()
    bus.subscribe(topics.key(car, topic), lambda _, payload, arrival_s: meter.add(arrival_s, len(payload)))
    said = 0
    while not options.count or said < options.count:
        await asyncio.sleep(REPORT_EVERY_S)
        heard_s = meter.arrivals_s[-1] if meter.arrivals_s else heard_s
        silent_s = time.monotonic() - heard_s
        if heard_s == began_s:
            if silent_s > FIRST_WITHIN_S:
                raise ConnectionProblemError(_nothing_on(car, topic))
            continue
        if meter.arrivals_s and silent_s > meter.silent_after_s:
            meter.clear()
        words = line() if meter.arrivals_s else f"nothing for {silent_s:.0f} s (car off? topic silent?)"
        options.print_line(json.dumps({"topic": topic, **meter.fields()}) if options.json else words)
        said += 1


async def echo(bus: Bus, car: str, topic: str, options: argparse.Namespace) -> None:
    """Print every message, as text or as one line of JSON each; `options.count` messages, then end."""
    said = 0
    async for name, payload, _ in samples(bus, car, topic):
        try:
            message = decode(name, payload)
        except UnreadableError as error:
            raise ConnectionProblemError(str(error)) from None
        options.print_line(as_json(message) if options.json else f"{as_text(message, whole=options.whole)}\n---")
        said += 1
        if said == options.count:
            return
