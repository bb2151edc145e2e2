"""Difference of two means over pairs of runs, with a bootstrap interval.

Studentized bootstrap of the paired differences d (Efron and Tibshirani 1993, section 12.5): with t* = (mean(d*) -
mean(d)) / se(d*) over resampled pairs, the interval is mean(d) - t*_high se(d) to mean(d) - t*_low se(d). It keeps its
level for skewed differences, too, where the percentile interval is too narrow.

B is told from A where that interval does not hold 0 and a sign-flip test agrees: were A and B the same, each d could as
well have the other sign, so the share of random signs with a mean as far from 0 is exact for any distribution.
"""

import math
from dataclasses import dataclass

import numpy as np

from wallride.sim.world.pose import Floats

CONFIDENCE = 0.99
RESAMPLES, FLIPS = 4000, 10_000
MIN_PAIRS = 8
"""Fewer pairs say nothing: with seven, 2 of the 128 choices of signs are the farthest, more than 1 %."""
_AT_ONCE = 500


@dataclass(frozen=True, slots=True)
class PairedDifference:
    """Means of A and B over `pairs` pairs, and of B - A with its interval; NaN where there are too few.

    is_told: whether the pairs tell B from A. p: of the sign-flip test.
    """

    pairs: int
    mean_a: float
    mean_b: float
    difference: float
    low: float
    high: float
    p: float
    is_told: bool

    def relative(self, value: float) -> float:
        """Return a difference as a share of the mean of A; NaN where that is 0."""
        return value / abs(self.mean_a) if self.mean_a else math.nan


def paired_difference(a: Floats, b: Floats, confidence: float = CONFIDENCE, seed: int = 0) -> PairedDifference:
    """Return the difference of two figures, (n,) each, value i of both from the same pair."""
    difference = b - a
    count = len(difference)
    if count < MIN_PAIRS:
        mean_a, mean_b = (float(one.mean()) if count else math.nan for one in (a, b))
        return PairedDifference(count, mean_a, mean_b, mean_b - mean_a, math.nan, math.nan, 1.0, is_told=False)
    random = np.random.default_rng(seed)
    low, high = _interval(difference, confidence, random)
    p = _sign_flip_p(difference, random)
    told = (low > 0 or high < 0) and p <= 1 - confidence
    return PairedDifference(
        count, float(a.mean()), float(b.mean()), float(difference.mean()), low, high, p, is_told=told
    )


def _sign_flip_p(difference: Floats, random: np.random.Generator) -> float:
    """Return the share of random signs whose mean is at least as far from 0."""
    far = abs(float(difference.sum())) - 1e-12 * float(np.abs(difference).sum())
    hits = 0
    for _ in range(FLIPS // _AT_ONCE):
        signs = random.integers(0, 2, (_AT_ONCE, len(difference))) * 2 - 1
        hits += int((np.abs(signs @ difference) >= far).sum())
    return (1 + hits) / (1 + FLIPS)


def _interval(difference: Floats, confidence: float, random: np.random.Generator) -> tuple[float, float]:
    count = len(difference)
    mean = float(difference.mean())
    error = float(difference.std(ddof=1)) / math.sqrt(count)
    if error <= 1e-12 * max(1.0, abs(mean)):  # every pair says the same
        return mean, mean
    ratios = np.concatenate([_ratios(difference, mean, random) for _ in range(RESAMPLES // _AT_ONCE)])
    low, high = np.quantile(ratios, [(1 - confidence) / 2, (1 + confidence) / 2])
    return float(mean - high * error), float(mean - low * error)


def _ratios(difference: Floats, mean: float, random: np.random.Generator) -> Floats:
    """Return t* of some resamples; one without any spread is as extreme as its mean says."""
    count = len(difference)
    drawn = difference[random.integers(0, count, (_AT_ONCE, count))]
    error = drawn.std(axis=1, ddof=1) / math.sqrt(count)
    off = drawn.mean(axis=1) - mean
    with np.errstate(divide="ignore", invalid="ignore"):
        ratios = np.where(error > 0, off / error, np.sign(off) * np.inf)
    return np.asarray(np.nan_to_num(ratios, nan=0.0))
