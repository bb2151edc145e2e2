"""The report as one HTML page without network requests, and as Markdown with pictures beside it."""

import re
from collections.abc import Sequence
from html import escape
from pathlib import Path

from sim.lab.cell import TabledCell
from sim.lab.figures import Row
from sim.lab.report.differences import differences
from sim.lab.report.plan import REPORT_KD, REPORT_KP, ReportPlan
from sim.lab.report.tables import OPTIMUM, Rows, all_tables
from sim.lab.report.trials import ABOUT, SLANT_RAD
from sim.lab_report.figures import error_chart, path_view, save_figure
from sim.run_report.page import section, still_document

TITLE = "The lab report's section 3, driven again"
CODE = re.compile(r"`([^`]*)`")


def html_page(plan: ReportPlan, rows: Rows, version: str) -> str:
    """Return the page."""
    parts = [f"<header><h1>{escape(TITLE)}</h1><p>{_rich(conditions(plan, version))}</p></header>"]
    parts.append(section("What differs from the report", _list(differences(plan, rows))))
    parts += [html_table(table) for table in all_tables(plan, rows)]
    parts += [_figure_section(*pair) for pair in zip(rows["report"], rows["ours"], strict=True)]
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


def conditions(plan: ReportPlan, version: str) -> str:
    """Return the conditions of all runs in one paragraph."""
    follow = plan.settings(plan.law).wall_follow
    car, _ = plan.car_and_lidar()
    fitted = f" Simulated car: {', '.join(f'`{one}`' for one in plan.conditions)}." if plan.conditions else ""
    fitted += " Physics is that of the simulator's own car." if plan.conditions else ""
    more = [f"`{text}`" for text in dict.fromkeys((*plan.report_settings, *plan.law_settings))]
    return (
        f"{follow.side.capitalize()} wall at {follow.desired_distance_m:g} m, {follow.speed_mps:g} m/s unless a table"
        f" says otherwise, friction {plan.mu:g}, {plan.noise_words()}, 20 ms to the wire, then"
        f" {1000 * car.steering_delay_s:g} ms of the servo and {1000 * car.drive_delay_s:g} ms of the motor, own"
        f" parts: {plan.own_parts}, seed {plan.seed}, starts turned by {57.29578 * SLANT_RAD:.0f} degrees."
        f" The report's law with Kp {REPORT_KP:g}, Kd {REPORT_KD:g} beside `{plan.law.partition('+')[0]}`."
        f" Settings: {', '.join(more) if more else 'the defaults'}.{fitted} wallride {version}."
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
    views = "".join(f"<div><h3>{escape(str(row['law']))}</h3>{path_view(row, 2)}</div>" for row in (report, ours))
    return section(_title(report), error_chart([report, ours]) + f'<div class="pair">{views}</div>',
                   "Distance to the wall less the wanted one; below: the paths from above.")  # fmt: skip


def _title(row: Row) -> str:
    test = str(row["scenario"]).partition(" ")[0]
    return f"{test}: {ABOUT[test]}"


def _list(texts: Sequence[str]) -> str:
    return "<ul>" + "".join(f"<li>{_rich(one)}</li>" for one in texts) + "</ul>"


def _rich(text: str) -> str:
    return CODE.sub(r"<code>\1</code>", escape(text))
