"""The report as one HTML page without network requests, as Markdown with pictures beside it, and as plain values."""

import re
from collections.abc import Sequence
from dataclasses import replace
from html import escape
from pathlib import Path

import numpy as np

from wallride.sim.figures.drawing import save_plot
from wallride.sim.figures.summary import SETTLE_BAND_M
from wallride.sim.lab.cell import TabledCell
from wallride.sim.lab.courses.walls import world_of
from wallride.sim.lab.figures import Row
from wallride.sim.lab.report import published
from wallride.sim.lab.report.differences import differences
from wallride.sim.lab.report.drives import ABOUT, read_scenario
from wallride.sim.lab.report.gains import GainTable
from wallride.sim.lab.report.plan import ReportPlan, gain_laws
from wallride.sim.lab.report.tables import OPTIMUM, Rows, all_tables, cleared, gain_table_of, title_of
from wallride.sim.run_report.above import Above, from_above
from wallride.sim.run_report.charts import WIDTH, ChartLine, over_time
from wallride.sim.run_report.page import section, still_document
from wallride.sim.run_report.turn import ABOUT_TURN, turn_chart
from wallride.sim.world.place import World
from wallride.sim.world.pose import Floats, Pose

TITLE = "The lab report's evaluation, driven again"
CODE = re.compile(r"`([^`]*)`")
PLOTTED, FIGURE_4 = "t3", ", as in the report's figure 4"
"""Test whose error over time is a figure of the report, and the words for it."""
DOT_EVERY_M = 0.04
AROUND_M = 4.0
"""Maximum distance of a drawn wall from the paths."""
TALLEST_PX = 420


def html_page(plan: ReportPlan, rows: Rows, version: str) -> str:
    """Return the page."""
    parts = [f"<header><h1>{escape(TITLE)}</h1><p>{_rich(conditions(plan, version))}</p></header>"]
    parts.append(section("What differs from the report", _list(differences(plan, rows))))
    parts += [html_table(table) for table in all_tables(plan, rows)]
    parts += [_figure_section(*pair) for pair in zip(rows["report"], rows["ours"], strict=True)]
    parts += [_turn_section(row) for name in ("report", "ours") for row in rows[name] if row["test"] == "t5"]
    return still_document(TITLE, "".join(parts))


def markdown_page(plan: ReportPlan, rows: Rows, version: str, folder: Path) -> str:
    """Return the same in Markdown; its pictures are written into the folder, which is named relatively."""
    folder.mkdir(parents=True, exist_ok=True)
    parts = [f"# {TITLE}", conditions(plan, version), "## What differs from the report"]
    parts.append("\n".join(f"* {one}" for one in differences(plan, rows)))
    parts += [markdown_table(table) for table in all_tables(plan, rows)]
    for pair in zip(rows["report"], rows["ours"], strict=True):
        names = [save_figure(folder, row) for row in pair]
        parts.append(f"## {_title(pair[0])}")
        parts += [f"![{name.removesuffix('.png')}: path and error]({folder.name}/{name})" for name in names]
    return "\n\n".join(parts) + "\n"


def document(plan: ReportPlan, rows: Rows) -> dict[str, object]:
    """Return all numbers as plain values: the report's own, ours by its rules, and every run."""
    tables = {law: gain_table_of(plan, law, rows[f"gains {law}"]) for law in gain_laws(plan)}
    blind = {name: some for name, some in rows.items() if name.startswith("obstacles")}
    return {
        "published": published.as_document(),
        "gain_tables": {law: _gains(table) for law, table in tables.items()},
        "trials_passed": {
            name.removeprefix("trials "): [sum(row["passed"] for row in some), len(some)]
            for name, some in rows.items()
            if name.startswith("trials")
        },
        "obstacles": {
            name.removeprefix("obstacles "): {
                "stopped": [int(cleared(row)) for row in some],
                "effectiveness": round(sum(map(cleared, some)) / len(some), 3),
                "error_ratio": round(1 - sum(map(cleared, some)) / len(some), 3),
            }
            for name, some in blind.items()
        },
        "runs": rows,
    }


