"""Head of the page and its tables: figures, settings, shares of the sources."""

from collections.abc import Mapping, Sequence
from html import escape
from typing import Any

from wallride.runtime.control.line_following.lap_memory import SECTORS
from wallride.runtime.settings.tree import Settings, to_toml
from wallride.sim.figures.summary import SETTLE_BAND_M, SETTLED_FOR_S, digits
from wallride.sim.replay.run import RecordedRun
from wallride.sim.run_report.events import NOT_KNOWN, text
from wallride.sim.run_report.shown import Shown
from wallride.sim.scenario.toml_lines import flat

ROWS = (
    ("duration_s", "duration", "s"),
    ("distance_m", "distance driven", "m"),
    ("mean_speed_mps", "mean speed while under way", "m/s"),
    ("top_speed_mps", "top speed", "m/s"),
    ("mean_abs_error_m", "mean absolute error while under way", "m"),
    ("rms_error_m", "RMS error while under way", "m"),
    ("settle_s", f"settled within {100 * SETTLE_BAND_M:g} cm after", "s"),
    ("max_overshoot_m", "largest overshoot", "m"),
    ("min_clearance_m", "nearest thing to the outline", "m"),
    ("laps", "laps", ""),
    ("lap_times_s", "lap times", "s"),
    *((f"sector_{number}_s", f"sector {number} of each lap", "s") for number in range(1, SECTORS + 1)),
    ("line_rms_m", "last lap off the line, RMS", "m"),
    ("line_largest_m", "last lap off the line, at most", "m"),
    ("trajectory_rms_m", "found poses off the truth, RMS", "m"),
    ("trajectory_largest_m", "found poses off the truth, at most", "m"),
    ("collided", "touched something", ""),
)
NOT_OF_THE_DRIVE = ("recording.", "telemetry.", "log.", "process.")
"""Prefixes of settings of the output; they are among all settings, not in the table."""


def head(shown: Shown) -> str:
    """Return name, facts and the largest figures of a run."""
    run, numbers = shown.run, shown.numbers
    follow = run.settings.wall_follow
    by_wall = f"{follow.side} wall at {distances(run)}, {numbers['method']}, {follow.speed_mps:g} m/s asked"
    facts = [
        f"race line, at most {follow.speed_mps:g} m/s" if shown.races else by_wall,
        f"safety: {run.settings.safety.method}",
        f"world: {shown.world}" if shown.world else "",
        _laps((shown.truth or {}).get("lap_times_s") or numbers.get("lap_times_s") or ()),
        run.began,
        f"wallride {run.version}" if run.version else "",
        run.source,
    ]
    error = numbers["distance_error"]
    errors = (
        [("mean distance from the line", text(error["mean_abs_m"], "m")), ("laps", str(numbers["laps"]))]
        if shown.races
        else [
            ("mean absolute error", text(numbers["mean_abs_error_m"], "m")),
            ("RMS error", text(numbers["rms_error_m"], "m")),
        ]
    )
    tiles = (
        *errors,
        ("distance", text(numbers["distance_m"], "m", 1)),
        ("stops to a standstill", str(numbers["stops"])),
        ("scan to motor, p99", text(numbers["scan_to_motor_ms"].get("p99"), "ms", 1)),
    )
    boxes = "".join(f"<div><b>{escape(value)}</b><span>{escape(name)}</span></div>" for name, value in tiles)
    notes = "".join(f"<li>{escape(note)}</li>" for note in run.notes)
    tag = f"{escape(shown.tag)}: " if shown.tag else ""
    return (
        f"<header><h1>{tag}{escape(run.name)} <small>{escape(run.car)}</small></h1>"
        f"<p>{escape(' · '.join(fact for fact in facts if fact))}</p>"
        f"{f'<ul>{notes}</ul>' if notes else ''}<div class=tiles>{boxes}</div></header>"
    )


def distances(run: RecordedRun) -> str:
    """Return the wanted distance to the wall, and every later one with its time."""
    later = [f"from {time_s:.1f} s {one.new:g} m" for time_s, one in run.tuned
             if one.name == "wall_follow.desired_distance_m" and isinstance(one.new, int | float)]  # fmt: skip
    return ", ".join([f"{run.settings.wall_follow.desired_distance_m:g} m", *later])


def tuned(runs: Sequence[Shown]) -> str:
    """Return the settings that were changed during a run, "" where none was."""
    rows = "".join(
        f'<tr><td data-at="{time_s:.3f}">{shown.tagged(f"{time_s:.2f} s")}</td><td>{escape(one.name)}</td>'
        f"<td>{escape(_value(one.old))}</td><td>{escape(_value(one.new))}</td></tr>"
        for shown in runs
        for time_s, one in shown.run.tuned
    )
    heads = "".join(f"<th>{name}</th>" for name in ("at", "changed while it drove", "from", "to"))
    return f"<table class=settings><thead><tr>{heads}</tr></thead><tbody>{rows}</tbody></table>" if rows else ""


