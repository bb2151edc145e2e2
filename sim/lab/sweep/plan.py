"""A sweep's file (docs/sweeps.md): what all runs share, a grid, random values; and its cells.

Each value of [random] has a generator of its own: another value beside it, or more runs, change none that were there.
"""

import difflib
import itertools
import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from wallride.runtime.settings.tree import Settings
from wallride.sim.lab.sweep.drive_cell import (
    CONDITIONS,
    NAMES,
    CellMistakeError,
    DriveCell,
    DriveSetup,
    digest,
    setup_of,
)
from wallride.sim.scenario.toml_lines import KeyPath, TomlText, flat, read_toml
from wallride.sim.world.worlds import is_map

SEEDS, GRID, RANDOM = "seeds", "grid", "random"
RUNS, RANDOM_SEED = "runs", "seed"
RANGE_KEYS = frozenset({"from", "to", "log", "whole"})
MAX_RUNS = 2_000_000
SIGNIFICANT_DIGITS = 6


@dataclass(frozen=True, slots=True)
class SweepPlan:
    """Runs of a file. cells: in the file's order. varied: names in [grid]. sampled: names in [random]."""

    text: TomlText
    cells: tuple[DriveCell, ...]
    varied: tuple[str, ...]
    sampled: tuple[str, ...]

    def setup_of(self, cell: DriveCell) -> DriveSetup:
        """Return the checked content of a cell; FileMistakeError has file and line of the value that is wrong."""
        try:
            return setup_of(cell)
        except CellMistakeError as mistake:
            raise self.text.mistake(self._place(mistake.name), str(mistake)) from None

    def _place(self, name: str) -> KeyPath:
        path = tuple(name.split("."))
        table = GRID if name in self.varied else RANDOM if name in self.sampled else None
        if name == "seed" and (SEEDS,) in self.text.lines:
            return (SEEDS,)
        return (table, *path) if table is not None else path


def read_plan(path: Path, shared: Mapping[str, Any] | None = None) -> SweepPlan:
    """Return a file's plan; FileMistakeError names the line. shared: values for all runs. Own laws: also beside it."""
    text = read_toml(path)
    if not text.tree:
        raise text.mistake((), "declares nothing; docs/sweeps.md has a sweep to start from")
    text.search_beside()
    tree = dict(text.tree)
    seeds = _seeds(text, tree.pop(SEEDS, None))
    grid = {name: _choices(text, name, value) for name, value in _named(text, GRID, tree.pop(GRID, {})).items()}
    random_table = _table(text, RANDOM, tree.pop(RANDOM, {}))
    runs, random_seed = _whole(text, random_table, RUNS, 1), _whole(text, random_table, RANDOM_SEED, 0)
    sampled = _named(text, RANDOM, {name: one for name, one in random_table.items() if name not in {RUNS, RANDOM_SEED}})
    if RANDOM in text.tree and not sampled:
        raise text.mistake((RANDOM,), "[random] has no value to vary; write for example vehicle.grip_mu = [0.5, 0.8]")
    samples = {name: _samples(text, name, value, runs, random_seed) for name, value in sampled.items()}
    fixed = {**_named(text, None, tree), **(shared or {})}
    for name, value in fixed.items():
        if isinstance(value, dict):
            raise text.mistake(tuple(name.split(".")), f"{name} = {value!r}: a range belongs into [random]")
    if seeds and ("seed" in fixed or "seed" in grid):
        raise text.mistake((SEEDS,), "seed and seeds are both given; keep one of them")
    _check_twice(text, {None: fixed, GRID: grid, RANDOM: samples})
    count = math.prod(len(values) for values in grid.values()) * len(seeds or [0]) * runs
    if count > MAX_RUNS:
        raise text.mistake((GRID,), f"these are {count} runs; at most {MAX_RUNS} are possible in one sweep")
    cells = dict.fromkeys(
        DriveCell.of(_with_paths(values, path.absolute().parent))
        for values in _combinations(fixed, grid, samples, seeds, runs)
    )
    return SweepPlan(text, tuple(cells), tuple(grid), tuple(samples))


def _combinations(
    fixed: Mapping[str, Any], grid: Mapping[str, Sequence[Any]], samples: Mapping[str, Sequence[Any]],
    seeds: Sequence[int], runs: int,
) -> Iterator[dict[str, Any]]:  # fmt: skip
    """Yield the values of every run. Without seeds the number of the random run is its seed."""
    has_seed = "seed" in fixed or "seed" in grid
    for chosen in itertools.product(*grid.values()):
        for run in range(runs):
            random_values = {name: values[run] for name, values in samples.items()}
            values = {**fixed, **dict(zip(grid, chosen, strict=True)), **random_values}
            if seeds:
                yield from ({**values, "seed": seed} for seed in seeds)
            else:
                yield values if has_seed else {**values, "seed": run}


