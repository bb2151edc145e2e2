"""A study in a journal file: every finished trial is on the disk before the next begins, so that a kill costs none.

Trials run in batches of BATCH, whatever the number of processes, and each batch has a sampler of its own seed: the same
study gives the same trials with 1 and with 8 processes, and after a restart.
"""

import json
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

import optuna
from optuna.samplers import TPESampler
from optuna.storages import JournalStorage
from optuna.storages.journal import JournalFileBackend
from optuna.trial import FrozenTrial, Trial, TrialState

from wallride.sim.lab.cell import Cell, Figures
from wallride.sim.lab.laws import own_law_files
from wallride.sim.lab.sweep.drive_cell import file_digest
from wallride.sim.lab.tuning.drive import Scenario, cells, cost_of
from wallride.sim.tuning.space import TunedParameter

BATCH = 4
STARTUP_TRIALS = 16
"""Trials at random before the sampler uses what it has seen."""
SEEDS = 10
"""Number of condition sets; the present settings drive each of them once, for comparison."""
FIRST_HELD_OUT_SEED = 500
"""Seeds from here on are for the verdict alone."""
JOURNAL = "study.journal"
Measure = Callable[[Sequence[Cell]], list[Figures]]
"""Returns the figures of drives in their order."""
_PLAN = "wallride.plan"
_BASELINE = "wallride.baseline"


class StudyError(Exception):
    """The study cannot go on; the text says why and what to do."""


@dataclass(frozen=True, slots=True)
class TuningPlan:
    """What a study is about; a study that exists is only continued with the same.

    settings: given, not tuned. conditions: of every drive, in place of the sampled ones.
    """

    law: str
    settings: tuple[str, ...]
    parameters: tuple[TunedParameter, ...]
    scenarios: tuple[Scenario, ...]
    seed: int
    conditions: tuple[str, ...] = ()

    def text(self) -> str:
        """Return the plan as one comparable text; of the user's laws the files count."""
        names = [[one.name, one.range_words()] for one in self.parameters]
        files = map(file_digest, own_law_files(self.law))
        return json.dumps([self.law, self.settings, names, self.scenarios, self.seed, *self.conditions, *files])

    def condition_seed(self, number: int) -> int:
        """Return the seed of a trial's conditions."""
        return 1000 * self.seed + number % SEEDS

    def cells(self, values: dict[str, float | bool | str], seed: int, scenarios: Sequence[Scenario]) -> list[Cell]:
        """Return the drives with some settings, {} for the present ones, under the conditions of a seed."""
        return cells(self.law, self.assignments(values), seed, scenarios, self.conditions)

    def assignments(self, values: dict[str, float | bool | str]) -> tuple[str, ...]:
        """Return the settings of a trial as KEY=VALUE texts."""
        return (*self.settings, *(f"{name}={json.dumps(value)}" for name, value in values.items()))


def open_study(folder: Path, plan: TuningPlan) -> optuna.Study:
    """Return the study of a folder, a new one or the one that is there; StudyError when that is about another plan."""
    folder.mkdir(parents=True, exist_ok=True)
    optuna.logging.set_verbosity(optuna.logging.WARNING)
    storage = JournalStorage(JournalFileBackend(str(folder / JOURNAL)))
    study = optuna.create_study(storage=storage, study_name="wallride", load_if_exists=True)
    kept = study.user_attrs.get(_PLAN)
    if kept is None:
        study.set_user_attr(_PLAN, plan.text())
    elif kept != plan.text():
        raise StudyError(
            f"{folder}: holds a study of another law, or of its file before a change, another range, scenario or seed;"
            " name another folder with -o,"
            " or give the same options to continue it"
        )
    return study


def finished(study: optuna.Study) -> list[FrozenTrial]:
    """Return the finished trials, in order."""
    return study.get_trials(deepcopy=False, states=(TrialState.COMPLETE,))


def baseline(study: optuna.Study, plan: TuningPlan, measure: Measure) -> list[float]:
    """Return the cost of the present settings under each set of conditions; measured once per study."""
    kept = study.user_attrs.get(_BASELINE)
    if kept is not None:
        return [float(cost) for cost in kept]
    seeds = [plan.condition_seed(number) for number in range(SEEDS)]
    count = len(plan.scenarios)
    rows = measure([cell for seed in seeds for cell in plan.cells({}, seed, plan.scenarios)])
    costs = [cost_of(rows[at : at + count]) for at in range(0, len(rows), count)]
    study.set_user_attr(_BASELINE, costs)
    return costs


def go_on(study: optuna.Study, plan: TuningPlan, trials: int, measure: Measure, advance: Callable[[int], None]) -> None:
    """Run trials until that many are finished. advance: called with the number finished."""
    costs = baseline(study, plan, measure)
    while (done := len(finished(study))) < trials:
        advance(done)
        study.sampler = TPESampler(
            seed=plan.seed + done, n_startup_trials=STARTUP_TRIALS, multivariate=True, constant_liar=True
        )
        batch = [study.ask() for _ in range(min(BATCH, trials - done))]
        wanted = [_suggest(trial, plan.parameters) for trial in batch]
        seeds = [plan.condition_seed(trial.number) for trial in batch]
        drives = [plan.cells(values, seed, plan.scenarios) for values, seed in zip(wanted, seeds, strict=True)]
        rows = measure([cell for some in drives for cell in some])
        count = len(plan.scenarios)
        for index, trial in enumerate(batch):
            own = rows[index * count : (index + 1) * count]
            cost = cost_of(own)
            trial.set_user_attr("cost", cost)
            trial.set_user_attr("present_cost", costs[trial.number % SEEDS])
            trial.set_user_attr("mean_speed_mps", sum(row["mean_speed_mps"] or 0.0 for row in own) / count)
            trial.set_user_attr("clearance_m", sum(row["min_clearance_m"] for row in own) / count)
            trial.set_user_attr("contacts", sum(row["collided"] for row in own))
            study.tell(trial, cost - costs[trial.number % SEEDS])
    advance(trials)


def _suggest(trial: Trial, parameters: Sequence[TunedParameter]) -> dict[str, float | bool | str]:
    values: dict[str, float | bool | str] = {}
    for one in parameters:
        if one.choices:
            picked = trial.suggest_categorical(one.name, one.choices)
            values[one.name] = picked if isinstance(picked, bool) else str(picked)
        elif one.whole:
            values[one.name] = trial.suggest_int(one.name, int(one.lowest), int(one.highest))
        else:
            values[one.name] = round(trial.suggest_float(one.name, one.lowest, one.highest), 4)
    return values


def values_of(trial: FrozenTrial) -> dict[str, float | bool | str]:
    """Return the settings of a finished trial, rounded as they were driven."""
    return {name: round(value, 4) if isinstance(value, float) else value for name, value in trial.params.items()}
