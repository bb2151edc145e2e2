"""The page: one HTML file without scripts, fonts, pictures or requests of its own; dark, light and on paper."""

import math
from collections.abc import Mapping, Sequence
from html import escape
from importlib import resources
from typing import Any

import numpy as np
import numpy.typing as npt

from sim.figures.summary import SETTLE_BAND_M
from sim.replay.figures import Stop, at_time, points, stops
from sim.replay.run import Run
from sim.run_report.above import Above, from_above
from sim.run_report.charts import WIDTH, Line, Mark, histogram, over_time
from sim.run_report.events import NOT_KNOWN, cards, stops_table, text
from sim.world.pose import Floats

TALLEST_PATH_PX = 620
MAP_EVERY_M = 0.5
MOST_MAP_SCANS = 120
FARTHEST_DOT_M = 12.0
BIN_M = 0.01
BODY_M = 0.1

ROWS = (
    ("duration_s", "duration", "s"),
    ("distance_m", "distance driven", "m"),
    ("mean_speed_mps", "mean speed while under way", "m/s"),
    ("top_speed_mps", "top speed", "m/s"),
    ("mean_abs_error_m", "mean absolute error, from the first movement", "m"),
    ("rms_error_m", "RMS error, from the first movement", "m"),
    ("settle_s", f"settled within {100 * SETTLE_BAND_M:g} cm after", "s"),
    ("max_overshoot_m", "largest overshoot", "m"),
    ("min_clearance_m", "nearest thing to the outline", "m"),
    ("laps", "laps", ""),
    ("lap_times_s", "lap times", "s"),
    ("collided", "touched something", ""),
)


def page(run: Run, numbers: Mapping[str, Any], truth: Mapping[str, Any] | None = None) -> str:
    """Return the page of a run.

    numbers: of `figures.numbers`. truth: the simulator's figures of the same run, where there are any.
    """
    found = stops(run)
    body = [
        _head(run, numbers),
        _section("Figures", _figures(numbers, truth)),
        _section("Path", _path(run, found), "By odometry, with the walls as the lidar saw them. Numbers are stops."),
        _section("Distance error over time", _error(run, found), _error_words(run)),
        _section("How often which error", histogram(run.error.value, "m", BIN_M)),
        _section("Speed", _speed(run, found), "What the driver wished, what was sent, what the wheels did."),
        _section("Steering sent", over_time([Line("", run.steering.time_s, run.steering.value)], "rad")),
        _latency(run),
        _section("Who decided", _winners(numbers)),
        _section(f"Stops ({len(found)})", stops_table(found, run)),
        _section("The scan at each event", cards(run, found)),
    ]
    title = escape(f"{run.name}: run of {run.car}")
    style = resources.files("sim.run_report").joinpath("page.css").read_text(encoding="utf-8")
    return (
        '<!doctype html>\n<html lang="en"><head><meta charset="utf-8">'
        '<meta name="viewport" content="width=device-width, initial-scale=1">'
        '<meta name="color-scheme" content="light dark">'
        "<meta http-equiv=\"Content-Security-Policy\" content=\"default-src 'none'; style-src 'unsafe-inline'\">"
        f"<title>{title}</title><style>{style}</style></head><body><main>{''.join(body)}</main></body></html>\n"
    )


def _section(title: str, inside: str, words: str = "") -> str:
    about = f'<p class="about">{escape(words)}</p>' if words else ""
    return f"<section><h2>{escape(title)}</h2>{about}{inside}</section>"


def _head(run: Run, numbers: Mapping[str, Any]) -> str:
    follow = run.settings.wall_follow
    facts = [
        f"{follow.side} wall at {follow.desired_distance_m:g} m, {numbers['method']}, {follow.speed_mps:g} m/s asked",
        f"safety: {run.settings.safety.method}",
        run.began,
        f"wallride {run.version}" if run.version else "",
        run.source,
    ]
    tiles = (
        ("mean absolute error", text(numbers["mean_abs_error_m"], "m")),
        ("RMS error", text(numbers["rms_error_m"], "m")),
        ("distance", text(numbers["distance_m"], "m", 1)),
        ("stops", str(numbers["stops"])),
        ("scan to motor, p99", text(numbers["scan_to_motor_ms"].get("p99"), "ms", 1)),
    )
    boxes = "".join(f"<div><b>{escape(value)}</b><span>{escape(name)}</span></div>" for name, value in tiles)
    notes = "".join(f"<li>{escape(note)}</li>" for note in run.notes)
    return (
        f"<header><h1>{escape(run.name)} <small>{escape(run.car)}</small></h1>"
        f"<p>{escape(' · '.join(fact for fact in facts if fact))}</p>"
        f"{f'<ul>{notes}</ul>' if notes else ''}<div class=tiles>{boxes}</div></header>"
    )


def _figures(numbers: Mapping[str, Any], truth: Mapping[str, Any] | None) -> str:
    """Return the table; its cells carry the names of the summary's values for programs."""
    columns = [("by the car", numbers)] + ([("by the simulator's truth", truth)] if truth else [])
    heads = "".join(f"<th>{title}</th>" for title, _ in columns)
    rows = []
    for name, title, unit in ROWS:
        if any(name in column for _, column in columns):
            cells = "".join(_cell(name, column.get(name), unit, known=name in column) for _, column in columns)
            rows.append(f"<tr><th>{escape(title)}</th>{cells}</tr>")
    score = numbers["distance_error"]
    rows += [
        f"<tr><th>the car's own score: {title}</th>{_cell(f'distance_error.{name}', score[name], 'm', known=True)}"
        + ("<td></td>" if truth else "")
        + "</tr>"
        for name, title in (("mean_abs_m", "mean absolute error, all scans"), ("rms_m", "RMS error, all scans"))
    ]
    return f"<table><thead><tr><th></th>{heads}</tr></thead><tbody>{''.join(rows)}</tbody></table>"