def _gains(table: GainTable) -> dict[str, object]:
    """Return a gain table as plain values; null for a run that did not come to its end."""
    errors = {
        half: [[None if error != error else round(float(error), 4) for error in line] for line in some]
        for half, some in table.errors_m.items()
    }
    return {
        "pairs": {half: [list(pair) for pair in some] for half, some in table.pairs.items()},
        "law_errors_m": errors,
        "optima": {test: list(pair) for test, pair in table.optima().items()},
        "average": list(table.average()),
    }


def conditions(plan: ReportPlan, version: str) -> str:
    """Return the conditions of all runs in one paragraph, the chosen ones named as chosen."""
    follow = plan.settings(plan.law).wall_follow
    car, _ = plan.car_and_lidar()
    fitted = f" Simulated car: {', '.join(f'`{one}`' for one in plan.conditions)}." if plan.conditions else ""
    fitted += " Physics is that of the simulator's own car." if plan.conditions else ""
    more = [f"`{text}`" for text in plan.report_settings if text in plan.law_settings]
    more += [f"`report.{text}`" for text in plan.report_settings if text not in plan.law_settings]
    more += [f"`law.{text}`" for text in plan.law_settings if text not in plan.report_settings]
    starts = plan.starts
    return (
        f"{follow.side.capitalize()} wall at {follow.desired_distance_m:g} m. The report does not give speed, starts,"
        f" the kind of its corner and the length of its runs. Chosen here: {follow.speed_mps:g} m/s from the start on,"
        f" starts at {starts.near:g} and {starts.far:g} times the distance, turned by {starts.slant_deg:g} degrees, an"
        f" inside corner, runs of {starts.way_m:g} m. Also ours: friction {plan.mu:g}, {plan.noise_words()},"
        f" 20 ms to the wire, then {1000 * car.steering_delay_s:g} ms of the servo and"
        f" {1000 * car.drive_delay_s:g} ms of the motor, own parts: {plan.own_parts}, seed {plan.seed}. The"
        f" report's law beside `{plan.law.partition('+')[0]}`. Settings: {', '.join(more) if more else 'the defaults'}."
        f"{fitted} wallride {version}."
    )


def html_table(table: TabledCell) -> str:
    """Return a table as a section of the page."""
    heads = "".join(f"<th>{_rich(name)}</th>" for name in table.columns)
    rows = "".join(
        "<tr>" + f"<th>{_rich(first)}</th>" + "".join(_html_cell(text) for text in rest) + "</tr>"
        for first, *rest in table.rows
    )
    notes = "".join(f'<p class="about">{_rich(note)}</p>' for note in table.notes)
    inside = f"<table><thead><tr>{heads}</tr></thead><tbody>{rows}</tbody></table>"
    return f"<section><h2>{_rich(table.title)}</h2>{notes}{inside}</section>"


def markdown_table(table: TabledCell) -> str:
    """Return a table in Markdown."""
    lines = [f"## {table.title}", "", *(f"{note}\n" for note in table.notes)]
    lines.append("| " + " | ".join(table.columns) + " |")
    lines.append("| --- " * len(table.columns) + "|")
    lines += ["| " + " | ".join(text.replace(OPTIMUM, f"{OPTIMUM[0]}\\*") for text in row) + " |" for row in table.rows]
    return "\n".join(lines)


def _html_cell(text: str) -> str:
    return f"<td><b>{_rich(text)}</b></td>" if text.endswith(OPTIMUM) else f"<td>{_rich(text)}</td>"


def _figure_section(report: Row, ours: Row) -> str:
    views = "".join(
        f"<div><h3>{_rich(title_of(str(row['law'])))}</h3>{path_view(row, 2)}</div>" for row in (report, ours)
    )
    words = (
        "Distance to the wall less the wanted one, by the law itself and (faint) in truth; below: the paths from above."
    )
    return section(_title(report), error_chart([report, ours]) + f'<div class="pair">{views}</div>', words)


