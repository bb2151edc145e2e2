"""Tables of the page: gains beside the report's sixty errors, optima, trends, conditions varied, trials, obstacles."""

import math
from collections.abc import Iterator, Mapping, Sequence
from typing import Any

import numpy as np

from wallride.runtime.control.vehicle import GRAVITY_MPS2
from wallride.sim.lab.cell import TabledCell
from wallride.sim.lab.figures import Row, text
from wallride.sim.lab.report import published
from wallride.sim.lab.report.drives import ABOUT
from wallride.sim.lab.report.gains import GainTable, Trend, likeness, published_table, trend
from wallride.sim.lab.report.plan import ALONE_LAW, DISTANCE_KINDS, REPORT_LAW, ReportPlan, gain_laws, variations
from wallride.sim.lab.report.published import Half, Pair, repeatability_m
from wallride.sim.lab.report.wall_ahead import DISTANCES_M, was_driven
from wallride.sim.lab.safety import stopping_m
from wallride.sim.virtual.closed_loop import FULL_BRAKE_MPS2
from wallride.sim.world.pose import Floats

Rows = Mapping[str, Sequence[Row]]
"""The figures of the runs, by the name of their table."""
WIRE_S = 0.02
"""From a scan's last byte to the motor's wire in every run; the motor's delay comes on top."""
OPTIMUM = "\u00a0*"
"""Mark of the optimum of a test."""
ALIKE = "\u00a0="
"""Mark of an error that differs from the report's by no more than the report's own repeatability."""
OUTCOMES = {"contact": "X", "no room": "no room", "stands": "stands", "lost": "lost"}
VARIED = {"kd": "Kd", "kp": "Kp"}


def title_of(law: str) -> str:
    """Return the name of a law for a reader."""
    follower, _, guard = law.partition("+")
    return f"`{follower}`, {'without safety' if guard == 'none' else f'safety `{guard}`'}"


def gain_table_of(plan: ReportPlan, law: str, rows: Sequence[Row]) -> GainTable:
    """Return the table of a law's runs, by the law's own error; NaN for a run that did not come to its end."""
    pairs = plan.pairs(law)
    values = iter([row["law_error_m"] if row["outcome"] == "driven" else math.nan for row in rows])
    errors_m: dict[Half, Floats] = {}
    for half, some in pairs.items():
        errors_m[half] = np.array([[next(values) for _ in plan.tests] for _ in some], dtype=np.float64)
    return GainTable(plan.tests, pairs, errors_m)


def gains(plan: ReportPlan, law: str, rows: Sequence[Row]) -> list[TabledCell]:
    """Return both halves of a gain table, a row per value of the varied gain and a column per test."""
    table, made, first = gain_table_of(plan, law, rows), [], 0
    heads = (*(f"{test}: {ABOUT[test]}" for test in plan.tests), "mean")
    for half, pairs in table.pairs.items():
        of_half = rows[first : first + len(pairs) * len(plan.tests)]
        first += len(of_half)
        theirs = published_table(plan.tests).errors_m[half] if _beside(table, half) else None
        body = [
            _gain_row(table, half, number, of_half[number * len(plan.tests) :], theirs) for number in range(len(pairs))
        ]
        body.append(
            ("true error of the best way that a search found", *(_limit(row) for row in of_half[: len(plan.tests)]), "")
        )
        other, fixed = ("Kp", pairs[0][0]) if half == "kd" else ("Kd", pairs[0][1])
        title = f"{VARIED[half]} varied, {other} {fixed:g}: {title_of(law)}"
        made.append(TabledCell(title, (VARIED[half], *heads), tuple(body), (_gain_note(law, theirs is not None),)))
    return made


def _beside(table: GainTable, half: Half) -> bool:
    """Tell whether a half has the report's own pairs: without, its errors cannot be set beside the report's."""
    return list(table.pairs.get(half, ())) == list(published_table().pairs[half])