def _cell(name: str, value: object, unit: str, *, known: bool) -> str:
    if not known:
        return "<td></td>"
    if isinstance(value, list):
        text = ", ".join(f"{item:g}" for item in value) or "none"
    elif isinstance(value, bool):
        text = "yes" if value else "no"
    else:
        text = NOT_KNOWN if value is None else f"{value:g}"
    if text == NOT_KNOWN and name == "settle_s":
        text, unit = "never", ""
    return f'<td data-name="{name}">{escape(text)}{f" {unit}" if unit and text not in {NOT_KNOWN, "none"} else ""}</td>'


def _path(run: Run, found: Sequence[Stop]) -> str:
    path = run.path
    dots_x_m, dots_y_m = _map(run)
    places = []
    for number, stop in enumerate(found, 1):
        x_m, y_m = (at_time(path.time_s, column, stop.from_s) for column in (path.x_m, path.y_m))
        if math.isfinite(x_m):
            places.append((x_m, y_m, str(number)))
    return from_above(Above(dots_x_m, dots_y_m, path.x_m, path.y_m, places), WIDTH, tallest=TALLEST_PATH_PX)


def _map(run: Run) -> tuple[Floats, Floats]:
    """Return the points of a scan every half metre or so, where odometry says that they are."""
    path, last, xs, ys = run.path, None, [], []
    every_m = max(MAP_EVERY_M, float(np.hypot(np.diff(path.x_m), np.diff(path.y_m)).sum()) / MOST_MAP_SCANS)
    for time_s, message in run.scans:
        x_m, y_m, yaw_rad = (at_time(path.time_s, column, time_s) for column in (path.x_m, path.y_m, path.yaw_rad))
        if not math.isfinite(x_m) or (last is not None and math.dist(last, (x_m, y_m)) < every_m):
            continue
        last = x_m, y_m
        seen_x_m, seen_y_m = points(message, run.settings.car)
        near = (np.hypot(seen_x_m, seen_y_m) < FARTHEST_DOT_M) & ~_on_itself(seen_x_m, seen_y_m, run)
        cos, sin = math.cos(yaw_rad), math.sin(yaw_rad)
        xs.append(x_m + cos * seen_x_m[near] - sin * seen_y_m[near])
        ys.append(y_m + sin * seen_x_m[near] + cos * seen_y_m[near])
    return (np.concatenate(xs), np.concatenate(ys)) if xs else (np.empty(0), np.empty(0))


def _on_itself(x_m: Floats, y_m: Floats, run: Run) -> npt.NDArray[np.bool_]:
    """Return which points are the car's own body, or as near as dirt."""
    car = run.settings.car
    ahead, aside = x_m < car.front_m + BODY_M, np.abs(y_m) < car.half_width_m + BODY_M
    return ahead & aside & (x_m > -car.rear_m - BODY_M)


def _marks(found: Sequence[Stop]) -> list[Mark]:
    return [Mark(stop.from_s, str(number)) for number, stop in enumerate(found, 1)]


def _error(run: Run, found: Sequence[Stop]) -> str:
    line = Line("", run.error.time_s, run.error.value)
    return over_time([line], "m", marks=_marks(found), band=(-SETTLE_BAND_M, SETTLE_BAND_M))


def _error_words(run: Run) -> str:
    wanted_m = run.settings.wall_follow.desired_distance_m
    return f"Distance to the wall less the wanted {wanted_m:g} m; the band is ±{100 * SETTLE_BAND_M:g} cm."


def _speed(run: Run, found: Sequence[Stop]) -> str:
    lines = [
        Line("wished", run.wish.time_s, run.wish.value, "s3"),
        Line("sent", run.sent.time_s, run.sent.value, "s2"),
        Line("driven", run.path.time_s, run.path.speed_mps, "s1"),
    ]
    return over_time(lines, "m/s", marks=_marks(found))


def _latency(run: Run) -> str:
    def series(name: str, style: str) -> Line:
        rows = [(time_s, (fields.get("scan_to_motor_ms") or {}).get(name)) for time_s, fields in run.statuses]
        table = np.array([row for row in rows if row[1] is not None], dtype=np.float64).reshape(-1, 2)
        return Line(name, table[:, 0], table[:, 1], style)

    lines = [series("p50", "s1"), series("p99", "s2")]
    if not len(lines[0].time_s):
        return ""
    return _section(
        "From a scan to the motor", over_time(lines, "ms"), "Over the newest 400 scans at each moment; p50 and p99."
    )


def _winners(numbers: Mapping[str, Any]) -> str:
    seconds = numbers["winners"]
    total_s = sum(seconds.values())
    if not total_s:
        return '<p class="nothing">not recorded</p>'
    rows = "".join(
        f"<tr><th>{escape(name)}</th><td>{spent_s:g} s</td>"
        f'<td class="wide"><i style="width:{100 * spent_s / total_s:.1f}%"></i></td></tr>'
        for name, spent_s in sorted(seconds.items(), key=lambda item: -item[1])
    )
    return f"<table><tbody>{rows}</tbody></table>"
