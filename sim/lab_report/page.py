"""The report as one HTML page without network requests, as Markdown with pictures beside it, and as plain values."""

import re
from collections.abc import Sequence
from html import escape
from pathlib import Path

from wallride.sim.lab.cell import TabledCell
from wallride.sim.lab.figures import Row
from wallride.sim.lab.report import published
from wallride.sim.lab.report.differences import differences
from wallride.sim.lab.report.drives import ABOUT
from wallride.sim.lab.report.gains import GainTable
from wallride.sim.lab.report.plan import ReportPlan, gain_laws
from wallride.sim.lab.report.tables import OPTIMUM, Rows, all_tables, cleared, gain_table_of, title_of
from wallride.sim.lab_report.figures import error_chart, follower_of, path_view, save_figure, turn_chart_of
from wallride.sim.run_report.page import section, still_document
from wallride.sim.run_report.turn import ABOUT_TURN

TITLE = "The lab report's evaluation, driven again"
CODE = re.compile(r"`([^`]*)`")
PLOTTED, FIGURE_4 = "t3", ", as in the report's figure 4"
"""Test whose error over time is a figure of the report, and the words for it."""


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