def _gain_row(table: GainTable, half: Half, number: int, rows: Sequence[Row], theirs: Floats | None) -> tuple[str, ...]:
    value, cells = table.varied(half)[number], []
    for column, test in enumerate(table.tests):
        shown = _ended(rows[column], "law_error_m")
        if theirs is not None:
            shown += f" ({theirs[number, column]:.3f})"
            difference_m = abs(table.errors_m[half][number, column] - theirs[number, column])
            shown += ALIKE if difference_m <= repeatability_m(test) + 1e-9 else ""
        cells.append(shown + (OPTIMUM if table.optimum(half, test) == value else ""))
    return f"{value:g}", *cells, text(float(table.errors_m[half][number].mean()))


def _gain_note(law: str, beside: bool) -> str:  # noqa: FBT001 - one word of a note
    first = (
        "Mean of the law's own |distance - wanted| in m over all samples (the true error of the last line can be"
        " larger: from the rear axle, to the wall itself); * least of its column; X contact"
    )
    if not beside and law.startswith("report+"):
        return f"{first}. The other gain is set: the report has no errors of these pairs."
    if not beside:
        return (
            f"{first}. The report's pairs, scaled so that its final pair is this law's own gains, within their range."
        )
    spread = ", ".join(f"{test} {repeatability_m(test):.3f}" for test in published.TESTS)
    return (
        f"{first}; in brackets the report's error; = differs from it by no more than its own repeatability"
        f" (the two errors of Kp 2.5, Kd 1: {spread})."
    )


def _limit(row: Row) -> str:
    return "not computed" if row["limit_m"] is None else text(row["limit_m"])


def optima(plan: ReportPlan, rows: Rows) -> TabledCell:
    """Return the optima of the report's rule with their plain mean: the report's, and those of each gain table."""
    tables = {"the report": published_table(plan.tests)}
    tables |= {title_of(law): gain_table_of(plan, law, rows[f"gains {law}"]) for law in gain_laws(plan)}
    body = tuple((name, *map(_pair, table.optima().values()), _pair(table.average())) for name, table in tables.items())
    note = "Kp, Kd: each gain with the least error of its own half; last the plain mean, the report's final gains."
    return TabledCell("Optimum of each test, and their average", ("", *plan.tests, "average"), body, (note,))


def _pair(pair: tuple[float | None, float | None]) -> str:
    return ",\u00a0".join("-" if gain is None else f"{gain:g}" for gain in pair)


def trends(plan: ReportPlan, rows: Rows) -> TabledCell:
    """Return how the error goes with a rising gain, the report's beside ours, and whether they agree."""
    theirs, body, agreed, count = published_table(plan.tests), [], 0, 0
    tables = {law: gain_table_of(plan, law, rows[f"gains {law}"]) for law in (REPORT_LAW, ALONE_LAW) if plan.pairs(law)}
    for half in theirs.pairs:
        for column, test in enumerate(plan.tests):
            found = trend(published.GAINS, theirs.errors_m[half][:, column], repeatability_m(test))
            ours = {law: _trend(table, half, column, test) for law, table in tables.items()}
            same = [one.agrees(found, 0.5) for one in ours.values() if one is not None and found is not None]
            agreed, count = agreed + sum(same), count + len(same)
            words = (one.text() if one else "-" for one in (found, *ours.values()))
            verdict = "-" if not same else "yes" if all(same) else "in part" if any(same) else "no"
            body.append((f"{test}, {VARIED[half]} rises", *words, verdict))
    note = (
        f"The error over the gain: falls, rises, or is least at a value between; flat where it moves by no more than"
        f" the report's repeatability. They agree in {agreed} of {count}: the same, or the least within one step."
    )
    heads = ("test", "the report", *map(title_of, tables), "agree")
    return TabledCell("Trends", heads, tuple(body), (note,))


def _trend(table: GainTable, half: Half, column: int, test: str) -> Trend | None:
    if not _beside(table, half):
        return None
    return trend(table.varied(half), table.errors_m[half][:, column], repeatability_m(test))


def varied(plan: ReportPlan, rows: Rows) -> TabledCell:
    """Return how the gain tables of the report's follower change with each condition that the report does not give."""
    body = [_varied("as chosen", plan, rows[f"gains {ALONE_LAW}"])]
    body += [_varied(one.words, one.of(plan), rows[name]) for name, one in variations(plan).items()]
    heads = (
        "condition",
        "average Kp, Kd",
        "optima t1 to t5",
        "median difference m",
        "median ratio",
        "alike",
        ", ".join(OUTCOMES.values()),
    )
    note = (
        f"Of {title_of(ALONE_LAW)}, one condition changed at a time; differences are to the report's errors, alike"
        " is within its repeatability."
    )
    return TabledCell("Conditions that the report does not give, varied", heads, tuple(body), (note,))