def _with_paths(values: dict[str, Any], folder: Path) -> dict[str, Any]:
    """Return the values with the paths that the file's folder has made absolute."""
    paths: dict[str, Any] = {
        name: str(folder / str(values[name]))
        for name in ("world", "config")
        if name in values and (name == "config" or is_map(str(values[name]))) and (folder / str(values[name])).exists()
    }
    return {**values, **paths}


def _table(text: TomlText, name: str, value: object) -> dict[str, Any]:
    if not isinstance(value, dict):
        raise text.mistake((name,), f"{name} is a table; write [{name}] and its values below")
    return value


def _named(text: TomlText, table: str | None, tree: object) -> dict[str, Any]:
    """Return the values of a table by their dotted names; every name is known."""
    if not isinstance(tree, dict):
        raise text.mistake((table or "",), f"{table} is a table; write [{table}] and its values below")
    values = flat(tree, values_with=("from", "to"))
    for name in values:
        _check_name(text, table, name)
    return values


def _check_name(text: TomlText, table: str | None, name: str) -> None:
    first = name.partition(".")[0]
    place = tuple(name.split(".")) if table is None else (table, *name.split("."))
    if name in CONDITIONS:
        raise text.mistake(place, f"{name} is a table; write {name}.KEY = VALUE, or [{name}] and its keys below")
    if name in {SEEDS, RUNS}:
        right = "at the top of the file, above all tables" if name == SEEDS else "into [random]"
        raise text.mistake(place, f"{name} belongs {right}")
    if name in NAMES or first in CONDITIONS or first in Settings.model_fields:
        return
    known = [*NAMES, *(f"{section}.KEY" for section in CONDITIONS), SEEDS, GRID, RANDOM]
    near = difflib.get_close_matches(name, [*known, *Settings.model_fields], 1)
    meant = f"did you mean {near[0]}? " if near else ""
    raise text.mistake(place, f"{name} is unknown; {meant}there are {', '.join(known)}, and any setting of the car")


def _check_twice(text: TomlText, groups: Mapping[str | None, Mapping[str, Any]]) -> None:
    for first, second in itertools.combinations(groups, 2):
        for name in groups[first].keys() & groups[second].keys():
            raise text.mistake(
                (str(second), *name.split(".")), f"{name} is given twice in this sweep; keep one of them"
            )


def _choices(text: TomlText, name: str, value: object) -> list[Any]:
    if not isinstance(value, list) or not value:
        raise text.mistake((GRID, *name.split(".")), f"{name}: write a list of values, for example {name} = [1, 2]")
    return value


def _seeds(text: TomlText, value: object) -> list[int]:
    """Return the seeds: 0 to before a number, or a list of them; [] where there are none."""
    if value is None:
        return []
    numbers: list[Any] = value if isinstance(value, list) else [value]
    if not numbers or any(isinstance(one, bool) or not isinstance(one, int) or one < 0 for one in numbers):
        raise text.mistake((SEEDS,), f"seeds = {value!r}: write how many, or a list of whole numbers from 0 on")
    if isinstance(value, int) and value < 1:
        raise text.mistake((SEEDS,), "seeds = 0: at least one is needed")
    return list(range(value)) if isinstance(value, int) else numbers


def _whole(text: TomlText, table: Mapping[str, Any], name: str, least: int) -> int:
    value = table.get(name, least)
    if isinstance(value, bool) or not isinstance(value, int) or value < least:
        raise text.mistake((RANDOM, name), f"{name} = {value!r}: write a whole number, {least} or more")
    return value


def _samples(text: TomlText, name: str, value: object, runs: int, seed: int) -> list[Any]:
    place = (RANDOM, *name.split("."))
    random = np.random.default_rng([seed, int(digest(name), 16)])
    shares = random.random(runs)
    if isinstance(value, list) and value:
        return [value[int(share * len(value))] for share in shares]
    if not isinstance(value, dict) or not _is_range(value):
        raise text.mistake(
            place,
            f"{name} = {value!r}: write a list to choose from, or {{ from = LOW, to = HIGH }} with LOW below HIGH",
        )
    low, high = float(value["from"]), float(value["to"])
    if value.get("whole"):
        if low != int(low) or high != int(high):
            raise text.mistake(place, f"{name}: whole = true needs whole numbers from and to")
        return [int(low) + int(share * (int(high) - int(low) + 1)) for share in shares]
    if value.get("log"):
        if low <= 0:
            raise text.mistake(place, f"{name}: log = true needs from above 0")
        return [_rounded(low * (high / low) ** share) for share in shares]
    return [_rounded(low + share * (high - low)) for share in shares]


def _is_range(value: Mapping[str, Any]) -> bool:
    ends = [value.get("from"), value.get("to")]
    numbers = [end for end in ends if isinstance(end, int | float) and math.isfinite(end)]
    return len(numbers) == len(ends) and numbers[0] < numbers[1] and value.keys() <= RANGE_KEYS


def _rounded(value: float) -> float:
    return float(f"{value:.{SIGNIFICANT_DIGITS}g}")
