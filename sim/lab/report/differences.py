"""What differs from the lab report's numbers, each with the condition that moves it where one was varied."""

import math
from collections.abc import Iterator

from wallride.sim.lab import laws
from wallride.sim.lab.figures import chosen
from wallride.sim.lab.report import published
from wallride.sim.lab.report.gains import likeness
from wallride.sim.lab.report.plan import ALONE_LAW, REPORT_LAW, ReportPlan, gain_laws, variations
from wallride.sim.lab.report.tables import Rows, cleared, gain_table_of, title_of


def differences(plan: ReportPlan, rows: Rows) -> list[str]:
    """Return one sentence or two per difference."""
    faults = laws.own_law_faults([row for some in rows.values() for row in some])
    failed = [f"`{plan.law.partition('+')[0]}` failed, and the car stood: {fault}." for fault in faults]
    return [*failed, *_averages(plan, rows), *_errors(plan, rows), *_ends(plan, rows), *_safety(plan, rows)]


def _averages(plan: ReportPlan, rows: Rows) -> Iterator[str]:
    kp, kd = published.FINAL
    tables = {law: gain_table_of(plan, law, rows[f"gains {law}"]) for law in gain_laws(plan) if law != plan.law}
    found = "; ".join(f"{_text(table.average())} ({title_of(law)})" for law, table in tables.items())
    moved = {"as chosen": tables[ALONE_LAW].average()} if ALONE_LAW in tables else {}
    for name, one in variations(plan).items():
        moved[one.words] = gain_table_of(one.of(plan), ALONE_LAW, rows[name]).average()
    whole = {
        words: (math.dist(pair, (kp, kd)), pair)
        for words, (a, b) in moved.items()
        if a is not None and b is not None
        for pair in [(a, b)]
    }
    if not found or not whole:
        return
    near, far = min(whole, key=lambda words: whole[words][0]), max(whole, key=lambda words: whole[words][0])
    yield (
        f"By the report's rule the average optimum here is Kp, Kd {found}; the report's is {kp:g}, {kd:g}. Of the"
        f" conditions varied, `{near}` comes nearest to it ({_text(whole[near][1])}) and `{far}` goes farthest from it"
        f" ({_text(whole[far][1])}); the others are in the table of conditions."
    )


def _text(pair: tuple[float | None, float | None]) -> str:
    return ", ".join("-" if gain is None else f"{gain:g}" for gain in pair)


def _errors(plan: ReportPlan, rows: Rows) -> Iterator[str]:
    ratios = {}
    for name, one in [("as chosen", None), *variations(plan).items()]:
        of = plan if one is None else one.of(plan)
        if set(of.pairs(ALONE_LAW)) != set(published.FIXED):
            return
        table = gain_table_of(of, ALONE_LAW, rows[f"gains {ALONE_LAW}" if one is None else name])
        ratios[one.words if one else name] = likeness(table)
    mine, driven = ratios["as chosen"], {words: one for words, one in ratios.items() if one.compared}
    if not mine.compared:
        return
    largest = max(driven, key=lambda words: driven[words].median_ratio)
    yield (
        f"The errors here are {mine.median_ratio:.2f} times the report's in the median of {mine.compared} runs, and"
        f" {mine.within} differ by no more than the report's own repeatability. What raises them most of what was"
        f" varied is `{largest}` ({ratios[largest].median_ratio:.2f} times). The report does not say how long a run is,"
        " nor whether errors of both signs cancel in its mean; here they do not."
    )


def _ends(plan: ReportPlan, rows: Rows) -> Iterator[str]:
    for law in (REPORT_LAW, ALONE_LAW):
        for test in plan.tests:
            of_test = chosen(rows.get(f"gains {law}", ()), test=test)
            some = [row for row in of_test if row["outcome"] != "driven"]
            if some:
                ended = ", ".join(f"{sum(row['outcome'] == one for row in some)} {one}"
                                  for one in sorted({row["outcome"] for row in some}))  # fmt: skip
                why = sorted({row["last_reason"] for row in some})
                yield f"{test} with {title_of(law)}: {ended} of {len(of_test)}; last: {', '.join(why)}."


def _safety(plan: ReportPlan, rows: Rows) -> Iterator[str]:
    passed = rows[f"trials {REPORT_LAW}"]
    failed = [f"{row['scenario']} at {row['speed_mps']:g} m/s" for row in passed if not row["passed"]]
    if failed:
        yield (
            f"The report passed {published.TRIALS_PASSED} of {published.TRIALS} trials; its law here"
            f" {len(passed) - len(failed)}: not {', '.join(failed)}. Its stop is at one distance ahead,"
            " whatever the speed, and sees nothing beside the car. The report does not give its grid."
        )
    blind = rows[f"obstacles {REPORT_LAW} blind"]
    clear, stoppable = sum(map(cleared, blind)), sum(row["stoppable"] for row in blind)
    yield (
        f"The report stopped for {published.STOPPED} of {published.OBSTACLES} obstacles; its law here for {clear},"
        f" and no brake could for more than {stoppable} at friction {plan.mu:g}. At a true 3 m/s stopping takes more"
        " than 0.4 m on any tyre: the report's speeds are commands, and were not measured."
    )
