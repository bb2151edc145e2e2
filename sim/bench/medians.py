"""Merge of several runs into one: the median of every number, wherever it stands. Pure."""

import statistics
from collections.abc import Mapping, Sequence
from typing import Any


def median_of(runs: Sequence[Any]) -> Any:  # noqa: ANN401 - whatever the runs are made of
    """Return one run with the medians of all; other values, and those that only some runs have, are the first run's.

    A boolean is that of most runs, half being no majority. Lists are taken place by place.
    """
    first = runs[0]
    if isinstance(first, bool):
        return sum(map(bool, runs)) * 2 > len(runs)
    if isinstance(first, int | float):
        return statistics.median(run for run in runs if isinstance(run, int | float))
    if isinstance(first, Mapping):
        return {key: median_of([run[key] for run in runs if isinstance(run, Mapping) and key in run]) for key in first}
    if isinstance(first, Sequence) and not isinstance(first, str):
        return [median_of(places) for places in zip(*runs, strict=False)]
    return first
