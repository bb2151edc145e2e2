"""Scatter plots and bars as SVG text, in the look of `wallride.sim.run_report.charts`."""

from collections.abc import Sequence
from dataclasses import dataclass
from html import escape

import numpy as np

from wallride.sim.run_report.charts import (
    BOTTOM,
    HEIGHT,
    LEFT,
    RIGHT,
    TOP,
    WIDTH,
    Scale,
    column,
    limits,
    polyline,
    rows,
    svg,
    ticks,
)
from wallride.sim.world.pose import Floats


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
