"""Charts over time and bars as SVG text. No scripts and no colours: the page's style has them.

Marks carry classes: s1, s2, s3 are series, `dot`, `grid`, `axis`, `band`, `mark` are the parts of that name.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from html import escape

import numpy as np

from wallride.sim.world.pose import Floats

WIDTH, HEIGHT = 860, 230
LEFT, RIGHT, TOP, BOTTOM = 52, 14, 20, 30
TICKS = 6
NICE = (1.0, 2.0, 2.5, 5.0, 10.0)


@dataclass(frozen=True, slots=True, eq=False)
class ScatterPlot:
    """Points (n,) over each other. line: further points (m, 2) that a line joins. marked: of points (k, 2) in red."""

    x: Floats
    y: Floats
    x_unit: str
    y_unit: str
    line: Floats | None = None
    marked: Sequence[tuple[float, float]] = ()


def scatter(plot: ScatterPlot) -> str:
    """Return the plot."""
    marked = np.array(list(plot.marked), dtype=np.float64).reshape(-1, 2)
    xs, ys = np.concatenate([plot.x, marked[:, 0]]), np.concatenate([plot.y, marked[:, 1]])
    if not xs.size:
        return '<p class="nothing">nothing yet</p>'
    (left, right), (low, high) = limits(float(xs.min()), float(xs.max())), limits(float(ys.min()), float(ys.max()))
    x = Scale(LEFT - left * (WIDTH - LEFT - RIGHT) / (right - left), (WIDTH - LEFT - RIGHT) / (right - left))
    y = Scale(HEIGHT - BOTTOM + low * (HEIGHT - TOP - BOTTOM) / (high - low), -(HEIGHT - TOP - BOTTOM) / (high - low))
    parts = [rows(y, (low, high), plot.y_unit), *(column(x, value) for value in ticks(left, right))]
    parts.append(f'<text class="row" x="{WIDTH - RIGHT}" y="{HEIGHT - 1}">{escape(plot.x_unit)}</text>')
    if plot.line is not None and len(plot.line):
        steps = np.stack([x.offset + plot.line[:, 0] * x.gain, y.offset + plot.line[:, 1] * y.gain], axis=1)
        parts.append(f'<path class="line s1" d="{polyline(steps)}"/>')
    dots = "".join(f"M{x(px):.1f} {y(py):.1f}h0" for px, py in zip(plot.x, plot.y, strict=True))
    parts.append(f'<path class="dots points" d="{dots}"/>')
    parts += [f'<circle class="stop" cx="{x(px):.1f}" cy="{y(py):.1f}" r="6"/>' for px, py in plot.marked]
    return svg(WIDTH, HEIGHT, parts, f"{plot.y_unit} over {plot.x_unit}")


def shares(named: Sequence[tuple[str, float]]) -> str:
    """Return a table of bars; each value is a share of 1."""
    body = "".join(
        f"<tr><th>{escape(name)}</th><td>{100 * share:.0f} %</td>"
        f'<td class="wide"><i style="width:{100 * share:.0f}%"></i></td></tr>'
        for name, share in named
    )
    return f"<table><tbody>{body}</tbody></table>"


@dataclass(frozen=True, slots=True, eq=False)
class ChartLine:
    """One series: label for the legend, "" for none; style is its class; short: the label beside a value."""

    label: str
    time_s: Floats
    value: Floats
    style: str = "s1"
    short: str = ""


@dataclass(frozen=True, slots=True)
class Mark:
    """A numbered moment on a chart over time."""

    time_s: float
    text: str


@dataclass(frozen=True, slots=True)
class Scale:
    """Maps values to pixels: pixels = offset + value * gain."""

    offset: float
    gain: float

    def __call__(self, value: float) -> float:
        """Return the pixel."""
        return self.offset + value * self.gain


def over_time(
    lines: Sequence[ChartLine], unit: str, *, marks: Sequence[Mark] = (), band: tuple[float, float] | None = None,
    name: str = "",
) -> str:  # fmt: skip
    """Return lines over seconds with a grid; marks are vertical, the band is horizontal.

    name: under which the page's script finds the chart's values; "" for a chart that stays as it is.
    """
    shown = [line for line in lines if np.isfinite(line.value).any()]
    if not shown:
        return '<p class="nothing">not recorded</p>'
    until_s = max(float(line.time_s[-1]) for line in shown)
    values = np.concatenate([line.value[np.isfinite(line.value)] for line in shown] + [np.array(band or ())])
    low, high = limits(float(values.min()), float(values.max()))
    x = Scale(LEFT, (WIDTH - LEFT - RIGHT) / max(until_s, 1e-9))
    y = Scale(HEIGHT - BOTTOM + low * (HEIGHT - TOP - BOTTOM) / (high - low), -(HEIGHT - TOP - BOTTOM) / (high - low))
    parts = [_grid(x, y, until_s, (low, high), unit)]
    if band is not None:
        parts.append(
            f'<rect class="band" x="{LEFT}" y="{y(band[1]):.1f}" width="{WIDTH - LEFT - RIGHT}"'
            f' height="{y(band[0]) - y(band[1]):.1f}"/>'
        )
    parts += [_marked(x(mark.time_s), mark.text) for mark in marks]
    parts += [f'<path class="line {line.style}" d="{_trace(line, x, y)}"/>' for line in shown]
    return svg(WIDTH, HEIGHT, parts, f"{unit} over seconds", name) + _legend(shown)


def histogram(values: Floats, unit: str, step: float) -> str:
    """Return bars of how often a value was in each bin, in percent; bins are `step` wide and begin at whole steps."""
    finite = values[np.isfinite(values)]
    if not finite.size:
        return '<p class="nothing">not recorded</p>'
    while (finite.max() - finite.min()) / step > 80:
        step *= 2
    first, last = math.floor(finite.min() / step), math.floor(finite.max() / step)
    counts = np.bincount(np.floor(finite / step).astype(np.intp) - first, minlength=last - first + 1)
    percent = 100 * counts / finite.size
    low, high = first * step, (last + 1) * step
    x = Scale(LEFT - low * (WIDTH - LEFT - RIGHT) / (high - low), (WIDTH - LEFT - RIGHT) / (high - low))
    top = float(percent.max()) * 1.08
    y = Scale(HEIGHT - BOTTOM, -(HEIGHT - TOP - BOTTOM) / top)
    parts = [rows(y, (0.0, top), "%"), *(column(x, value) for value in ticks(low, high)), _caption(unit)]
    width = max(step * x.gain - 2, 1.0)
    for at, share in enumerate(percent):
        if share:
            left, peak = x(low + at * step) + 1, y(float(share))
            parts.append(
                f'<rect class="bar" x="{left:.1f}" y="{peak:.1f}" width="{width:.1f}"'
                f' height="{HEIGHT - BOTTOM - peak:.1f}"/>'
            )
    return svg(WIDTH, HEIGHT, parts, f"share of scans by {unit}")


def svg(width: int, height: int, parts: Sequence[str], title: str, chart: str = "") -> str:
    """Return a drawing that scales with the page. chart: name of the values that the page's script draws in it."""
    inside = "".join(parts)
    named = f' data-chart="{escape(chart)}"' if chart else ""
    return f'<svg viewBox="0 0 {width} {height}" role="img" aria-label="{escape(title)}"{named}>{inside}</svg>'


