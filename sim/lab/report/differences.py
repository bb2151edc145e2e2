"""What differs from the numbers of the lab report, each with its cause where one is known."""

from collections.abc import Iterator, Mapping, Sequence

from sim.lab.figures import Row, chosen
from sim.lab.report import published
from sim.lab.report.plan import (
    ALONE_LAW,
    CLEAN_TABLE,
    REPORT_KD,
    REPORT_KP,
    REPORT_LAW,
    Pair,
    ReportPlan,
    gain_tables,
)
from sim.lab.report.tables import Rows, averaged, optima, title_of
from sim.lab.report.trials import ABOUT

BIAS_M = 0.02
"""Minimum steady error that is named."""


def differences(plan: ReportPlan, rows: Rows) -> list[str]:
    """Return one sentence or two per difference."""
    return [
        *_pairs(plan, rows),
        *_noise(plan, rows),
        *_tests_without_a_way(plan, rows),
        *_errors(plan, rows),
        *_obstacles(plan, rows),
    ]


def _pairs(plan: ReportPlan, rows: Rows) -> Iterator[str]:
    found: Mapping[str, Pair | None] = {
        name: averaged(optima(plan, law, rows[f"gains {name}"]))
        for name, law in gain_tables(plan).items()
        if name != plan.law
    }
    said = "; ".join(
        f"{pair[0]:g} / {pair[1]:g} ({title_of(name)})" for name, pair in found.items() if pair is not None
    )
    yield (
        f"The average of the optima is Kp / Kd {said or 'none'}; the report's is {REPORT_KP:g} / {REPORT_KD:g}. A"
        " known cause: the pairs tried are ours. What else moves the optimum is not known."
    )


def _noise(plan: ReportPlan, rows: Rows) -> Iterator[str]:
    """Tell what the report's own pair loses by noise, where the pair is in the tables."""
    pairs = plan.pairs(ALONE_LAW)
    if (REPORT_KP, REPORT_KD) not in pairs:
        return
    number = pairs.index((REPORT_KP, REPORT_KD))
    ended = {
        name: [test for test in plan.tests if chosen(rows[f"gains {name}"], test=test)[number]["outcome"] == "driven"]
        for name in (CLEAN_TABLE, ALONE_LAW)
    }
    if len(ended[ALONE_LAW]) < len(ended[CLEAN_TABLE]):
        yield (
            f"The report's pair without safety drives {', '.join(ended[CLEAN_TABLE])} to the end with a lidar without"
            f" noise, and {', '.join(ended[ALONE_LAW]) or 'nothing'} with {plan.noise_words()}. So that is"
            " the cause: the least-squares line takes every outlier, and Kd multiplies its angle."
        )


def _tests_without_a_way(plan: ReportPlan, rows: Rows) -> Iterator[str]:
    for law, how in ((ALONE_LAW, "without safety"), (REPORT_LAW, "with the report's safety")):
        for test in plan.tests:
            some = chosen(rows[f"gains {law}"], test=test)
            ended = sorted({row["outcome"] for row in some})
            if "driven" in ended:
                continue
            yield f"{test} ({ABOUT[test]}) {how}: {' or '.join(ended)} with every pair.{_cause(some[0], ended)}"


def _cause(row: Row, ended: Sequence[str]) -> str:
    if row["limit_known"] and row["limit_m"] is None:
        return " Cause: no steering at this speed without contact was found by the search for the physical limit."
    if ended == ["stands"] and row["test"] == "t1":
        return (
            " Cause: the beam ahead meets the wall nearer than the fixed stopping distance of 0.933 m, so the car never"
            " sets off (decision 6)."
        )
    return " The cause is not known."


def _errors(plan: ReportPlan, rows: Rows) -> Iterator[str]:
    report = [row for row in rows["report"] if row["outcome"] == "driven"]
    steady = [row["steady_error_m"] for row in report if row["steady_error_m"] is not None]
    if steady and max(steady) > BIAS_M:
        yield (
            f"The report's law keeps a steady error of {1000 * min(steady):.0f} to {1000 * max(steady):.0f} mm here."
            " Cause: its distance is the mean of the three nearest ranges, and the smallest of many noisy ranges is"
            f" about two standard deviations too near (here {plan.noise_words()})."
        )
    yield (
        "The report's errors per pair, its safety trials and its start distances are not in the references, so no"
        " difference can be given for them. Ours: 0.5 and 1.5 m, turned by 30 degrees; the design notes' 20 degrees."
    )


def _obstacles(plan: ReportPlan, rows: Rows) -> Iterator[str]:
    blind: Sequence[Row] = rows[f"obstacles {REPORT_LAW} blind"]
    if not blind:
        return
    clear, stoppable = sum(row["clear"] for row in blind), sum(row["stoppable"] for row in blind)
    yield (
        f"The report stopped in {published.STOPPED} of {published.OBSTACLES} obstacle cases; its law here in {clear} of"
        f" {len(blind)}, and no brake could in more than {stoppable} at friction {plan.mu:g}. Cause: at a true 3 or"
        " 4 m/s stopping takes more than the way left, so the report's car drove slower than the speeds named, or its"
        " obstacles were seen earlier. Which of both is not known."
    )
