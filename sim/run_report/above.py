"""Views from above as SVG text: a track among the lidar's points, or one scan around the car."""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from html import escape

import numpy as np

from wallride.sim.run_report.charts import Scale, polyline, svg
from wallride.sim.world.pose import Floats

RULERS_M = (0.5, 1, 2, 5, 10, 20, 50, 100, 1000)
MIN_RULER_PX = 40
MAX_DOTS = 30_000
"""Maximum number of dots; more are thinned out evenly, because the page is to be mailed."""
SHOWN_PERCENT = (1.5, 98.5)
"""Percentiles of the dots within a view, besides the whole track: a far glimpse through a door must not shrink it."""


@dataclass(frozen=True, slots=True, eq=False)
class Above:
    """A view from above: dots (n,), a track (m,), numbered places, all metres; x right, y up."""

    dots_x_m: Floats
    dots_y_m: Floats
    track_x_m: Floats
    track_y_m: Floats
    places: Sequence[tuple[float, float, str]] = ()
    outline_m: Sequence[tuple[float, float]] = ()


def from_above(view: Above, width: int, *, tallest: int, around_m: float | None = None) -> str:
    """Return the view; around_m: exactly this far around the origin instead of all data."""
    if around_m is not None:
        left, right, low, high = -around_m, around_m, -around_m, around_m
    elif not view.dots_x_m.size + view.track_x_m.size:
        return '<p class="nothing">not recorded</p>'
    else:
        (left, right), (low, high) = _extent(view.dots_x_m, view.track_x_m), _extent(view.dots_y_m, view.track_y_m)
    margin_m = 0.03 * max(right - left, high - low, 1.0)
    left, right, low, high = left - margin_m, right + margin_m, low - margin_m, high + margin_m
    gain = min(width / (right - left), tallest / (high - low))
    height = round((high - low) * gain)
    x = Scale((width - (right - left) * gain) / 2 - left * gain, gain)
    y = Scale(high * gain, -gain)
    parts = [f'<path class="dots" d="{_dots(view, x, y, (left, right, low, high))}"/>']
    if view.outline_m:
        corners = " ".join(f"{x(px):.1f},{y(py):.1f}" for px, py in view.outline_m)
        parts.append(f'<polygon class="car" points="{corners}"/>')
    if len(view.track_x_m):
        steps = np.stack([x.offset + view.track_x_m * x.gain, y.offset + view.track_y_m * y.gain], axis=1)
        parts.append(f'<path class="line s1" d="{polyline(_thinned(steps))}"/>')
        parts.append(f'<circle class="start" cx="{steps[0, 0]:.1f}" cy="{steps[0, 1]:.1f}" r="5"/>')
    for px, py, text in view.places:
        parts.append(f'<circle class="stop" cx="{x(px):.1f}" cy="{y(py):.1f}" r="8"/>')
        parts.append(f'<text class="number" x="{x(px):.1f}" y="{y(py) + 3.5:.1f}">{escape(text)}</text>')
    parts.append(_ruler(x, height))
    return svg(width, height, parts, "view from above")


def _extent(dots_m: Floats, track_m: Floats) -> tuple[float, float]:
    ends = [*np.percentile(dots_m, SHOWN_PERCENT)] if dots_m.size else []
    ends += [track_m.min(), track_m.max()] if track_m.size else []
    return float(min(ends)), float(max(ends))


def _ruler(x: Scale, height: int) -> str:
    length_m = next(nice for nice in RULERS_M if nice * x.gain >= MIN_RULER_PX or nice == RULERS_M[-1])
    return (
        f'<path class="ruler" d="M10 {height - 8}h{length_m * x.gain:.1f}"/>'
        f'<text class="unit" x="10" y="{height - 13}">{length_m:g} m</text>'
    )


def _thinned(points: Floats, apart: float = 1.0) -> Floats:
    """Return the points that are at least a pixel from the previous kept one."""
    kept = [points[0]]
    for point in points[1:]:
        if abs(point - kept[-1]).max() >= apart:
            kept.append(point)
    return np.array([*kept, points[-1]])


def _dots(view: Above, x: Scale, y: Scale, edges: tuple[float, float, float, float]) -> str:
    left, right, low, high = edges
    inside = (view.dots_x_m > left) & (view.dots_x_m < right) & (view.dots_y_m > low) & (view.dots_y_m < high)
    across = np.rint(x.offset + view.dots_x_m[inside] * x.gain).astype(np.intp)
    down = np.rint(y.offset + view.dots_y_m[inside] * y.gain).astype(np.intp)
    places = list(dict.fromkeys(zip(across.tolist(), down.tolist(), strict=True)))
    places = places[:: math.ceil(len(places) / MAX_DOTS) or 1]
    return "".join(f"M{px} {py}h0" for px, py in places)