def _turn_section(row: Row) -> str:
    return section(f"Through the corner: {follower_of(row)}", turn_chart_of(row), ABOUT_TURN)


def _title(row: Row) -> str:
    test = str(row["test"])
    return f"{test}: {ABOUT[test]}{FIGURE_4 if test == PLOTTED else ''}"


def _list(texts: Sequence[str]) -> str:
    return "<ul>" + "".join(f"<li>{_rich(one)}</li>" for one in texts) + "</ul>"


def _rich(text: str) -> str:
    return CODE.sub(r"<code>\1</code>", escape(text))


def trace(row: Row, name: str) -> Floats:
    """Return a column of a run's way; NaN where there is no value."""
    return np.array([np.nan if value is None else value for value in row["trace"][name]], dtype=np.float64)


def world_in(row: Row) -> World:
    """Return the world of a run, with the run's own start."""
    x_m, y_m, yaw_rad = (float(trace(row, name)[0]) for name in ("x_m", "y_m", "yaw_rad"))
    test, starts = read_scenario(row["scenario"].rpartition(" ")[0])
    return replace(world_of(starts.course(test).world, row["side"]), start=Pose(x_m, y_m, yaw_rad))


def follower_of(row: Row) -> str:
    """Return the name of a run's follower."""
    return str(row["law"]).partition("+")[0]


def error_chart(runs: Sequence[Row]) -> str:
    """Return the errors over time of one test, as SVG text; the first law is the report's."""
    lines = [
        ChartLine(f"{follower_of(row)}, {words}", trace(row, "time_s"), trace(row, name), style + faint)
        for row, style in zip(runs, ("s2", "s1"), strict=True)
        for name, words, faint in (("law_error_m", "its own", ""), ("true_error_m", "true", " faint"))
    ]
    return over_time(lines, "m", band=(-SETTLE_BAND_M, SETTLE_BAND_M))


def turn_chart_of(row: Row) -> str:
    """Return range ahead, nearest, distance to the line and turn radius of a run, as SVG text."""
    names = ("time_s", "ahead_m", "nearest_m", "line_m", "turn_radius_m")
    return turn_chart(*(trace(row, name) for name in names))


def path_view(row: Row, columns: int) -> str:
    """Return the path from above among the walls, as SVG text."""
    x_m, y_m = trace(row, "x_m"), trace(row, "y_m")
    dots = wall_dots(world_in(row))
    near = (np.abs(dots[:, 0] - np.clip(dots[:, 0], x_m.min(), x_m.max())) < AROUND_M) & (
        np.abs(dots[:, 1] - np.clip(dots[:, 1], y_m.min(), y_m.max())) < AROUND_M
    )
    dots = dots[near]
    return from_above(Above(dots[:, 0], dots[:, 1], x_m, y_m), WIDTH // columns, tallest=TALLEST_PX)


def wall_dots(world: World) -> Floats:
    """Return points (n, 2) on the walls of a world."""
    pieces = []
    for x0, y0, x1, y1 in world.outline_m.reshape(-1, 4):
        count = max(2, int(np.hypot(x1 - x0, y1 - y0) / DOT_EVERY_M))
        pieces.append(np.stack([np.linspace(x0, x1, count), np.linspace(y0, y1, count)], axis=1))
    return np.concatenate(pieces)


def save_figure(folder: Path, row: Row) -> str:
    """Write path and the law's own error of a run as a picture and return the file's name."""
    law = follower_of(row).replace(":", "-")
    test = str(row["test"])
    name = f"{test}-{law}.png"
    time_s, error_m = trace(row, "time_s"), trace(row, "law_error_m")
    track = np.stack([trace(row, "x_m"), trace(row, "y_m"), trace(row, "yaw_rad")], axis=1)
    title = f"{test}, {ABOUT[test]}: {law}, {row['speed_mps']:g} m/s, friction {row['mu']:g}"
    save_plot(folder / name, world_in(row), track, time_s, error_m, title)
    return name