def _legend(lines: Sequence[ChartLine]) -> str:
    named = [line for line in lines if line.label]
    if len(named) < 2:
        return ""
    entries = "".join(f'<span><i class="{line.style}"></i>{escape(line.label)}</span>' for line in named)
    return f'<p class="legend">{entries}</p>'


def _grid(x: Scale, y: Scale, until_s: float, span: tuple[float, float], unit: str) -> str:
    columns = "".join(column(x, value) for value in ticks(0.0, until_s))
    return rows(y, span, unit) + columns + _caption("s")


def rows(y: Scale, span: tuple[float, float], unit: str) -> str:
    """Return the horizontal grid with its numbers."""
    rows = []
    for value in ticks(*span):
        at = y(value)
        rows.append(f'<path class="grid" d="M{LEFT} {at:.1f}H{WIDTH - RIGHT}"/>')
        rows.append(f'<text class="row" x="{LEFT - 6}" y="{at + 3.5:.1f}">{value:g}</text>')
    rows.append(f'<text class="row" x="{LEFT - 6}" y="11">{escape(unit)}</text>')
    return "".join(rows)


def column(x: Scale, value: float) -> str:
    """Return one tick below a chart."""
    at, bottom = x(value), HEIGHT - BOTTOM
    tick = f'<path class="axis" d="M{at:.1f} {bottom}v4"/>'
    return f'{tick}<text class="col" x="{at:.1f}" y="{bottom + 17}">{value:g}</text>'


