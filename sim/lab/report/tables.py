"""Tables of the report from the figures of its runs: gains and their optima, trials with safety, obstacles, physics."""

import math
from collections.abc import Mapping, Sequence

from sim.car.vehicle import GRAVITY_MPS2
from sim.lab.cell import TabledCell
from sim.lab.figures import Row, chosen, text
from sim.lab.report import published
from sim.lab.report.plan import REPORT_KD, REPORT_KP, REPORT_LAW, Pair, ReportPlan, gain_tables
from sim.lab.report.trials import ABOUT
from sim.lab.safety import DISTANCES_M, stopping_m
from sim.virtual.closed_loop import FULL_BRAKE_MPS2

Rows = Mapping[str, Sequence[Row]]
"""The figures of the runs, by the name of their table."""
WIRE_S = 0.02
"""From a scan's last byte to the motor's wire in every run; the motor's delay comes on top."""
OPTIMUM = "\u00a0*"
"""Mark of the optimum of a test."""
SETTLED_FOR_S = 0.4
"""Minimum time within 5 cm at the end of a run that has settled."""
OUTCOMES = {"contact": "X", "stands": "stands", "lost": "lost"}


def title_of(law: str) -> str:
    """Return the name of a law for a reader."""
    follower, _, guard = law.partition("+")
    guard, _, lidar = guard.partition(" ")
    safety = "without safety" if guard == "none" else f"safety `{guard}`"
    return f"`{follower}`, {safety}{', lidar without noise' if lidar else ''}"


def optima(plan: ReportPlan, law: str, rows: Sequence[Row]) -> dict[str, Pair]:
    """Return the pair with the least mean error of each test that at least one pair finishes."""
    pairs, found = plan.pairs(law), {}
    for test in plan.tests:
        driven = [
            (row["mean_error_m"], pair)
            for pair, row in zip(pairs, chosen(rows, test=test), strict=True)
            if row["outcome"] == "driven"
        ]
        if driven:
            found[test] = min(driven)[1]
    return found


def averaged(found: Mapping[str, Pair]) -> Pair | None:
    """Return the average of the optima; None without any."""
    if not found:
        return None
    kps, kds = zip(*found.values(), strict=True)
    return round(math.fsum(kps) / len(kps), 3), round(math.fsum(kds) / len(kds), 3)


def gains(plan: ReportPlan, name: str, rows: Sequence[Row]) -> TabledCell:
    """Return a gain table: a row per pair, a column per test; the optimum of each is marked, the limit comes last."""
    law = gain_tables(plan)[name]
    best = optima(plan, law, rows)
    body = []
    for number, pair in enumerate(plan.pairs(law)):
        cells = [chosen(rows, test=test)[number] for test in plan.tests]
        marks = [OPTIMUM if best.get(test) == pair else "" for test in plan.tests]
        whole = [row["mean_error_m"] for row in cells if row["outcome"] == "driven"]
        mean = text(math.fsum(whole) / len(whole)) if len(whole) == len(cells) else "-"
        is_report = pair == (REPORT_KP, REPORT_KD) and law.startswith("report+")
        gains_text = f"{_pair(pair)}{' (the report)' if is_report else ''}"
        body.append((gains_text, *(shown(row) + mark for row, mark in zip(cells, marks, strict=True)), mean))
    limits = [_limit(chosen(rows, test=test)[0]) for test in plan.tests]
    body.append(("physics: least of any steering", *limits, ""))
    body.append(("optimum Kp, Kd", *(_pair(best.get(test)) for test in plan.tests), _pair(averaged(best))))
    heads = tuple(f"{test}: {ABOUT[test]}" for test in plan.tests)
    said = published.GAINS if law.startswith("report+") else "The report has no such law: it had its own only."
    notes = (
        "Mean |error| in m, settling to 5 cm in s; * optimum of the test; X contact. Last: the average of the optima.",
        said,
    )
    return TabledCell(f"Gains of {title_of(name)}", ("Kp, Kd", *heads, "mean"), tuple(body), notes)


def shown(row: Row) -> str:
    """Return error and settling time of a run, "-" for one that does not settle, or how it ended."""
    if row["outcome"] != "driven":
        return OUTCOMES[row["outcome"]]
    settle_s = row["settle_s"]
    settled = settle_s is not None and row["duration_s"] - settle_s >= SETTLED_FOR_S
    return f"{row['mean_error_m']:.3f},\u00a0{f'{settle_s:.1f}' if settled else '-'}"


def _limit(row: Row) -> str:
    if not row["limit_known"]:
        return "not computed"
    return "no way" if row["limit_m"] is None else text(row["limit_m"])


def _pair(pair: Pair | None) -> str:
    return "-" if pair is None else f"{pair[0]:g},\u00a0{pair[1]:g}"


def trials(plan: ReportPlan, rows: Rows) -> TabledCell:
    """Return the wall-following trials with safety, a row per test and speed, the laws beside each other."""
    laws = (REPORT_LAW, plan.law)
    of = {law: rows[f"trials {law}"] for law in laws}
    body = []
    for test in plan.tests:
        for speed_mps in plan.speeds_mps:
            some = [chosen(of[law], test=test, speed_mps=speed_mps)[0] for law in laws]
            body.append((test, f"{speed_mps:g}", _notes_m(test, speed_mps), _limit(some[0]), *map(_trial, some)))
    heads = ("test", "m/s", "design notes", "physics", *map(title_of, laws))
    counts = [
        f"{title_of(law)}: {sum(row['outcome'] == 'driven' for row in of[law])} of {len(of[law])} driven to the end,"
        f" {sum(row['outcome'] == 'contact' for row in of[law])} contacts,"
        f" {sum(row['safety_stops'] > 0 for row in of[law])} with a stop"
        for law in laws
    ]
    notes = (
        "Mean |error| in m, settling to 5 cm in s, stops by safety; X contact; no way: none without contact was found.",
        *counts,
        published.TRIALS,
    )
    return TabledCell("Wall-following trials with safety", heads, tuple(body), notes)