def _varied(words: str, plan: ReportPlan, rows: Sequence[Row]) -> tuple[str, ...]:
    table = gain_table_of(plan, ALONE_LAW, rows)
    ended = " ".join(str(sum(row["outcome"] == outcome for row in rows)) for outcome in OUTCOMES)
    found = "; ".join(map(_pair, table.optima().values()))
    if set(table.pairs) != set(published.FIXED):
        return words, _pair(table.average()), found, "-", "-", "-", ended
    like = likeness(table)
    figures = text(like.median_difference_m), text(like.median_ratio, 2), f"{like.within} of {like.count}"
    return words, _pair(table.average()), found, *figures, ended


def final_gains(plan: ReportPlan, rows: Rows) -> TabledCell:
    """Return both errors with the final gains: the law's own, which the report has, and the simulator's truth."""
    own: Any = plan.settings(REPORT_LAW).wall_follow
    names = {
        "report": "the report's pair"
        if (own.kp, own.kd) == published.FINAL
        else f"its law with {own.kp:g}, {own.kd:g}",
        "averaged": "the average of its law's optima here",
        "ours": f"{title_of(plan.law)}, its own gains",
    }
    body = [line for name, words in names.items() if name in rows for line in _both_errors(words, rows[name])]
    note = (
        "Mean |error| in m. The law's own, the report's kind: its distance (of the report's law in a corner half of the"
        " range ahead) less the wanted one, over all samples. True: from the rear axle to the wall, which only a"
        " simulator knows."
    )
    return TabledCell("Both errors with the final gains", ("", *plan.tests, "mean"), tuple(body), (note,))


def distances(plan: ReportPlan, rows: Rows) -> TabledCell:
    """Return the report's law with three distances to the wall, all else equal."""
    body = [line for kind in DISTANCE_KINDS for line in _both_errors(f"`{kind}`", rows[f"distance {kind}"])]
    note = (
        "`wall_follow.distance` of the report's law, its own gains: the mean of the three smallest ranges (the"
        " report's), the distance to the fitted line (the experiment it names next), and the line's intercept."
    )
    return TabledCell("Another distance to the wall", ("", *plan.tests, "mean"), tuple(body), (note,))


def _both_errors(name: str, rows: Sequence[Row]) -> Iterator[tuple[str, ...]]:
    """Yield the line of the law's own errors, and that of the true ones."""
    for key, words in (("law_error_m", "law's own error"), ("true_error_m", "true error")):
        yield f"{name}: {words}", *(_ended(row, key) for row in rows), _mean(rows, key)


def _ended(row: Row, key: str) -> str:
    return OUTCOMES.get(row["outcome"]) or text(row[key])


def _mean(rows: Sequence[Row], key: str) -> str:
    values = [math.nan if row[key] is None or row["outcome"] != "driven" else row[key] for row in rows]
    return text(math.fsum(values) / len(values))


def trials(plan: ReportPlan, law: str, rows: Sequence[Row]) -> TabledCell:
    """Return 25 trials along a wall toward one ahead: pass or fail, a row per distance, a column per speed."""
    speeds, body = plan.trial_speeds_mps, []
    for number, ahead_m in enumerate(DISTANCES_M):
        cells = rows[number * len(speeds) : (number + 1) * len(speeds)]
        body.append((f"{ahead_m:g} m", *map(_passed, cells)))
    passed = sum(row["passed"] for row in rows)
    note = (
        f"Passed {passed} of {len(rows)} ({passed / len(rows):.3f}); the report {published.TRIALS_PASSED} of"
        f" {published.TRIALS} along a wall, with start distance and speed varied on a grid that it does not give: the"
        " wall ahead, distances and speeds are ours. stands: its follower never asked for a speed."
    )
    heads = ("range ahead at the start", *(f"{speed_mps:g} m/s" for speed_mps in speeds))
    return TabledCell(f"{len(rows)} safety trials along a wall: {title_of(law)}", heads, tuple(body), (note,))


