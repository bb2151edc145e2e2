"""`wallride lab tune`: from the options to the study, its page and a settings file."""

import argparse
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from importlib.metadata import version
from pathlib import Path
from typing import Self

from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeRemainingColumn

from wallride.runtime.host.output_files import write_file
from wallride.runtime.host.terminal_text import complain
from wallride.runtime.parameters.toml_text import set_value
from wallride.runtime.settings.tree import SettingsError, load_settings, read_value
from wallride.sim.lab import laws
from wallride.sim.lab.cell import Cell, Figures
from wallride.sim.lab.command import FIXED_SETTINGS, INTERRUPTED, LabUsageError, check_folder
from wallride.sim.lab.pool import Measuring, in_order
from wallride.sim.lab.tuning.drive import SCENARIOS, Scenario
from wallride.sim.lab.workers.finished_cell import WorkerStartError
from wallride.sim.lab.workers.submit import workers
from wallride.sim.scenario.conditions import ConditionsError, RequestedConditions, named_conditions
from wallride.sim.tuning.page import tuning_page
from wallride.sim.tuning.space import SpaceError, space_of
from wallride.sim.tuning.study import BATCH, SEEDS, Measure, StudyError, TuningPlan, go_on, open_study
from wallride.sim.tuning.verdict import TuningVerdict, drives_to_judge, judge

GIVEN = "given by --set"


def run(options: argparse.Namespace) -> int:
    """Run or continue a study; 1: a law failed, 2: a wrong option, 130: Ctrl-C, which keeps what is finished."""
    console = Console(stderr=True)
    folder: Path = options.output
    try:
        plan = plan_of(options)
        verdict, rows = study_and_judge(plan, folder, options, console)
    except (LabUsageError, ConditionsError, SpaceError, StudyError, WorkerStartError) as error:
        return complain(error)
    except KeyboardInterrupt:
        console.print(f"interrupted; the same command goes on with the study in {folder}")
        return INTERRUPTED
    for what, compared in (("its scenarios, new conditions", verdict.fresh), ("held-out scenarios", verdict.held_out)):
        print(f"{what}: {compared.words()}")  # noqa: T201
    for name, value in verdict.values.items():
        print(f"{name} = {value}")  # noqa: T201
    judged = "better than" if verdict.better else "not shown to be better than"
    print(f"{folder / 'tuned.toml'}: {judged} the present settings; {folder / 'tuning.html'} has the plots")  # noqa: T201
    return laws.tell_own_law_faults(rows)


def study_and_judge(
    plan: TuningPlan, folder: Path, options: argparse.Namespace, console: Console
) -> tuple[TuningVerdict, list[Figures]]:
    """Run the trials that are missing, write the page and the settings file; return the verdict, and all drives."""
    rows: list[Figures] = []
    check_folder(folder, "the study")
    study = open_study(folder, plan)
    with (
        TuningProgress(console, options.trials, len(plan.scenarios)) as progress,
        measuring(options.jobs, options.on, progress.driven, rows) as measure,
    ):
        go_on(study, plan, options.trials, measure, progress.finished)
        progress.judging(drives_to_judge(study, plan))
        verdict = judge(study, plan, measure)
    of = version("wallride")
    write_file(folder / "tuning.html", tuning_page(study, plan, verdict, of))
    write_settings(folder / "tuned.toml", settings_text(plan, verdict, of))
    return verdict, rows


@contextmanager
def measuring(
    jobs: int | None, on: str = "", driven: Callable[[], None] = lambda: None, kept: list[Figures] | None = None
) -> Iterator[Measure]:
    """Yield what returns the figures of drives in their order, the same for any workers, which stay for the study.

    driven: called after each drive. kept: takes all figures.
    """
    with workers(Measuring(None), jobs=jobs, on=on) as run:

        def measure(drives: Sequence[Cell]) -> list[Figures]:
            rows = in_order(run(drives), driven)
            if kept is not None:
                kept.extend(rows)
            return rows

        yield measure


