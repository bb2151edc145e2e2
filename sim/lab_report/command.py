"""`wallride lab report`: from the options to the page, in two rounds of runs."""

import argparse
import json
import os
import time
from collections.abc import Mapping, Sequence
from importlib.metadata import version
from pathlib import Path

from rich.console import Console

from wallride.runtime.host.output_files import write_files
from wallride.runtime.host.terminal_text import complain
from wallride.runtime.settings.tree import SettingsError
from wallride.sim.lab import laws
from wallride.sim.lab.cell import Cell, Figures
from wallride.sim.lab.command import INTERRUPTED, LabUsageError, check_folder, checked_own_parts
from wallride.sim.lab.pool import measure_all
from wallride.sim.lab.report.plan import REPORT_LAW, ReportPlan, first_round, second_round
from wallride.sim.lab.report.tables import averaged
from wallride.sim.lab_report.page import document, html_page, markdown_page
from wallride.sim.scenario.conditions import ConditionsError, RequestedConditions, named_conditions, named_once

LAWS = ("report", "law")
"""Prefixes of settings for the cars of one law."""
FIXED = {"wall_follow.method": "--method", "safety.method": "--method FOLLOWER+GUARD"}
FRICTION_MU = 0.8


def run(options: argparse.Namespace) -> int:
    """Drive everything and write the pages; 0, 1 when an own law failed, 2 for a wrong option, 130 after Ctrl-C."""
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")  # for the workers: one thread each
    console = Console(stderr=True)
    began_s = time.monotonic()
    try:
        plan = plan_of(options)
        folder = _folder(options.output)
        rows = measure(plan, options.jobs, console)
    except (LabUsageError, ConditionsError) as error:
        return complain(error)
    except KeyboardInterrupt:
        console.print("interrupted; nothing was written")
        return INTERRUPTED
    write(plan, rows, folder)
    count = sum(map(len, rows.values()))
    took_s = time.monotonic() - began_s
    print(f"{folder / 'report.html'} and report.md: {count} runs in {took_s:.0f} s")  # noqa: T201
    return laws.tell_own_law_faults([row for some in rows.values() for row in some])


def measure(plan: ReportPlan, jobs: int | None, console: Console) -> dict[str, list[Figures]]:
    """Return the figures of all runs by table; the second round drives with the average of the first one's optima."""
    rows = _round(first_round(plan), jobs, console)
    best = averaged(plan, rows)
    return rows | _round(second_round(plan, best), jobs, console)


def _round(tables: Mapping[str, Sequence[Cell]], jobs: int | None, console: Console) -> dict[str, list[Figures]]:
    figures = iter(measure_all([cell for cells in tables.values() for cell in cells], jobs, None, console))
    return {name: [next(figures) for _ in cells] for name, cells in tables.items()}


def write(plan: ReportPlan, rows: Mapping[str, list[Figures]], folder: Path) -> None:
    """Write report.html, report.md with its pictures, and figures.json; the same rows give the same bytes."""
    folder.mkdir(parents=True, exist_ok=True)
    of = version("wallride")
    write_files({
        folder / "report.html": html_page(plan, rows, of),
        folder / "report.md": markdown_page(plan, rows, of, folder / "figures"),
        folder / "figures.json": json.dumps(document(plan, rows), indent=1, allow_nan=False) + "\n",
    })  # fmt: skip


def plan_of(options: argparse.Namespace) -> ReportPlan:
    """Return the choice of the options; LabUsageError for an invalid one."""
    try:
        law = laws.check(options.method)
    except ValueError as error:
        raise LabUsageError(f"--method {options.method}: {error}") from None
    if law.endswith("+none") or law.startswith("report+"):
        raise LabUsageError(f"--method {options.method}: write a follower other than report, with its safety")
    conditions, friction, own_parts, wild = _conditions(options)
    if not 0.1 <= friction <= 2.0:
        raise LabUsageError(f"--friction {friction:g}: write a number from 0.1 to 2")
    if not 0.0 <= wild <= 0.5:
        raise LabUsageError(f"--wild {wild:g}: write a share from 0 to 0.5")
    texts = {name: tuple(_settings(options.assignments, name)) for name in LAWS}
    plan = ReportPlan(
        law, texts["report"], texts["law"], friction, own_parts, options.seed, conditions=conditions, wild=wild
    )
    for one in (REPORT_LAW, law):
        try:
            plan.settings(one)
        except SettingsError as error:
            raise LabUsageError(
                f"{one}: {error}; for one law write --set report.KEY=VALUE or --set law.KEY=VALUE"
            ) from None
    if plan.settings(REPORT_LAW).wall_follow.side != plan.settings(law).wall_follow.side:
        raise LabUsageError("--set wall_follow.side: both laws follow one side")
    return plan


def _conditions(options: argparse.Namespace) -> tuple[tuple[str, ...], float, str, float]:
    """Return the conditions of the cars, the floor's friction, the own parts and the share of wild beams."""
    conditions = named_conditions(RequestedConditions(options.conditions, options.condition))
    friction = named_once(conditions, "vehicle.grip_mu", "--friction", options.friction)
    own_parts = named_once(conditions, "lidar.own_parts", "--own-parts", options.own_parts)
    wild = named_once(conditions, "lidar.outlier_share", "--wild", options.wild)
    parts = checked_own_parts(own_parts) or "none"
    return conditions, FRICTION_MU if friction is None else friction, parts, wild or 0.0


def _settings(assignments: Sequence[str], whose: str) -> list[str]:
    """Return the texts that are for a law: those of its prefix, without it, and those without a prefix."""
    found = []
    for text in assignments:
        prefix, _, rest = text.partition(".")
        key = (rest if prefix in LAWS else text).partition("=")[0].strip()
        if key in FIXED:
            raise LabUsageError(f"--set {text}: use {FIXED[key]}")
        if prefix == whose:
            found.append(rest)
        elif prefix not in LAWS:
            found.append(text)
    return found


def _folder(path: Path) -> Path:
    check_folder(path, "the pages")
    if not os.access(path if path.exists() else path.absolute().parent, os.W_OK | os.X_OK):
        raise LabUsageError(f"-o {path}: is not writable; name another folder")
    return path
