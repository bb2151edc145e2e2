"""`lab walls`: error of the wanted distance, beside that of the best way that a search found."""

import math
import statistics
from collections.abc import Sequence
from dataclasses import replace

from wallride.sim.figures.summary import SETTLE_BAND_M
from wallride.sim.lab.cell import DESIRED_M, Cell, CellChoice, Experiment, Figures, TabledCell
from wallride.sim.lab.courses.walls import ALL_COURSES, STRAIGHT_COURSES, case_of
from wallride.sim.lab.figures import (
    STEADY_WAY,
    Row,
    by_law_and_friction,
    chosen,
    common,
    distinct,
    errors,
    mean,
    number,
    speed_table,
    text,
    worst,
)
from wallride.sim.lab.laws import drive_case
from wallride.sim.lab.limits import limit_m
from wallride.sim.virtual.closed_loop import SimulatedRun

LOST_ABOVE_M = 0.5
"""Minimum error at the end of a run that lost its wall."""
QUICK_COURSES = ("t1", "t3", "t4", "t5", "outside_corner")
REPORT_TABLE_M = {
    "t1": (0.148, 0.175, 0.266, None),
    "t2": (0.098, 0.101, 0.116, 0.174),
    "t3": (0.124, 0.120, 0.114, 0.105),
    "t4": (0.177, 0.199, None, None),
    "t5": (None, None, None, None),
}
"""Errors of the report's law in another simulator (not of the report), mu 0.8, 1 to 4 m/s; None: contact."""
LEGEND = (
    (
        "a cell: mean |error| / that of the best way that a search with full knowledge found [m]; X: touched something;"
        " stands: did not drive on; lost: without its wall at the end; empty: no figure"
    ),
    (
        f"settle s: until the error stays within {100 * SETTLE_BAND_M:g} cm [s]; steady mm: mean error over the last"
        f" {STEADY_WAY:.0%} of the way [mm]; stops: of safety. t1, t2 start too near, t3, t4 too far; t5: a corner"
    ),
)


def cells(choice: CellChoice) -> list[Cell]:
    """Return what is to be run."""
    return choice.cells("walls", QUICK_COURSES if choice.quick else ALL_COURSES)


def run(cell: Cell) -> SimulatedRun:
    """Drive one cell."""
    case = case_of(cell.scenario, cell.speed_mps, cell.mu, cell.side, cell.seed, cell.desired_m)
    return drive_case(cell, replace(case, standing_s=3.0))


def measure(cell: Cell) -> Figures:
    """Drive one cell and compare it with its limit."""
    done = run(cell)
    figures = {**common(done), **errors(done)}
    case = done.case
    steady_m = figures["steady_error_m"]
    figures["lost"] = steady_m is None or steady_m > LOST_ABOVE_M
    figures["completed"] = done.contact is None and done.distance_m >= case.distance_m and not figures["lost"]
    figures["limit_m"] = number(limit_m(cell.scenario, cell.speed_mps, cell.mu, cell.desired_m))
    return figures


def tables(rows: Sequence[Row]) -> list[TabledCell]:
    """Return one table per law and friction: a row per course, a column per speed."""
    made = []
    for title, some in by_law_and_friction(rows):
        lines = [((name,), chosen(some, scenario=name)) for name in ALL_COURSES if name in distinct(some, "scenario")]
        what = f"{title}{_asked(some)}: mean |error| / best found [m]"
        table = speed_table(what, ("course",), lines, _figure, _notes(some))
        further = [_settled(name, of) for (name,), of in lines]
        body = tuple((*line, *more) for line, more in zip(table.rows, further, strict=True))
        made.append(replace(table, columns=(*table.columns, "settle s", "steady mm", "stops"), rows=body))
    if made:
        made[-1] = replace(made[-1], notes=(*made[-1].notes, *LEGEND))
    if any(row["law"].startswith("report") for row in rows):
        made.append(_published(rows))
    return made


def _asked(rows: Sequence[Row]) -> str:
    return "".join(f", {desired_m:g} m" for desired_m in distinct(rows, "desired_m") if desired_m != DESIRED_M)


def _settled(name: str, rows: Sequence[Row]) -> tuple[str, ...]:
    """Return the settling time, the steady error and the number of safety's stops of a course, for all speeds."""
    whole = [row for row in rows if row["completed"]]
    settling = worst(whole, "settle_s") if all(row["settle_s"] is not None for row in whole) else math.nan
    return (
        text(settling, 1) if name in STRAIGHT_COURSES else "",
        text(1000 * mean(whole, "steady_error_m"), 0),
        str(sum(row["safety_stops"] for row in rows)),
    )


def _figure(rows: Sequence[Row]) -> str:
    """Return the mean error over sides and seeds beside the limit; the number and kinds of failures."""
    collided = sum(row["collided"] for row in rows)
    stuck = sum(row["stopped_for_good"] and not row["collided"] for row in rows)
    lost = sum(row["lost"] and not row["stopped_for_good"] and not row["collided"] for row in rows)
    whole = [row for row in rows if row["completed"]]
    parts = [text(mean(whole, "mean_error_m")) + " / " + text(mean(rows, "limit_m"))] if whole else []
    parts += [f"X {collided} of {len(rows)}"] if collided else []
    parts += [f"stands {stuck} of {len(rows)}"] if stuck else []
    parts += [f"lost {lost} of {len(rows)}"] if lost else []
    return ", ".join(parts)


def _notes(rows: Sequence[Row]) -> tuple[str, ...]:
    contacts, failed = sum(row["collided"] for row in rows), sum(not row["completed"] for row in rows)
    notes = [f"{contacts} contacts, {failed} of {len(rows)} not completed"]
    if rows[0]["conditions"]:
        notes.append(f"the best way is that of the simulator's own car; these had {', '.join(rows[0]['conditions'])}")
    ratios = [
        row["mean_error_m"] / row["limit_m"]
        for row in rows
        if row["completed"] and row["limit_m"] and row["scenario"] in STRAIGHT_COURSES
    ]
    if ratios:
        notes.append(
            f"t1 to t4: error / that of the best way found: median {statistics.median(ratios):.2f}, worst"
            f" {max(ratios):.2f}; below 1 the drive was better than what the search found"
        )
    return tuple(notes)


def _published(rows: Sequence[Row]) -> TabledCell:
    lines = [
        (name, *("X" if value is None else text(value) for value in values))
        for name, values in REPORT_TABLE_M.items()
        if name in distinct(rows, "scenario")
    ]
    title = "for comparison: the report's law in another simulator, friction 0.8 [m]; X: touched something"
    return TabledCell(title, ("course", "1 m/s", "2 m/s", "3 m/s", "4 m/s"), tuple(lines))


EXPERIMENT = Experiment(measure, cells, tables)
