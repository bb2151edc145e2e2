"""The report's rules on a table of errors: optimum of each gain from its own half, their plain mean, the trend.

A table has two halves; `errors_m[half]` is (values, tests), NaN for a run that did not come to its end.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from wallride.sim.lab.report.published import ERRORS_M, FIXED, GAINS, Half, Pair, repeatability_m
from wallride.sim.lab.report.published import TESTS as PUBLISHED_TESTS
from wallride.sim.world.pose import Floats


@dataclass(frozen=True, slots=True, eq=False)
class GainTable:
    """Pairs and errors of one law. A half is missing where its gain is fixed by a setting."""

    tests: tuple[str, ...]
    pairs: Mapping[Half, Sequence[Pair]]
    errors_m: Mapping[Half, Floats]

    def varied(self, half: Half) -> list[float]:
        """Return the values of the gain that a half varies."""
        return [pair[0 if half == "kp" else 1] for pair in self.pairs[half]]

    def optimum(self, half: Half, test: str) -> float | None:
        """Return the varied gain with the least error, None where no run came to its end or the gain is fixed."""
        if half not in self.pairs:
            return None
        column = self.errors_m[half][:, self.tests.index(test)]
        return None if np.isnan(column).all() else self.varied(half)[int(np.nanargmin(column))]

    def optima(self) -> dict[str, tuple[float | None, float | None]]:
        """Return Kp and Kd of each test, each from its own half."""
        return {test: (self.optimum("kp", test), self.optimum("kd", test)) for test in self.tests}

    def average(self) -> tuple[float | None, float | None]:
        """Return the plain mean of the optima, as the report takes it."""
        found = [[gain for gain in column if gain is not None] for column in zip(*self.optima().values(), strict=True)]
        kp, kd = (round(float(np.mean(some)), 3) if some else None for some in found)
        return kp, kd


def published_table(tests: Sequence[str] = PUBLISHED_TESTS) -> GainTable:
    """Return the report's own table, of some of its tests."""
    columns = [PUBLISHED_TESTS.index(test) for test in tests]
    pairs: dict[Half, Sequence[Pair]] = {
        "kd": [(FIXED["kd"], kd) for kd in GAINS], "kp": [(kp, FIXED["kp"]) for kp in GAINS]
    }  # fmt: skip
    return GainTable(tuple(tests), pairs, {half: table[:, columns] for half, table in ERRORS_M.items()})


@dataclass(frozen=True, slots=True)
class Trend:
    """Course of the error over a rising gain: "flat", "falls", "rises" or "least", and where it is least."""

    kind: str
    least_at: float

    def text(self) -> str:
        """Return it in words."""
        return f"least at {self.least_at:g}" if self.kind == "least" else self.kind

    def agrees(self, other: "Trend", step: float) -> bool:
        """Return whether both say the same, the least error within one step of the gain."""
        if "flat" in {self.kind, other.kind}:
            return self.kind == other.kind
        return abs(self.least_at - other.least_at) <= step + 1e-9


def trend(gains: Sequence[float], errors_m: Floats, within_m: float) -> Trend | None:
    """Return the trend of a column; None with fewer than two errors. within_m: a smaller spread is flat."""
    known = np.flatnonzero(np.isfinite(errors_m))
    if known.size < 2:
        return None
    some = errors_m[known]
    least = int(np.argmin(some))
    kind = "least"
    if float(some.max() - some.min()) <= within_m:
        kind = "flat"
    elif least in {0, known.size - 1}:
        kind = "falls" if least else "rises"
    return Trend(kind, gains[int(known[least])])


@dataclass(frozen=True, slots=True)
class Likeness:
    """Sixty errors beside the report's. within: how many differ by no more than the report's own repeatability."""

    count: int
    compared: int
    within: int
    median_difference_m: float
    median_ratio: float


def likeness(table: GainTable) -> Likeness:
    """Return how like the report's a table of its pairs is, over the runs that came to their end."""
    theirs = published_table(table.tests)
    ours_m = np.concatenate([table.errors_m[half] for half in theirs.pairs])
    theirs_m = np.concatenate([theirs.errors_m[half] for half in theirs.pairs])
    allowed_m = np.array([repeatability_m(test) for test in table.tests])
    known = np.isfinite(ours_m)
    difference_m = np.abs(ours_m - theirs_m)
    return Likeness(
        ours_m.size,
        int(known.sum()),
        int((known & (difference_m <= allowed_m + 1e-9)).sum()),
        float(np.nanmedian(difference_m)) if known.any() else np.nan,
        float(np.nanmedian(ours_m / theirs_m)) if known.any() else np.nan,
    )