class TuningProgress:
    """Shows how far a study is: its trials, and below them the drives of what is under way."""

    def __init__(self, console: Console, trials: int, scenarios: int) -> None:
        columns = TextColumn("{task.description}"), BarColumn(), MofNCompleteColumn(), TimeRemainingColumn()
        self._console, self._trials, self._scenarios = console, trials, scenarios
        self._progress = Progress(*columns, console=console, transient=True)
        self._trial_bar = self._progress.add_task("trials", total=trials)
        self._drive_bar = self._progress.add_task("drives, present settings", total=SEEDS * scenarios)

    def __enter__(self) -> Self:
        self._progress.start()
        return self

    def __exit__(self, *_: object) -> None:
        self._progress.stop()

    def driven(self) -> None:
        """Count a drive."""
        self._progress.advance(self._drive_bar)

    def finished(self, trials: int) -> None:
        """Show the finished trials, and begin the drives of the next ones."""
        self._progress.update(self._trial_bar, completed=trials)
        self._begin("drives, next trials", min(BATCH, self._trials - trials) * self._scenarios)

    def judging(self, drives: int) -> None:
        """Begin the drives of the verdict; also said where no bar is shown, as in a file."""
        self._console.print(f"verdict: {drives} drives in conditions and scenarios that no trial has seen")
        self._begin("drives, verdict", drives)

    def _begin(self, what: str, drives: int) -> None:
        self._progress.reset(self._drive_bar, total=drives, description=what)


def plan_of(options: argparse.Namespace) -> TuningPlan:
    """Return the plan of the options; an exception of this package for an invalid one."""
    if options.method.endswith("+none"):
        raise LabUsageError(f"--method {options.method}: a law is tuned with its safety; leave +none out")
    try:
        law = laws.check(options.method)
        settings = laws.settings_of(law, "left", 1.0, 1.0, options.assignments)
    except (ValueError, SettingsError) as error:
        raise LabUsageError(f"{options.method}: {error}") from None
    fixed = next((text for text in options.assignments if text.partition("=")[0].strip() in FIXED_SETTINGS), None)
    if fixed is not None:
        raise LabUsageError(f"--set {fixed}: every scenario has its own")
    parameters = tuple(space_of(settings, options.parameters))
    twice = {text.partition("=")[0].strip() for text in options.assignments} & {one.name for one in parameters}
    if twice:
        raise LabUsageError(f"{', '.join(sorted(twice))}: is both set and tuned; leave one of them out")
    conditions = named_conditions(RequestedConditions(options.conditions, options.condition))
    return TuningPlan(law, tuple(options.assignments), parameters, _scenarios(options.only), options.seed, conditions)


def _scenarios(text: str | None) -> tuple[Scenario, ...]:
    """Return all scenarios, or those of the courses named."""
    if text is None:
        return SCENARIOS
    wanted = [part.strip() for part in text.split(",")]
    known = [course for course, _ in SCENARIOS]
    wrong = next((course for course in wanted if course not in known), None)
    if wrong is not None:
        raise LabUsageError(f"--only {wrong}: no scenario has this course; write some of {', '.join(known)}")
    return tuple(scenario for scenario in SCENARIOS if scenario[0] in wanted)


def settings_text(plan: TuningPlan, verdict: TuningVerdict, version: str) -> str:
    """Return the file: the law, what was given, what was tuned. Everything else is the default."""
    follower, _, guard = plan.law.partition("+")
    head = (
        f"Written by `wallride lab tune` (wallride {version}) from {verdict.trials} trials, seed {plan.seed}.",
        f"On its scenarios, conditions that no trial had: {verdict.fresh.words()}.",
        f"On scenarios that no trial had: {verdict.held_out.words()}.",
        *([f"In every drive: {', '.join(plan.conditions)}."] if plan.conditions else []),
        "Simulated. Wheels up and slowly first. Every setting that is not here is the default.",
    )
    text = "".join(f"# {line}\n" for line in head)
    text = _put(text, "wall_follow.method", follower, "given by --method")
    if guard not in {"swept", ""}:
        text = _put(text, "safety.method", guard, "given by --method")
    for assignment in plan.settings:
        key, _, given = assignment.partition("=")
        text = _put(text, key.strip(), read_value(given.strip()), GIVEN)
    for one in plan.parameters:
        value = verdict.values[one.name]
        text = _put(text, one.name, value, f"trial {verdict.trial}, from {one.range_words()}; was {one.present}")
    return text


def write_settings(path: Path, text: str) -> None:
    """Write the file and load it; SettingsError where it could not be used, which is a bug."""
    write_file(path, text)
    try:
        load_settings(path)
    except SettingsError:
        path.unlink()
        raise


def _put(text: str, name: str, value: object, comment: str) -> str:
    return set_value(text, tuple(name.split(".")), value, comment)
