"""Figures of a run: errors, settling, contact, stops. All from the simulator's truth."""

import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from typing import Any

import numpy as np

from wallride.runtime.arbitration.command import Source
from wallride.sim.figures.summary import SETTLE_BAND_M, rounded
from wallride.sim.lab.cell import Figures, TabledCell
from wallride.sim.virtual.closed_loop import SimulatedRun
from wallride.sim.world.pose import Floats

STEADY_WAY = 0.25
"""Last share of a run, in which it should have settled."""
TOUCH_ABOVE_MPS = 0.05
"""Minimum speed of a counted contact; a slower one is a person walking into a standing car."""


def common(run: SimulatedRun) -> Figures:
    """Return the figures that every experiment reports of a run."""
    contact = run.contact
    return {
        "duration_s": number(run.time_s[-1]),
        "distance_m": number(run.distance_m),
        "mean_speed_mps": number(run.distance_m / run.time_s[-1]) if run.time_s[-1] > 0 else None,
        "collided": contact is not None and contact.speed_mps > TOUCH_ABOVE_MPS,
        "impact_mps": number(contact.speed_mps) if contact is not None else None,
        "min_clearance_m": 0.0 if contact is not None else number(run.clearance_m.min()),
        "stops": len(run.stops),
        "safety_stops": sum(stop.winner is Source.SAFETY for stop in run.stops),
        "stop_reasons": sorted({stop.reason for stop in run.stops}),
        "last_reason": run.reasons[-1] if run.reasons else "",
        "law_fault": run.law_fault,
        "stopped_for_good": bool(run.stops and math.isnan(run.stops[-1].until_s)),
        "speed_lost": speed_lost(run),
    }


def errors(run: SimulatedRun) -> Figures:
    """Return the true errors of following the wall, from the rear axle; each scan counts.

    Not the lab report's error, which is by its law's own distance: `wallride.sim.lab.report.drives` has both.
    """
    seen = np.isfinite(run.wall_m)
    error_m, time_s = run.error_m[seen], run.time_s[seen]
    if not error_m.size:
        return dict.fromkeys(("mean_error_m", "rms_error_m", "steady_error_m", "settle_s", "overshoot_m"))
    late = slice(int(len(error_m) * (1 - STEADY_WAY)), None)
    return {
        "mean_error_m": number(np.abs(error_m).mean()),
        "rms_error_m": number(np.sqrt((error_m**2).mean())),
        "steady_error_m": number(np.abs(error_m[late]).mean()),
        "settle_s": settle_s(time_s, error_m),
        "overshoot_m": overshoot_m(error_m),
    }


def settle_s(time_s: Floats, error_m: Floats) -> float | None:
    """Return the time after which the error stays within 5 cm; None when it does not."""
    outside = np.flatnonzero(np.abs(error_m) > SETTLE_BAND_M)
    if not outside.size:
        return 0.0
    after = int(outside[-1]) + 1
    return number(time_s[after]) if after < error_m.size else None


def overshoot_m(error_m: Floats) -> float | None:
    """Return the distance by which the car overshot the wanted distance, seen from the side on which it started."""
    return number(max(0.0, float((-error_m if error_m[0] > 0 else error_m).max())))


def speed_lost(run: SimulatedRun) -> float | None:
    """Return the share of the requested speed that safety removed."""
    wished = np.abs(run.wish[:, 0])
    lost = np.where(run.capped > 0, np.maximum(wished - np.abs(run.command[:, 0]), 0.0), 0.0)
    return number(lost.sum() / wished.sum()) if wished.sum() > 0 else None


number = rounded
Row = Mapping[str, Any]
Lines = Sequence[tuple[tuple[str, ...], Sequence[Row]]]
"""For each line of a table its first texts, and the rows of figures behind it."""


def chosen(rows: Sequence[Row], **wanted: object) -> list[Row]:
    """Return the rows whose fields have these values."""
    return [row for row in rows if all(row[name] == value for name, value in wanted.items())]


def distinct(rows: Sequence[Row], name: str) -> list[Any]:
    """Return the values of a field in order of appearance."""
    return list(dict.fromkeys(row[name] for row in rows))


def mean(rows: Sequence[Row], name: str) -> float:
    """Return the mean of a field over the rows that have it, NaN when none has."""
    values = [row[name] for row in rows if row[name] is not None]
    return float(np.mean(values)) if values else math.nan


def worst(rows: Sequence[Row], name: str) -> float:
    """Return the largest value of a field, NaN when no row has one."""
    return max((row[name] for row in rows if row[name] is not None), default=math.nan)


def text(value: float | None, digits: int = 3) -> str:
    """Return a number for a table, "-" for none."""
    return "-" if value is None or math.isnan(value) else f"{value:.{digits}f}"


def by_law(rows: Sequence[Row]) -> Iterator[tuple[str, list[Row]]]:
    """Yield each law with its rows, in order of appearance."""
    for law in distinct(rows, "law"):
        yield law, chosen(rows, law=law)


def by_law_and_friction(rows: Sequence[Row]) -> Iterator[tuple[str, list[Row]]]:
    """Yield the title ("ball+swept, mu 0.8") and the rows of each law and friction, the lowest friction first."""
    for law, of_law in by_law(rows):
        for mu in sorted(distinct(of_law, "mu")):
            yield f"{law}, mu {mu:g}", chosen(of_law, mu=mu)


def speed_table(
    title: str,
    names: tuple[str, ...],
    lines: Lines,
    figure: Callable[[Sequence[Row]], str],
    notes: tuple[str, ...] = (),
) -> TabledCell:
    """Return a table with a row per line and a column per speed; `names` are the titles of the columns before them."""
    speeds = sorted({row["speed_mps"] for _, some in lines for row in some})
    body = tuple((*first, *(figure(chosen(some, speed_mps=speed)) for speed in speeds)) for first, some in lines)
    return TabledCell(title, (*names, *(f"{speed:g} m/s" for speed in speeds)), body, notes)
