"""The study as one page: verdict, history, importance, slices, and speed against clearance."""

import math
from collections.abc import Sequence
from html import escape

import numpy as np
import optuna
from optuna.importance import PedAnovaImportanceEvaluator, get_param_importances
from optuna.trial import FrozenTrial

from wallride.sim.lab.cell import TabledCell
from wallride.sim.lab_report.page import html_table
from wallride.sim.run_report.charts import ScatterPlot, scatter, shares
from wallride.sim.run_report.page import section, still_document
from wallride.sim.tuning.study import TuningPlan, finished, values_of
from wallride.sim.tuning.verdict import Comparison, TuningVerdict
from wallride.sim.world.pose import Floats

MIN_TRIALS_FOR_IMPORTANCE = 10
SHOWN_TRIALS = 10
COST = "cost less the present settings'"
HISTORY = (
    "Each point is a trial; below 0 it is better than the present settings under the same conditions. The line is the"
    " best of all before."
)
IMPORTANCE = "Share of the cost's variation that each parameter explains (PED-ANOVA)."
PARETO = (
    "Mean speed, and the least distance to anything, averaged over the drives of a trial; the line joins the trials"
    " that no other beats in both."
)


def tuning_page(study: optuna.Study, plan: TuningPlan, verdict: TuningVerdict, version: str) -> str:
    """Return the page."""
    trials = finished(study)
    slices = [_slice(trials, one.name, verdict) for one in plan.parameters if not one.choices]
    parts = [
        _head(plan, verdict, version),
        html_table(_values(plan, verdict)),
        section("History", _history(trials), HISTORY),
        section("Importance", _importance(study), IMPORTANCE),
        *slices,
        section("Speed against clearance", _pareto(trials), PARETO),
        html_table(_best(trials)),
        html_table(_scenarios("Its scenarios, conditions that no trial had", verdict.fresh)),
        html_table(_scenarios("Scenarios that no trial had", verdict.held_out)),
    ]
    return still_document(f"Tuning {plan.law}", "".join(parts))


def _head(plan: TuningPlan, verdict: TuningVerdict, version: str) -> str:
    given = f"Given: {', '.join(plan.settings)}." if plan.settings else "All other settings: the defaults."
    given += f" In every drive: {', '.join(plan.conditions)}." if plan.conditions else ""
    judged = "is better" if verdict.better else "is not shown to be better"
    return (
        f"<header><h1>Tuning <small>{escape(plan.law)}</small></h1>"
        f"<p>{verdict.trials} trials, seed {plan.seed}, wallride {escape(version)}. {escape(given)}</p>"
        f"<p>The best trial ({verdict.trial}) {judged}.</p><ul>"
        f"<li>On its scenarios, under conditions that no trial had: {escape(verdict.fresh.words())}.</li>"
        f"<li>On scenarios that no trial had: {escape(verdict.held_out.words())}.</li></ul></header>"
    )


def _values(plan: TuningPlan, verdict: TuningVerdict) -> TabledCell:
    body = tuple(
        (one.name, str(one.present), one.range_words(), str(verdict.values[one.name])) for one in plan.parameters
    )
    return TabledCell("Parameters", ("setting", "present", "range", "tuned"), body)


def _column(trials: Sequence[FrozenTrial], name: str) -> Floats:
    return np.array([trial.user_attrs[name] for trial in trials], dtype=np.float64)


def _history(trials: Sequence[FrozenTrial]) -> str:
    numbers = np.array([float(trial.number) for trial in trials])
    costs = np.array([trial.value for trial in trials], np.float64)
    best = np.stack([numbers, np.minimum.accumulate(costs)], axis=1)
    return scatter(ScatterPlot(numbers, costs, "trial", "cost", line=best))


def _importance(study: optuna.Study) -> str:
    if len(finished(study)) < MIN_TRIALS_FOR_IMPORTANCE:
        return f'<p class="nothing">needs {MIN_TRIALS_FOR_IMPORTANCE} trials</p>'
    found = get_param_importances(study, evaluator=PedAnovaImportanceEvaluator())
    return shares([(name, share) for name, share in found.items() if math.isfinite(share)])


def _slice(trials: Sequence[FrozenTrial], name: str, verdict: TuningVerdict) -> str:
    some = [(float(trial.params[name]), trial.value or 0.0, trial.number) for trial in trials]
    table = np.array(some, dtype=np.float64).reshape(-1, 3)
    marked = [(x, y) for x, y, number in some if number == verdict.trial]
    return section(f"Slice: {name}", scatter(ScatterPlot(table[:, 0], table[:, 1], name, "cost", marked=marked)))


def pareto_front(speed_mps: Floats, clearance_m: Floats) -> list[int]:
    """Return the indices of the points that no other is at least as fast and as clear as; the fastest first."""
    front: list[int] = []
    for index in np.lexsort((-clearance_m, -speed_mps)):
        if not front or clearance_m[index] > clearance_m[front[-1]]:
            front.append(int(index))
    return front


def _pareto(trials: Sequence[FrozenTrial]) -> str:
    speed_mps, clearance_m = _column(trials, "mean_speed_mps"), _column(trials, "clearance_m")
    front = pareto_front(speed_mps, clearance_m)
    line = np.stack([speed_mps[front], clearance_m[front]], axis=1)
    return scatter(ScatterPlot(speed_mps, clearance_m, "mean speed m/s", "m", line=line))


def _best(trials: Sequence[FrozenTrial]) -> TabledCell:
    names = list(trials[0].params)
    body = tuple(
        (str(trial.number), f"{trial.value:+.3f}", f"{trial.user_attrs['cost']:.3f}", str(trial.user_attrs["contacts"]),
         *(str(values_of(trial)[name]) for name in names))
        for trial in sorted(trials, key=lambda trial: trial.value or 0.0)[:SHOWN_TRIALS]
    )  # fmt: skip
    return TabledCell("Best trials", ("trial", COST, "cost", "contacts", *names), body)


def _scenarios(title: str, compared: Comparison) -> TabledCell:
    count = len(compared.scenarios)
    tuned, present = (np.array(costs).reshape(-1, count).mean(axis=0) for costs in (compared.tuned, compared.present))
    body = tuple(
        (course, f"{speed_mps:g}", f"{cost:.3f}", f"{before:.3f}", f"{cost - before:+.3f}")
        for (course, speed_mps), cost, before in zip(compared.scenarios, tuned, present, strict=True)
    )
    return TabledCell(title, ("course", "m/s", "tuned", "present", "difference"), body, (compared.words() + ".",))