def _laps(times_s: Sequence[float]) -> str:
    if not times_s:
        return ""
    return f"{len(times_s)} lap{'s' if len(times_s) > 1 else ''}, best {min(times_s):.1f} s"


def figures(runs: Sequence[Shown]) -> str:
    """Return the table; its cells carry the names of the summary's values for programs."""
    columns: list[tuple[str, Mapping[str, Any]]] = []
    for shown in runs:
        columns.append((shown.tagged("by the car"), shown.numbers))
        if shown.truth:
            columns.append((shown.tagged("by the simulator's truth"), shown.truth))
    heads = "".join(f"<th>{escape(title)}</th>" for title, _ in columns)
    rows = []
    for name, title, unit in ROWS:
        if any(name in column for _, column in columns):
            cells = "".join(_cell(name, column.get(name), unit, known=name in column) for _, column in columns)
            rows.append(f"<tr><th>{escape(title)}</th>{cells}</tr>")
    kinds = {shown.races for shown in runs}
    what = "error" if kinds == {False} else "distance from the line" if kinds == {True} else "error (line: from it)"
    for name, title in (("mean_abs_m", f"mean absolute {what}"), ("rms_m", f"RMS {what}")):
        cells = "".join(
            _cell(f"distance_error.{name}", column.get("distance_error", {}).get(name), "m", known=column is own)
            for own, column in _with_own(runs)
        )
        rows.append(f"<tr><th>the car's own score while under way: {title}</th>{cells}</tr>")
    return f"<table><thead><tr><td></td>{heads}</tr></thead><tbody>{''.join(rows)}</tbody></table>"


def _with_own(runs: Sequence[Shown]) -> list[tuple[Mapping[str, Any], Mapping[str, Any]]]:
    """Return (the car's figures, the column's figures) of every column."""
    return [(shown.numbers, column) for shown in runs for column in (shown.numbers, shown.truth) if column]


def _cell(name: str, value: object, unit: str, *, known: bool) -> str:
    if not known:
        return "<td></td>"
    if isinstance(value, list):
        shown = ", ".join(digits(item) for item in value) or "none"
    elif isinstance(value, bool):
        shown = "yes" if value else "no"
    else:
        shown = digits(value) if isinstance(value, int | float) else NOT_KNOWN
    if shown == NOT_KNOWN and name == "settle_s":
        shown, unit = f"never for {SETTLED_FOR_S:g} s", ""
    known_unit = unit if shown not in {NOT_KNOWN, "none"} else ""
    return f'<td data-name="{name}">{escape(shown)}{f" {known_unit}" if known_unit else ""}</td>'


def settings(runs: Sequence[Shown]) -> str:
    """Return the settings that differ from the defaults, and between two runs; and all of them, folded."""
    default = flat(Settings().model_dump(mode="json"))
    values = [flat(shown.run.settings.model_dump(mode="json")) for shown in runs]
    names = [name for name in dict.fromkeys(key for one in values for key in one) if _is_told(name, values, default)]
    heads = "".join(f"<th>{escape(shown.label or 'value')}</th>" for shown in runs)
    rows = "".join(
        f"<tr{_mark([one.get(name) for one in values])}><th>{escape(name)}</th>"
        + "".join(f"<td>{escape(_value(one.get(name)))}</td>" for one in values)
        + f"<td>{escape(_value(default.get(name)))}</td></tr>"
        for name in names
    )
    table = (
        f"<table class=settings><thead><tr><td></td>{heads}<th>default</th></tr></thead><tbody>{rows}</tbody></table>"
        if rows else "<p>All settings are the defaults.</p>"
    )  # fmt: skip
    folded = "".join(
        f"<details><summary>All settings{f' of {escape(shown.label)}' if shown.label else ''}</summary>"
        f"<pre tabindex=0>{escape(to_toml(shown.run.settings))}</pre></details>"
        for shown in runs
    )
    return table + tuned(runs) + folded


def _mark(values: Sequence[object]) -> str:
    return ' class="differs"' if any(value != values[0] for value in values) else ""


def _is_told(name: str, values: Sequence[Mapping[str, object]], default: Mapping[str, object]) -> bool:
    if name.startswith(NOT_OF_THE_DRIVE):
        return False
    return any(one.get(name) != default.get(name) for one in values)


def _value(value: object) -> str:
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, list):
        return ", ".join(map(str, value))
    return NOT_KNOWN if value is None else f"{value:g}" if isinstance(value, float) else str(value)


def winners(numbers: Mapping[str, Any]) -> str:
    """Return the share of time of each deciding source, as bars."""
    seconds = numbers["winners"]
    total_s = sum(seconds.values())
    if not total_s:
        return '<p class="nothing">not recorded</p>'
    rows = "".join(
        f"<tr><th>{escape(name)}</th><td>{digits(spent_s)} s</td>"
        f'<td class="wide"><i style="width:{100 * spent_s / total_s:.1f}%"></i></td></tr>'
        for name, spent_s in sorted(seconds.items(), key=lambda item: -item[1])
    )
    return f"<table><tbody>{rows}</tbody></table>"
