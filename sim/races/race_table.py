"""The table of races: a row for each course and law, beside the line's theory and published times."""

from collections.abc import Iterator, Sequence

import numpy as np

from wallride.runtime.map_files import DRIVE_AGAIN
from wallride.sim.lab.cell import TabledCell, course_name
from wallride.sim.lab.figures import Row, chosen, distinct, mean, text, worst
from wallride.sim.races.published import PUBLISHED

COLUMNS = (
    "course", "law", "laps", "lap s", "theory s", "error rms cm", "p99 cm", "hard stops", "contacts", "published s",
)  # fmt: skip
BOX_COLUMNS = (
    "course", "law", "drives", "box there", "met at m/s", "touched", "harder than a full brake", "worst m/s above it",
    "lap done",
)  # fmt: skip
HARDER_MPS = 0.15
"""Excess of the speed at a contact over that after a full brake from which it counts, as in `lab safety`."""
BY_LINE = "line+"
"""Begin of the name of a law that drives by the line: only its errors from the line mean anything."""


def tables(rows: Sequence[Row]) -> list[TabledCell]:
    """Return a table for each friction, the lowest first."""
    by_mu = [(mu, chosen(rows, mu=mu)) for mu in sorted(distinct(rows, "mu"))]
    return [(_box_table if rows[0]["box"] else _table)(mu, some) for mu, some in by_mu]


def _table(mu: float, rows: Sequence[Row]) -> TabledCell:
    raced = chosen(rows, reason="")
    lines = [_line(course, law, some) for course, law, some in _by_course_and_law(raced)]
    return TabledCell(
        f"mu {mu:g}: {rows[0]['laps']} laps, {_conditions(rows[0])}", COLUMNS, tuple(lines), tuple(_notes(rows, raced))
    )


def _by_course_and_law(raced: Sequence[Row]) -> Iterator[tuple[str, str, list[Row]]]:
    for course in distinct(raced, "scenario"):
        for law in distinct(chosen(raced, scenario=course), "law"):
            yield course_name(course), law, chosen(raced, scenario=course, law=law)


def _box_table(mu: float, rows: Sequence[Row]) -> TabledCell:
    raced = chosen(rows, reason="")
    lines = [(course, law, *_met(some)) for course, law, some in _by_course_and_law(raced)]
    title = f"mu {mu:g}: a {rows[0]['box']} box in the way, {_conditions(rows[0])}"
    notes = [f"all by {law}: {', '.join(_sums(chosen(raced, law=law)))}" for law in distinct(raced, "law")]
    return TabledCell(title, BOX_COLUMNS, tuple(lines), (*notes, *_map_notes(rows)))


def _met(rows: Sequence[Row]) -> tuple[str, ...]:
    """Return the texts of a row behind course and law."""
    shown = chosen(rows, box_shown=True)
    return (
        str(len(rows)), str(len(shown)), text(mean(shown, "met_at_mps"), 1),
        str(sum(row["collided"] for row in rows)),
        str(sum(row["excess_mps"] > HARDER_MPS for row in rows)),
        text(worst(rows, "excess_mps"), 2),
        str(sum(row["laps_driven"] > 0 for row in rows)),
    )  # fmt: skip


def _sums(rows: Sequence[Row]) -> Iterator[str]:
    for name, value in zip(BOX_COLUMNS[2:], _met(rows), strict=True):
        yield f"{name} {value}"


def _line(course: str, law: str, rows: Sequence[Row]) -> tuple[str, ...]:
    by_line = law.startswith(BY_LINE)
    published = PUBLISHED.get(course)
    return (
        course, law, str(sum(row["laps_driven"] for row in rows)),
        text(mean(rows, "lap_s"), 2),
        text(mean(rows, "theory_s") if by_line else None, 2),
        text(100 * _rms(rows) if by_line else None, 1),
        text(100 * worst(rows, "p99_m") if by_line else None, 0),
        str(sum(row["hard_stops"] for row in rows)),
        str(sum(row["collided"] for row in rows)),
        "" if published is None else f"{published.lap_s:g}",
    )  # fmt: skip


def _rms(rows: Sequence[Row]) -> float:
    """Return the root of the mean square over races, NaN where none has a lap that counts."""
    errors_m = [row["rms_m"] for row in rows if row["rms_m"] is not None]
    return float(np.sqrt(np.mean(np.square(errors_m)))) if errors_m else float("nan")


def _conditions(row: Row) -> str:
    """Return the conditions of a race in words; those that are as assumed are left out."""
    words = [f"at most {row['speed_mps']:g} m/s"]
    if row["assumed"] != 1.0:
        words.append(f"friction assumed {row['assumed']:g} times as high")
    if row["delay_s"]:
        words.append(f"servo {1000 * row['delay_s']:+.0f} ms")
    if row["stiffness"] != 1.0:
        words.append(f"tyres {row['stiffness']:g} times as stiff")
    return ", ".join((*words, *row["conditions"]))


def _notes(rows: Sequence[Row], raced: Sequence[Row]) -> list[str]:
    """Return what the rows do not say: sums by law, races that ended early, and where published times are from."""
    notes = [
        "lap: the best from the third on; error from the line in those; of several seeds the mean, p99 the worst",
        "every hard stop is needless: nothing stands on the courses",
    ]
    for law in distinct(raced, "law"):
        some = chosen(raced, law=law)
        laps, stops = (sum(row[name] for row in some) for name in ("laps_driven", "hard_stops"))
        touched = sum(row["collided"] for row in some)
        notes.append(f"{law}: {laps} laps, {touched} contacts, {10 * stops / max(1, laps):.2g} hard stops per 10 laps")
    for row in raced:
        if row["laps_driven"] < row["laps"]:
            end = "a contact" if row["collided"] else row["last_reason"]
            who = f"{course_name(row['scenario'])}, {row['law']}, seed {row['seed']}"
            notes.append(f"{who}: {row['laps_driven']} laps, then {end}")
    notes += _map_notes(rows)
    courses = [course_name(course) for course in distinct(raced, "scenario")]
    notes += [f"{course}: {PUBLISHED[course].conditions}" for course in courses if course in PUBLISHED]
    return notes


def _map_notes(rows: Sequence[Row]) -> list[str]:
    """Return why courses were not raced, and which maps `wallride map` would refuse."""
    reasons = {course_name(row["scenario"]): row["reason"] for row in rows if row["reason"]}
    refused = {course_name(row["scenario"]): row["map_refused"] for row in rows if row.get("map_refused")}
    return [
        *(f"{course}: not raced: {reason}" for course, reason in reasons.items()),
        *(f"{course}: raced, although {why.removesuffix(DRIVE_AGAIN)}" for course, why in refused.items()),
    ]