def _trial(row: Row) -> str:
    stops = row["safety_stops"]
    return shown(row) + (f", {stops} stop{'s' if stops > 1 else ''}" if stops else "")


def _notes_m(test: str, speed_mps: float) -> str:
    speeds = (1.0, 2.0, 3.0, 4.0)
    if speed_mps not in speeds:
        return ""
    found_m = published.NOTES_TABLE_M[test][speeds.index(speed_mps)]
    return "X" if found_m is None else text(found_m)


def obstacles(plan: ReportPlan, law: str, driver: str, rows: Sequence[Row]) -> TabledCell:
    """Return the obstacles of a law: a row per distance, a column per speed; stopped, or impact (physics)."""
    body = []
    for number, ahead_m in enumerate(DISTANCES_M):
        count = len(plan.speeds_mps)
        cells = rows[number * count : (number + 1) * count]
        body.append((f"{ahead_m:.1f} m", *map(_met, cells)))
    who = "a driver that ignores it" if driver == "blind" else "the law's own follower"
    heads = ("appears ahead of the lidar", *(f"{speed_mps:g} m/s" for speed_mps in plan.speeds_mps))
    counted = (
        f"{sum(row['clear'] for row in rows)} of {len(rows)} without contact; physics allows"
        f" {sum(row['stoppable'] for row in rows)} (friction {plan.mu:g}). Impact in m/s (after a full brake on the"
        " first scan); ! stoppable, and hit."
    )
    notes = (counted, published.OBSTACLES_SAID)
    return TabledCell(f"Sudden obstacles: {title_of(law)}, {who}", heads, tuple(body), notes)


def _met(row: Row) -> str:
    if row["clear"]:
        return "stopped" if row["stopped"] else "passed"
    return f"{row['impact_mps']:.2f} ({row['expected_impact_mps']:.2f}){' !' if row['stoppable'] else ''}"


def stopping(plan: ReportPlan) -> TabledCell:
    """Return the stopping distance beside the report's fixed one, from the bumper and as the lidar sees it."""
    brake_mps2 = min(FULL_BRAKE_MPS2, plan.mu * GRAVITY_MPS2)
    latency_s = WIRE_S + plan.car_and_lidar()[0].drive_delay_s
    car = plan.settings(REPORT_LAW).car
    ahead_m = car.front_m - car.lidar_x_m
    body = []
    for speed_mps in plan.speeds_mps:
        way_m = stopping_m(speed_mps, latency_s, brake_mps2)
        spare_m = published.STOP_BELOW_M - ahead_m - way_m
        judged = "too long" if spare_m > way_m else "enough" if spare_m >= 0 else "too short"
        body.append((f"{speed_mps:g} m/s", text(way_m), text(way_m + ahead_m), f"{published.STOP_BELOW_M:g}", judged))
    heads = ("speed", "stopping distance m", "from the lidar m", "the report's m", "the report's is")
    note = (
        f"d = v t + v\u00b2 / 2a with t = {1000 * latency_s:g} ms and a = {brake_mps2:.1f} m/s\u00b2. The report's"
        " distance is the tightest turning radius, which is no stopping distance."
    )
    return TabledCell("Stopping distance by physics", heads, tuple(body), (note,))


def summary(plan: ReportPlan, found: Mapping[str, Mapping[str, Pair]], rows: Rows) -> TabledCell:
    """Return the optima of all gain tables with their average, and the error with it, beside the report's pair."""
    body = []
    for name, best in found.items():
        body.append((title_of(name), *(_pair(best.get(test)) for test in plan.tests), _pair(averaged(best))))
    body.append(("the report", *("not in the references" for _ in plan.tests), f"{REPORT_KP:g}, {REPORT_KD:g}"))
    names = {
        "report": "error with the report's pair",
        "averaged": "error with the average of its law's optima",
        "ours": f"error of {title_of(plan.law)}, its own gains",
    }
    for name, what in names.items():
        if name in rows:
            errors = [row["mean_error_m"] for row in rows[name]]
            mean = text(math.fsum(errors) / len(errors)) if all(r["outcome"] == "driven" for r in rows[name]) else "-"
            body.append((what, *map(shown, rows[name]), mean))
    heads = ("", *plan.tests, "average")
    return TabledCell("Optimum of each test, and their average", heads, tuple(body), (
        "Kp, Kd; below: mean |error| in m, settling to 5 cm in s, with the report's two safety rules or `swept`.",
    ))  # fmt: skip


def all_tables(plan: ReportPlan, rows: Rows) -> list[TabledCell]:
    """Return every table of the page, in its order."""
    found = {name: optima(plan, law, rows[f"gains {name}"]) for name, law in gain_tables(plan).items()}
    made = [gains(plan, name, rows[f"gains {name}"]) for name in found]
    made.append(summary(plan, found, rows))
    made.append(trials(plan, rows))
    for law in (REPORT_LAW, plan.law):
        made += [obstacles(plan, law, driver, rows[f"obstacles {law} {driver}"]) for driver in ("blind", "follower")]
    return [*made, stopping(plan)]
