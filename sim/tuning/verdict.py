"""The verdict: the best trials and the present settings again, under conditions and in scenarios no trial has seen."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import optuna
from optuna.distributions import CategoricalDistribution
from optuna.trial import FrozenTrial

from wallride.sim.lab.cell import Figures
from wallride.sim.lab.tuning.drive import HELD_OUT, Scenario
from wallride.sim.tuning.study import FIRST_HELD_OUT_SEED, SEEDS, Measure, TuningPlan, finished, values_of
from wallride.sim.world.pose import Floats

FINALISTS = 3
NEIGHBOURS_SHARE = 20
"""One of so many trials is a neighbour: 10 of 200."""
VERDICT_SEEDS = 4
RESAMPLES = 4000
CONFIDENCE = 0.95
Values = dict[str, float | bool | str]


@dataclass(frozen=True, slots=True)
class Comparison:
    """Costs of the same drives with tuned and with present settings. lowest, highest: of the mean difference (95 %)."""

    scenarios: tuple[Scenario, ...]
    tuned: tuple[float, ...]
    present: tuple[float, ...]
    contacts: tuple[int, int]
    lowest: float
    highest: float

    @property
    def difference(self) -> float:
        """Return the mean of tuned minus present."""
        return float(np.mean(self.tuned) - np.mean(self.present))

    def words(self) -> str:
        """Return the outcome in one sentence."""
        at_most = max(0.0, -self.lowest / float(np.mean(self.present)))
        same = f"cannot be told from it, so at most {100 * at_most:.1f} % better"
        judged = "is better" if self.highest < 0 else "is worse" if self.lowest > 0 else same
        return (
            f"cost {np.mean(self.tuned):.3f} against {np.mean(self.present):.3f} of the present settings"
            f" ({self.difference:+.3f}, 95 % from {self.lowest:+.3f} to {self.highest:+.3f}): {judged};"
            f" contacts {self.contacts[0]} against {self.contacts[1]} in {len(self.tuned)} drives each"
        )


@dataclass(frozen=True, slots=True)
class TuningVerdict:
    """Outcome of a study. trial: number of the best trial. fresh: its scenarios again, held_out: others."""

    trial: int
    values: Values
    fresh: Comparison
    held_out: Comparison
    trials: int

    @property
    def better(self) -> bool:
        """Tell whether the tuned settings are surely better on their scenarios, and not surely worse on the others."""
        return self.fresh.highest < 0 and not self.held_out.lowest > 0


def drives_to_judge(study: optuna.Study, plan: TuningPlan) -> int:
    """Return the number of drives that the verdict takes."""
    rounds = min(FINALISTS, len(finished(study))) + 2  # the chosen trial again, and the present settings
    return VERDICT_SEEDS * (rounds * len(plan.scenarios) + 2 * len(_held_out(plan)))


def judge(study: optuna.Study, plan: TuningPlan, measure: Measure) -> TuningVerdict:
    """Return the verdict over the finished trials, of which there must be one."""
    done = finished(study)
    finalists = best_trials(done)
    chosen, fresh_rows = finalists[0], list[Figures]()
    for trial in finalists:
        rows = _drive(plan, values_of(trial), plan.scenarios, 0, measure)
        if not fresh_rows or _cost(rows) < _cost(fresh_rows):
            chosen, fresh_rows = trial, rows
    # The best of a few is judged once more where it was not chosen.
    again = _drive(plan, values_of(chosen), plan.scenarios, VERDICT_SEEDS, measure)
    present_again = _drive(plan, {}, plan.scenarios, VERDICT_SEEDS, measure)
    fresh = _compared(plan.scenarios, again, present_again)
    held_out = _held_out(plan)
    others = _compared(
        held_out,
        _drive(plan, values_of(chosen), held_out, VERDICT_SEEDS, measure),
        _drive(plan, {}, held_out, VERDICT_SEEDS, measure),
    )
    return TuningVerdict(chosen.number, values_of(chosen), fresh, others, len(done))


def _held_out(plan: TuningPlan) -> tuple[Scenario, ...]:
    return tuple(one for one in HELD_OUT if one not in plan.scenarios)


def best_trials(done: Sequence[FrozenTrial]) -> list[FrozenTrial]:
    """Return the best trials, the best first: by the mean over each one's neighbours, itself included.

    A cost counts beside the median of the trials under the same conditions: where the present settings fail under some,
    any trial under those looks good beside them. One trial is a few noisy drives, and the least of 200 is luck; its
    neighbours have nearly the same settings and other conditions.
    """
    costs: dict[int, list[float]] = {}
    for trial in done:
        costs.setdefault(trial.number % SEEDS, []).append(trial.user_attrs["cost"])
    medians = {seed: float(np.median(some)) for seed, some in costs.items()}
    above = np.array([trial.user_attrs["cost"] - medians[trial.number % SEEDS] for trial in done])
    places = _places(done)
    near = np.argsort(np.abs(places[:, None] - places[None]).sum(axis=2), axis=1, kind="stable")
    smooth = above[near[:, : max(1, len(done) // NEIGHBOURS_SHARE)]].mean(axis=1)
    return [done[index] for index in np.argsort(smooth, kind="stable")[:FINALISTS]]


def _places(done: Sequence[FrozenTrial]) -> Floats:
    """Return the settings of each trial (n, parameters) as shares of their ranges; a choice is 1 from another."""
    places = np.zeros((len(done), 0))
    for name in done[0].params:
        values = [trial.params[name] for trial in done]
        if isinstance(done[0].distributions[name], CategoricalDistribution):
            column = np.array([[value == other for other in dict.fromkeys(values)] for value in values], np.float64) / 2
        else:
            numbers = np.array(values, dtype=np.float64)[:, None]
            column = (numbers - numbers.min()) / (np.ptp(numbers) or 1.0)
        places = np.concatenate([places, column], axis=1)
    return places


def _drive(
    plan: TuningPlan, values: Values, scenarios: Sequence[Scenario], first: int, measure: Measure
) -> list[Figures]:
    seeds = range(FIRST_HELD_OUT_SEED + first, FIRST_HELD_OUT_SEED + first + VERDICT_SEEDS)
    return measure([cell for seed in seeds for cell in plan.cells(values, 1000 * plan.seed + seed, scenarios)])


def _cost(rows: Sequence[Figures]) -> float:
    return float(np.mean([row["cost"] for row in rows]))


def _compared(scenarios: Sequence[Scenario], tuned: Sequence[Figures], present: Sequence[Figures]) -> Comparison:
    """Return both costs of the same drives, with a bootstrap interval of the mean difference, paired by drive."""
    costs, before = (np.array([row["cost"] for row in rows]) for rows in (tuned, present))
    rng = np.random.default_rng(22)
    picks = rng.integers(len(costs), size=(RESAMPLES, len(costs)))
    means = (costs - before)[picks].mean(axis=1)
    tail = 50 * (1 - CONFIDENCE)
    lowest, highest = np.percentile(means, [tail, 100 - tail])
    contacts = (sum(row["collided"] for row in tuned), sum(row["collided"] for row in present))
    return Comparison(
        tuple(scenarios), tuple(costs.tolist()), tuple(before.tolist()), contacts, float(lowest), float(highest)
    )
