"""The page: one HTML file without network requests; dark, light and on paper; one run, or two side by side.

Without its script it is complete on paper; with it one moment is shown in all plots, beside the scan and the decision.
"""

import base64
import hashlib
import json
import math
from collections.abc import Callable, Sequence
from html import escape
from importlib import resources
from typing import Any

import numpy as np

from wallride.sim.figures.summary import SETTLE_BAND_M
from wallride.sim.run_report import moments, tables
from wallride.sim.run_report.charts import WIDTH, ChartLine, Mark, histogram, over_time
from wallride.sim.run_report.events import cards, faults_table, reasons_table, slower_table, stops_table
from wallride.sim.run_report.shown import Shown
from wallride.sim.run_report.track import track
from wallride.sim.run_report.turn import ABOUT_TURN, sharpest_turn

BIN_M = 0.01
MAX_MARKED = 30
"""Maximum number of faults that are marked in the charts; the table has more."""
ABOUT_FAULTS = "Warnings and errors of the car's log, devices that were lost, commands that did not reach the motor."
STYLES = ("s1", "s2")
STILL = """<aside class="moment" hidden aria-label="One moment"></aside>"""


def page(*runs: Shown) -> str:
    """Return the page of a run, or of two on one clock."""
    charts: dict[str, dict[str, Any]] = {}
    plots = [
        section("Figures", tables.figures(runs)),
        _each(runs, "Path", lambda one: track(one, WIDTH // len(runs)),
              f"By {' and '.join(dict.fromkeys(one.run.path.by for one in runs))}, with the walls as the lidar saw"
              " them; of several laps the one at the cursor. Numbers are stops."),
        *_over_time(runs, charts),
        *(section(one.tagged("Through the sharpest turn"), chart, ABOUT_TURN)
          for one in runs if (chart := sharpest_turn(one.run))),
        _each(runs, "How often which error", lambda one: histogram(one.run.error.value, "m", BIN_M)),
        _each(runs, "Who decided", lambda one: tables.winners(one.numbers) + reasons_table(one.run),
              "The bars are the car's own account, up to its last status; the table counts the recorded decisions."),
        *(section(one.tagged(f"Faults ({len(one.run.faults)})"), faults_table(one.run, one.tag), ABOUT_FAULTS)
          for one in runs),
        *(section(one.tagged(f"Stops ({len(one.found)})"),
                  stops_table(one.found, one.run, one.tag) + slower_table(one.run)) for one in runs),
        *(section(one.tagged("The scan at each event"), cards(one.run, one.found, one.tag)) for one in runs),
        section("Settings", tables.settings(runs), "What is not the default. The folded lists have every setting."),
    ]  # fmt: skip
    heads = "".join(tables.head(one) for one in runs)
    data = {"runs": [{**moments.moments(one.run, one.laps_s), "tag": one.tag} for one in runs], "charts": charts}
    body = (
        f'<div class="heads">{heads}</div><div class="columns">{STILL}<div class="plots">{"".join(plots)}</div></div>'
    )
    return _document(" beside ".join(f"{one.run.name}: run of {one.run.car}" for one in runs), body, data)


def still_document(title: str, body: str) -> str:
    """Return a page of the same look without a script: nothing in it moves, and nothing is fetched.

    A wide section scrolls on a phone, so each can be reached with the keyboard.
    """
    body = body.replace("<section>", '<section tabindex="0">')
    return f"{_head(title, 'none')}<body><main>{body}</main></body></html>\n"


def _document(title: str, body: str, data: object) -> str:
    script = _part("charts.js") + _part("page.js")
    digest = base64.b64encode(hashlib.sha256(script.encode()).digest()).decode("ascii")
    told = json.dumps(data, separators=(",", ":")).replace("<", "\\u003c")
    return (
        f"{_head(title, f'sha256-{digest}')}<body><main>{body}</main>"
        f'<script type="application/json" id="data">{told}</script><script>{script}</script></body></html>\n'
    )


def _head(title: str, scripts: str) -> str:
    """Return the page up to its body. scripts: the source of scripts that the browser may run."""
    return (
        '<!doctype html>\n<html lang="en"><head><meta charset="utf-8">'
        '<meta name="viewport" content="width=device-width, initial-scale=1">'
        '<meta name="color-scheme" content="light dark">'
        "<meta http-equiv=\"Content-Security-Policy\" content=\"default-src 'none'; style-src 'unsafe-inline'; "
        f"script-src '{scripts}'\">"
        f"<title>{escape(title)}</title><style>{_part('page.css')}</style></head>"
    )


def _part(name: str) -> str:
    return resources.files("wallride.sim.run_report").joinpath(name).read_text(encoding="utf-8")


def section(title: str, inside: str, words: str = "") -> str:
    """Return a section. words: below its title."""
    about = f'<p class="about">{escape(words)}</p>' if words else ""
    return f"<section><h2>{escape(title)}</h2>{about}{inside}</section>"


def _each(runs: Sequence[Shown], title: str, draw: Callable[[Shown], str], words: str = "") -> str:
    """Return a section with one drawing, or with two side by side."""
    if len(runs) == 1:
        return section(title, draw(runs[0]), words)
    both = "".join(f"<div><h3>{escape(one.label)}</h3>{draw(one)}</div>" for one in runs)
    return section(title, f'<div class="pair">{both}</div>', words)


def _over_time(runs: Sequence[Shown], charts: dict[str, dict[str, Any]]) -> list[str]:
    """Return the sections with time as their axis; the script's data of them goes into `charts`."""
    marks = [Mark(stop.from_s, f"{one.tag}{number}") for one in runs for number, stop in enumerate(one.found, 1)]
    marks += [
        Mark(time_s, f"{one.tag}F{number}")
        for one in runs
        for number, (time_s, _) in enumerate(one.run.faults[:MAX_MARKED], 1)
    ]
    parts = (
        ("error", *_error_words(runs), "m", _errors(runs)),
        ("speed", "Speed", "What the driver wished, what was sent, what the wheels did.", "m/s", _speeds(runs)),
        ("steering", "Steering sent", "Left is positive.", "°", _steering(runs)),
        ("latency", "From a scan to the motor", "Over the newest 400 scans at each moment; p50 and p99.", "ms",
         _latencies(runs)),
    )  # fmt: skip
    sections = []
    for name, title, words, unit, lines in parts:
        if name == "latency" and not any(len(line.time_s) for line in lines):
            continue
        band = (-SETTLE_BAND_M, SETTLE_BAND_M) if name == "error" else None
        charts[name] = moments.chart(lines, unit, marks, band)
        drawing = over_time(lines, unit, marks=marks if name in {"error", "speed"} else (), band=band, name=name)
        sections.append(section(title, drawing, words))
    return sections


def _errors(runs: Sequence[Shown]) -> list[ChartLine]:
    return [
        ChartLine(one.label, one.run.error.time_s, one.run.error.value, style, one.tag)
        for one, style in zip(runs, STYLES, strict=False)
    ]


def _error_words(runs: Sequence[Shown]) -> tuple[str, str]:
    """Return title and description of the chart of errors."""
    wanted = " and ".join(dict.fromkeys(tables.distances(one.run) for one in runs if not one.races))
    words = [f"Distance to the wall less the wanted {wanted}"] if wanted else []
    if any(one.races for one in runs):
        words.append("Distance from the race line, left positive, while it was driven")
    title = "Distance error over time" if wanted else "Distance from the race line over time"
    return title, f"{'; '.join(words)}; the band is ±{100 * SETTLE_BAND_M:g} cm."


def _speeds(runs: Sequence[Shown]) -> list[ChartLine]:
    if len(runs) == 1:
        run = runs[0].run
        return [
            ChartLine("wished", run.wish.time_s, run.wish.value, "s3"),
            ChartLine("sent", run.sent.time_s, run.sent.value, "s2"),
            ChartLine("driven", run.path.time_s, run.path.speed_mps, "s1"),
        ]
    lines = []
    for one, style in zip(runs, STYLES, strict=False):
        lines.append(ChartLine(one.tagged("sent"), one.run.sent.time_s, one.run.sent.value, f"{style} faint"))
        lines.append(ChartLine(one.tagged("driven"), one.run.path.time_s, one.run.path.speed_mps, style))
    return lines


def _steering(runs: Sequence[Shown]) -> list[ChartLine]:
    return [
        ChartLine(one.label, one.run.steering.time_s, np.rad2deg(one.run.steering.value), style, one.tag)
        for one, style in zip(runs, STYLES, strict=False)
    ]


def _latencies(runs: Sequence[Shown]) -> list[ChartLine]:
    names = ("p50", "p99") if len(runs) == 1 else ("p99",)
    lines = []
    for number, one in enumerate(runs):
        for also, name in enumerate(names):
            rows = [
                (time_s, (fields.get("scan_to_motor_ms") or {}).get(name, math.nan))
                for time_s, fields in one.run.statuses
            ]
            table = np.array([row for row in rows if row[1] is not None], dtype=np.float64).reshape(-1, 2)
            table = table[np.isfinite(table[:, 1])]
            lines.append(ChartLine(one.tagged(name), table[:, 0], table[:, 1], STYLES[number + also]))
    return lines
