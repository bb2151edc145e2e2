"""`wallride plot`: numbers of a car's topics as curves in this terminal, live, for use over ssh."""

import argparse
import asyncio
import math
import re
import shutil
import sys
import time
from collections import deque
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from types import MappingProxyType
from typing import Any

from wallride.clients.connection import ConnectionProblemError, connected
from wallride.clients.decoding import UnreadableError, decode
from wallride.clients.refreshing import RefreshedScreen
from wallride.clients.topics import SILENT_S, split_topic
from wallride.runtime.host.terminal_text import one_line
from wallride.runtime.wire import topics

FIELDS: Mapping[str, str] = MappingProxyType(
    {name: topic.number for name, topic in topics.TELEMETRY.items() if topic.number} | {topics.BEAT: "speed_mps"}
)
"""Field plotted of a topic by default."""
REFRESH_S = 0.25
MAX_POINTS = 4000
MIN_ROWS = 7
ESCAPES = re.compile(r"\x1b\[[0-9;]*m")
"""Codes of colours, which only a terminal takes."""


@dataclass(slots=True)
class Curve:
    """One number of one topic over time. trouble: why there is none, "" while there is."""

    topic: str
    path: str
    points: deque[tuple[float, float]] = field(default_factory=lambda: deque(maxlen=MAX_POINTS))
    trouble: str = "nothing heard yet"

    def hear(self, payload: bytes, arrival_s: float) -> None:
        """Add one message."""
        try:
            value = number_at(decode(self.topic, payload), self.path)
        except (UnreadableError, LookupError, OverflowError) as error:
            self.trouble = str(error.args[0])
            return
        self.trouble = ""
        self.points.append((arrival_s, value))

    def title(self, now_s: float) -> str:
        """Return the name and the newest value, with its age where no other has come."""
        if self.trouble:
            return one_line(f"{self.topic}: {self.trouble}")
        at_s, value = self.points[-1]
        age = f"  (silent for {now_s - at_s:.0f} s)" if now_s - at_s > SILENT_S else ""
        return f"{self.topic}:{self.path}  {value:.4g}{age}"


def curve_of(text: str, car: str | None) -> tuple[str | None, Curve]:
    """Return car and curve of a user's text: `scan`-like topic names, `:` and a field."""
    name, _, path = text.partition(":")
    car, topic = split_topic(name, car)
    path = path or FIELDS.get(topic, "")
    if not path:
        raise ConnectionProblemError(
            f"{topic} has no number of its own: name a field, for example {topic}:header.stamp.sec"
        )
    return car, Curve(topic, path)


def number_at(message: Mapping[str, Any], path: str) -> float:
    """Return the number behind a path such as `velocity.0`; LookupError with the remedy. null is NaN."""
    value: Any = message
    for part in path.split("."):
        if isinstance(value, Mapping) and part in value:
            value = value[part]
        elif isinstance(value, list) and part.isdigit() and int(part) < len(value):
            value = value[int(part)]
        else:
            known = ", ".join(value) if isinstance(value, Mapping) else "a number from 0" if value else "nothing"
            raise LookupError(f"has no {part} in {path}; there is {known}")
    if value is None:
        return math.nan
    if not isinstance(value, bool | int | float):
        raise LookupError(f"{path} is no number")  # noqa: TRY004 - as for a field that is not there
    return float(value)


def drawing(curves: Sequence[Curve], now_s: float, past_s: float, size: tuple[int, int]) -> str:
    """Return the curves one below the other as text of this many columns and rows."""
    from plotext import figure  # type: ignore[import-untyped]

    columns, rows = size
    figure.clear()
    if len(curves) > 1:
        figure.subplots(len(curves), 1)
    figure.plot_size(columns, max(rows, MIN_ROWS * len(curves)))
    figure.theme("colorless")
    for place, curve in enumerate(curves, 1):
        plot = figure.subplot(place, 1) if len(curves) > 1 else figure
        plot.title(curve.title(now_s))
        plot.ruler("x").lim(-past_s, 0)
        points = [
            (at_s - now_s, value) for at_s, value in curve.points if now_s - at_s <= past_s and math.isfinite(value)
        ]
        if points:
            plot.draw(plot.signal([at_s for at_s, _ in points], [value for _, value in points], marker="braille"))
    return str(figure.build())


async def run(options: argparse.Namespace) -> int:
    """Draw until interrupted; options as of `wallride.report_options`."""
    curves = []
    for text in options.topics:
        options.car, curve = curve_of(text, options.car)
        curves.append(curve)
    async with connected(options) as (bus, car):
        for topic in dict.fromkeys(curve.topic for curve in curves):
            bus.subscribe(topics.key(car, topic), _all([curve for curve in curves if curve.topic == topic]))
        if options.once:
            await asyncio.sleep(options.seconds)
            options.print_line(_screen(curves, options.seconds))
            return 0
        shown = RefreshedScreen(options.print_line)
        while True:
            shown.show(_screen(curves, options.seconds), "; ".join(curve.title(time.monotonic()) for curve in curves))
            await asyncio.sleep(REFRESH_S)


def _all(curves: Sequence[Curve]) -> Callable[[str, bytes, float], None]:
    def hear(_: str, payload: bytes, arrival_s: float) -> None:
        for curve in curves:
            curve.hear(payload, arrival_s)

    return hear


def _screen(curves: Sequence[Curve], past_s: float) -> str:
    columns, rows = shutil.get_terminal_size((100, 30))
    drawn = drawing(curves, time.monotonic(), past_s, (columns, rows - 1))
    return drawn if sys.stdout.isatty() else ESCAPES.sub("", drawn)