def _passed(row: Row) -> str:
    if row["passed"]:
        return "pass"
    return "stands" if row["impact_mps"] is None else f"fail, {row['impact_mps']:.1f} m/s"


def cleared(row: Row) -> bool:
    """Tell whether a car was driven at an obstacle and did not touch it; one that never drove avoided nothing."""
    return bool(row["clear"]) and was_driven(row["law"], row)


def obstacles(plan: ReportPlan, law: str, driver: str, rows: Sequence[Row]) -> TabledCell:
    """Return the obstacles of a law: 1 not touched, 0 hit, beside the report's and physics; its effectiveness."""
    speeds = plan.obstacle_speeds_mps
    body = []
    for number, ahead_m in enumerate(published.OBSTACLE_DISTANCES_M):
        cells = rows[number * len(speeds) : (number + 1) * len(speeds)]
        theirs = (0 if (ahead_m, speed_mps) in published.NOT_STOPPED else 1 for speed_mps in speeds)
        body.append((f"{ahead_m:.1f} m", *(_met(row, one) for row, one in zip(cells, theirs, strict=True))))
    clear, stoppable = sum(map(cleared, rows)), sum(row["stoppable"] for row in rows)
    share = clear / len(rows)
    notes = (
        (
            "1 not touched, 0 hit; in brackets the report's, and what physics allows a full brake on the first scan"
            f" (friction {plan.mu:g}): {stoppable} of {len(rows)}. ! stoppable, and hit; stands: it was not driven."
            " The box, its place and the driver are ours."
        ),
        (
            f"Effectiveness (share not touched) {share:.3f}, error ratio {1 - share:.3f}; of the report's"
            f" {published.STOPPED} of {published.OBSTACLES} {published.EFFECTIVENESS} and {published.ERROR_RATIO}."
        ),
    )
    who = "a driver that ignores it" if driver == "blind" else "the law's own follower"
    heads = ("appears ahead of the lidar", *(f"{speed_mps:g} m/s" for speed_mps in speeds))
    return TabledCell(f"{len(rows)} sudden obstacles: {title_of(law)}, {who}", heads, tuple(body), notes)


def _met(row: Row, theirs: int) -> str:
    mark = " !" if row["stoppable"] and not row["clear"] else ""
    met = "stands" if row["clear"] and not cleared(row) else int(row["clear"])
    return f"{met} ({theirs}, {int(row['stoppable'])}){mark}"


def stopping(plan: ReportPlan) -> TabledCell:
    """Return the stopping distance beside the report's fixed one, from the bumper and as the lidar sees it."""
    brake_mps2 = min(FULL_BRAKE_MPS2, plan.mu * GRAVITY_MPS2)
    latency_s = WIRE_S + plan.car_and_lidar()[0].drive_delay_s
    car = plan.settings(REPORT_LAW).car
    ahead_m = car.front_m - car.lidar_x_m
    body = []
    for speed_mps in published.OBSTACLE_SPEEDS_MPS:
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


def all_tables(plan: ReportPlan, rows: Rows) -> list[TabledCell]:
    """Return every table of the page, in its order."""
    made = [one for law in gain_laws(plan) for one in gains(plan, law, rows[f"gains {law}"])]
    made.append(optima(plan, rows))
    if plan.pairs(ALONE_LAW):
        made += [trends(plan, rows), varied(plan, rows)]
    made += [final_gains(plan, rows), distances(plan, rows)]
    for law in (REPORT_LAW, plan.law):
        made.append(trials(plan, law, rows[f"trials {law}"]))
        made += [obstacles(plan, law, driver, rows[f"obstacles {law} {driver}"]) for driver in ("blind", "follower")]
    return [*made, stopping(plan)]


def averaged(plan: ReportPlan, rows: Rows) -> Pair | None:
    """Return the average of the optima of the report's law with its safety; without, where there is none."""
    for law in (REPORT_LAW, ALONE_LAW):
        kp, kd = gain_table_of(plan, law, rows[f"gains {law}"]).average() if plan.pairs(law) else (None, None)
        if kp is not None and kd is not None:
            return kp, kd
    return None
