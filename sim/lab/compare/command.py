"""`wallride lab compare A B`: whether two sweeps differ, by how much, and how sure that is."""

import argparse
import json
import math
import re
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from rich.console import Console
from rich.table import Table

from wallride.runtime.host.output_files import write_answer
from wallride.runtime.host.terminal_text import complain
from wallride.sim.lab.command import INTERRUPTED, answer_console
from wallride.sim.lab.compare.pairs import ComparisonError, RunPairs, pairs_of
from wallride.sim.lab.compare.statistics import PairedDifference, paired_difference
from wallride.sim.lab.sweep.command import Workers, fill, keys_of
from wallride.sim.lab.sweep.plan import GRID, RANDOM, SEEDS, read_plan
from wallride.sim.lab.sweep.table import TableError, TableRun, is_table, open_table
from wallride.sim.lab.workers.finished_cell import WorkerStartError
from wallride.sim.scenario.toml_lines import FileMistakeError, read_toml

_SELECTED = re.compile(r"(.+\.(?:sqlite|db|toml)):([^:=]+=.+)")
_OF_SWEEPS = frozenset({"world", SEEDS, GRID, RANDOM, "law", "duration_s"})
FIGURES = (
    "mean_error_m", "rms_error_m", "steady_error_m", "overshoot_m", "mean_speed_mps", "distance_m", "min_clearance_m",
    "collided", "impact_mps", "safety_stops", "speed_lost", "best_lap_s",
)  # fmt: skip
MIN_CONFIDENCE, MAX_CONFIDENCE = 0.5, 0.999


@dataclass(frozen=True, slots=True)
class SideMaker:
    """Makes a side of a comparison. sweep: for settings files. jobs: as of `submit`."""

    sweep: Path | None
    jobs: int | None
    console: Console

    def runs(self, text: str) -> list[TableRun]:
        """Return the runs of FILE or FILE:NAME=VALUE,NAME=VALUE; what is missing of a sweep is run first.

        Raises ComparisonError, FileMistakeError or TableError for a file that cannot be used.
        """
        found = _SELECTED.fullmatch(text)
        file, wanted = (Path(found.group(1)), found.group(2).split(",")) if found else (Path(text), [])
        if not file.is_file():
            raise ComparisonError(f"{file}: no such file; give a table, a sweep or a settings file")
        if is_table(file):
            with open_table(file, writes=False) as table:
                runs = table.runs()
        else:
            runs = self._swept(file)
        for selection in wanted:
            name, _, value = selection.partition("=")
            runs = [run for run in runs if _is(run, name.strip(), value.strip())]
            if not runs:
                raise ComparisonError(f"{file}: no run has {name.strip()} = {value.strip()}")
        return runs

    def _swept(self, file: Path) -> list[TableRun]:
        """Return the runs of a sweep, or of a settings file below the sweep of the options."""
        if not _OF_SWEEPS & read_toml(file).tree.keys():
            if self.sweep is None:
                raise ComparisonError(f"{file}: is a settings file; name the drives to compare it in with --sweep FILE")
            plan = read_plan(self.sweep, {"config": str(file.absolute())})
        else:
            plan = read_plan(file)
        with open_table(plan.text.path.with_suffix(".sqlite"), writes=True) as table:
            keys = list(keys_of(plan))
            fill(table, plan, keys, Workers(self.jobs), self.console)
            return table.runs(keys)


def _is(run: TableRun, name: str, value: str) -> bool:
    """Return whether a run has a value, written as text or as JSON."""
    if name not in run.values:
        return False
    has = run.values[name]
    try:
        return bool(has == json.loads(value)) or has == value
    except ValueError:
        return bool(has == value)


def run(options: argparse.Namespace) -> int:
    """Compare; 0 when that was done, 2 for a mistake, 130 after Ctrl-C."""
    console = Console(stderr=True)
    try:
        _check(options.confidence)
        maker = SideMaker(options.sweep, options.jobs, console)
        pairs = pairs_of(maker.runs(options.a), maker.runs(options.b))
        compared = differences(pairs, _chosen(options.figures, pairs), options.confidence)
    except (ComparisonError, FileMistakeError, TableError, WorkerStartError) as error:
        return complain(error)
    except KeyboardInterrupt:
        console.print("interrupted; what has ended is kept, and the same command goes on")
        return INTERRUPTED
    if options.json is not None:
        _write(options, pairs, compared)
    if options.json != "-":
        show(pairs, compared, options.confidence, answer_console())
    return 0


def _check(confidence: float) -> None:
    if not MIN_CONFIDENCE <= confidence <= MAX_CONFIDENCE:
        raise ComparisonError(f"--confidence {confidence:g}: give {MIN_CONFIDENCE:g} to {MAX_CONFIDENCE:g}")


def differences(pairs: RunPairs, names: Sequence[str], confidence: float) -> dict[str, PairedDifference]:
    """Return the difference of every figure."""
    return {name: paired_difference(*pairs.figures(name), confidence) for name in names}


def in_words(of: PairedDifference) -> str:
    """Return what the pairs say of a figure."""
    if math.isnan(of.low):
        return f"too few pairs ({of.pairs})"
    low, high = (of.relative(end) for end in (of.low, of.high))
    if not of.is_told:
        most = max(abs(low), abs(high))
        return "no difference" + (f" (above {100 * most:.2g} % it would show)" if 0 < most < math.inf else "")
    way = "higher" if of.difference > 0 else "lower"
    if math.isnan(low):
        return f"B is {way}"
    ends = sorted((abs(low), abs(high)))
    return f"B is {100 * abs(of.relative(of.difference)):.1f} % {way} ({100 * ends[0]:.1f} to {100 * ends[1]:.1f} %)"


def show(pairs: RunPairs, compared: Mapping[str, PairedDifference], confidence: float, console: Console) -> None:
    """Print the table."""
    what = "; ".join(f"{name}: A {a}, B {b}" for name, a, b in pairs.compared) or "the same runs"
    table = Table("figure", "pairs", "A", "B", "B - A", "says", title=what, title_justify="left")
    for name, of in compared.items():
        numbers = [f"{value:.4g}" for value in (of.mean_a, of.mean_b, of.difference)]
        table.add_row(name, str(of.pairs), *numbers, in_words(of))
    console.print(table)
    console.print(f"  paired runs, studentized bootstrap and sign-flip test, {100 * confidence:g} %", highlight=False)
    if pairs.failed:
        console.print(f"  {pairs.failed} pairs with a failed run do not count", highlight=False)
    if pairs.alone:
        console.print(f"  {pairs.alone} runs have no partner on the other side", highlight=False)


def _chosen(text: str | None, pairs: RunPairs) -> list[str]:
    known = pairs.figure_names()
    if text is None:
        return [name for name in FIGURES if name in known]
    names = [name.strip() for name in text.split(",")]
    if unknown := [name for name in names if name not in known]:
        raise ComparisonError(f"--figures {unknown[0]}: no pair has it; there are {', '.join(known)}")
    return names


def _write(options: argparse.Namespace, pairs: RunPairs, compared: Mapping[str, PairedDifference]) -> None:
    summary: dict[str, Any] = {
        "a": options.a,
        "b": options.b,
        "compared": [list(one) for one in pairs.compared],
        "confidence": options.confidence,
        "failed_pairs": pairs.failed,
        "without_partner": pairs.alone,
        "figures": {
            name: {key: None if value != value else value for key, value in asdict(of).items()} | {"says": in_words(of)}
            for name, of in compared.items()
        },
    }
    write_answer(json.dumps(summary, indent=1, allow_nan=False) + "\n", options.json)
