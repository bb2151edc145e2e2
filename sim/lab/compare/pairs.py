"""Pairs of runs: those of A and B that agree in everything but what is compared."""

import json
from collections import defaultdict
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from wallride.sim.lab.sweep.table import TableRun
from wallride.sim.world.pose import Floats

Key = tuple[str, ...]


class ComparisonError(Exception):
    """Two sides cannot be compared; the text says why and what to do."""


@dataclass(frozen=True, slots=True)
class RunPairs:
    """Runs of both sides, pair i in `a[i]` and `b[i]`.

    compared: (name, value of A, value of B) in which they differ. alone: runs without a partner. failed: pairs
    with a run that failed, which do not count.
    """

    a: tuple[TableRun, ...]
    b: tuple[TableRun, ...]
    compared: tuple[tuple[str, str, str], ...]
    alone: int
    failed: int

    def figures(self, name: str) -> tuple[Floats, Floats]:
        """Return a figure of both sides over the pairs in which both have it as a number."""
        both = [(one.figures.get(name), other.figures.get(name)) for one, other in zip(self.a, self.b, strict=True)]
        numbers = [pair for pair in both if all(isinstance(value, int | float) for value in pair)]
        table = np.array(numbers, dtype=np.float64).reshape(-1, 2)
        return table[:, 0], table[:, 1]

    def figure_names(self) -> list[str]:
        """Return the figures that are numbers in some pair."""
        found = dict.fromkeys(name for run in self.a for name in run.figures)
        return [name for name in found if len(self.figures(name)[0])]


def pairs_of(a: Sequence[TableRun], b: Sequence[TableRun]) -> RunPairs:
    """Return the pairs; ComparisonError where A and B have none.

    What is compared is every name without a common value, which must have one value on each side.
    """
    texts_a, texts_b = ([_texts(run.values) for run in side] for side in (a, b))
    names = sorted({name for texts in (*texts_a, *texts_b) for name in texts})
    compared = []
    for name in names:
        of_a, of_b = ({texts.get(name, "-") for texts in side} for side in (texts_a, texts_b))
        if of_a & of_b:
            continue
        if len(of_a) > 1 or len(of_b) > 1:
            raise ComparisonError(
                f"A and B have no value of {name} in common, and several of it: choose one with FILE:{name}=VALUE"
            )
        compared.append((name, of_a.pop(), of_b.pop()))
    rest = [name for name in names if name not in {one[0] for one in compared}]
    sides = [_by_key(a, texts_a, rest, "A"), _by_key(b, texts_b, rest, "B")]
    common = [key for key in sides[0] if key in sides[1]]
    if not common:
        raise ComparisonError(
            "A and B have no pair of runs that agree in all but what is compared: make both by one sweep"
        )
    whole = [key for key in common if not (sides[0][key].error or sides[1][key].error)]
    alone = sum(len(side) - len(common) for side in sides)
    one, other = (tuple(side[key] for key in whole) for side in sides)
    return RunPairs(one, other, tuple(compared), alone, len(common) - len(whole))


def _texts(values: Mapping[str, Any]) -> dict[str, str]:
    return {name: value if isinstance(value, str) else json.dumps(value) for name, value in values.items()}


def _by_key(
    runs: Sequence[TableRun], texts: Sequence[Mapping[str, str]], names: Sequence[str], side: str
) -> dict[Key, TableRun]:
    """Return the runs by the values of the names; ComparisonError where two runs have the same."""
    found: dict[Key, list[TableRun]] = defaultdict(list)
    for run, of_run in zip(runs, texts, strict=True):
        found[tuple(of_run.get(name, "-") for name in names)].append(run)
    if any(len(same) > 1 for same in found.values()):
        raise ComparisonError(f"{side} has several runs for one of the other side: choose with FILE:NAME=VALUE")
    return {key: same[0] for key, same in found.items()}