def _caption(unit: str) -> str:
    bottom = HEIGHT - BOTTOM
    line = f'<path class="axis" d="M{LEFT} {bottom}H{WIDTH - RIGHT}"/>'
    return f'{line}<text class="row" x="{WIDTH - RIGHT}" y="{HEIGHT - 1}">{escape(unit)}</text>'


def _marked(at: float, text: str) -> str:
    return (
        f'<path class="mark" d="M{at:.1f} {TOP}V{HEIGHT - BOTTOM}"/>'
        f'<text class="marked" x="{at + 3:.1f}" y="{HEIGHT - BOTTOM - 4}">{escape(text)}</text>'
    )


def limits(low: float, high: float) -> tuple[float, float]:
    """Return the ends of an axis: a little beyond the values."""
    margin = 0.06 * (high - low) or 0.5
    return low - margin, high + margin


def ticks(low: float, high: float) -> list[float]:
    """Return round numbers within a span."""
    rough = max(high - low, 1e-9) / TICKS
    power = 10.0 ** math.floor(math.log10(rough))
    step = next(nice * power for nice in NICE if nice * power >= rough * 0.999)
    first = math.ceil(low / step - 1e-9)
    return [round(at * step, 10) for at in range(first, math.floor(high / step + 1e-9) + 1)]


def _trace(line: ChartLine, x: Scale, y: Scale) -> str:
    """Return a path with gaps where there is no value; of many points in one pixel only the extremes."""
    across = x.offset + line.time_s * x.gain
    down = y.offset + line.value * y.gain
    pieces, begin = [], 0
    known = np.isfinite(down)
    for end in [*(np.flatnonzero(~known)), len(down)]:
        if end > begin:
            pieces.append(polyline(_envelope(across[begin:end], down[begin:end])))
        begin = int(end) + 1
    return "".join(pieces)


def _envelope(across: Floats, down: Floats) -> Floats:
    """Return points (n, 2): at most four in each column of pixels (first, lowest, highest, last)."""
    column = np.floor(across).astype(np.intp)
    if len(across) <= 4 * (column[-1] - column[0] + 1):
        return np.stack([across, down], axis=1)
    starts = np.flatnonzero(np.diff(column, prepend=column[0] - 1))
    keep: list[int] = []
    for begin, end in zip(starts, [*starts[1:], len(across)], strict=True):
        piece = down[begin:end]
        keep += sorted({int(begin), int(begin + piece.argmin()), int(begin + piece.argmax()), int(end) - 1})
    return np.stack([across[keep], down[keep]], axis=1)


def polyline(points: Floats) -> str:
    """Return points (n, 2) as one path."""
    first, *rest = (f"{px:.1f} {py:.1f}" for px, py in points)
    return f"M{first}" + (f"L{' '.join(rest)}" if rest else "h.1")
