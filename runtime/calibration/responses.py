"""Delay and rate of a command's effect: all pairs on a grid, a straight line for each, and a bootstrap over blocks.

A command takes effect after a delay, and then at most at a rate. For each pair (delay, rate) the response to the
recorded commands is computed, and the measurement is fitted as gain * response + offset. The best pair is the answer;
how far the best pair strays when blocks of a second are drawn anew with replacement is its uncertainty (Künsch 1989).
"""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import product

import numpy as np

from wallride.runtime.control.perception.geometry import Floats

GRID_S = 0.0025
BLOCK_S = 1.0
RESAMPLES = 200
INTERVAL = (5.0, 95.0)
OUTLIER_STDS = 4.0
MIN_BLOCKS = 3


@dataclass(frozen=True, slots=True)
class Estimate:
    """A value with its interval, 90 %; why: reason why it cannot be identified, "" where it is."""

    value: float
    low: float
    high: float
    why: str = ""

    def as_text(self, unit: str) -> str:
        """Return the value with its interval, or the reason for having none."""
        if self.why:
            return f"not identified: {self.why}"
        return f"{self.value:.4g} {unit} ({self.low:.4g} to {self.high:.4g})".replace(" )", ")")


def unidentified(why: str) -> Estimate:
    """Return an estimate without a value."""
    return Estimate(np.nan, np.nan, np.nan, why)


@dataclass(frozen=True, slots=True, eq=False)
class CommandSteps:
    """Commands over time, each in force until the next; both (n,)."""

    at_s: Floats
    value: Floats

    def at(self, times_s: Floats) -> Floats:
        """Return the command in force at these times; before the first one, that one."""
        return self.value[np.clip(np.searchsorted(self.at_s, times_s, side="right") - 1, 0, None)]


@dataclass(frozen=True, slots=True, eq=False)
class Samples:
    """Measurements, each the mean over an interval; all (n,). weight: inverse variance, relative."""

    from_s: Floats
    to_s: Floats
    value: Floats
    weight: Floats


@dataclass(frozen=True, slots=True, eq=False)
class ResponseFit:
    """The best line measurement = gain * response(delay, rate) + offset. rms: of its residuals, weighted."""

    delay_s: Estimate
    rate: Estimate
    gain: Estimate
    offset: Estimate
    rms: float


def responses(
    command: CommandSteps, delays_s: Floats, rates: Floats, samples: Samples
) -> tuple[list[tuple[float, float]], Floats]:
    """Return the pairs (delay, rate), and the mean response of each over every sample's interval, (pairs, n)."""
    times_s = np.arange(float(samples.from_s[0]) - 1.0 - delays_s.max(), float(samples.to_s[-1]) + GRID_S, GRID_S)
    wanted = command.at(times_s - GRID_S / 2)  # in the middle of each step: neither early nor late on average
    total = np.zeros((times_s.size, rates.size))
    now = np.full(rates.size, wanted[0])
    for k in range(1, times_s.size):
        moved = np.clip(wanted[k] - now, -rates * GRID_S, rates * GRID_S)
        total[k] = total[k - 1] + (now + moved / 2) * GRID_S
        now = now + moved
    elapsed_s = samples.to_s - samples.from_s
    mean = [  # the rate acts after the delay, so a longer delay only shifts the response
        (np.interp(samples.to_s - delay_s, times_s, of_rate) - np.interp(samples.from_s - delay_s, times_s, of_rate))
        / elapsed_s
        for delay_s in delays_s
        for of_rate in total.T
    ]
    return list(product(delays_s.tolist(), rates.tolist())), np.array(mean)


def fit_response(
    command: CommandSteps, samples: Samples, delays_s: Sequence[float], rates: Sequence[float], seed: int = 0
) -> ResponseFit | None:
    """Return the fit; None where there are less than three blocks of a second. Deterministic for a seed."""
    block = np.floor(samples.from_s / BLOCK_S).astype(np.intp)
    if np.unique(block).size < MIN_BLOCKS:
        return None
    pairs, response = responses(command, np.asarray(delays_s, float), np.asarray(rates, float), samples)
    weight = samples.weight.copy()
    for _ in range(3):  # without the outliers of the best pair
        best, gain, offset, _ = _lines(_sums(response, samples.value, weight[None])[0])
        residual = samples.value - gain[best] * response[best] - offset[best]
        std = np.sqrt(np.average(residual**2, weights=weight))
        weight = np.where(np.abs(residual) < OUTLIER_STDS * std, samples.weight, 0.0)
    sums = _sums(response, samples.value, weight * (block == np.unique(block)[:, None]))
    best, gain, offset, cost = _lines(sums.sum(axis=0))
    rng, found = np.random.default_rng(seed), []
    for _ in range(RESAMPLES):
        drawn = rng.multinomial(len(sums), np.full(len(sums), 1.0 / len(sums)))
        which, its_gain, its_offset, its_cost = _lines(np.tensordot(drawn, sums, axes=1))
        rate = pairs[which][1]
        found.append((_between(delays_s, its_cost, which), rate, its_gain[which], its_offset[which]))
    low, high = np.percentile(np.array(found), INTERVAL, axis=0)
    value = (_between(delays_s, cost, best), pairs[best][1], gain[best], offset[best])
    estimates = [Estimate(float(v), float(a), float(b)) for v, a, b in zip(value, low, high, strict=True)]
    delay, ramp, slope, shift = estimates
    return ResponseFit(delay, ramp, slope, shift, float(np.sqrt(max(cost[best], 0.0) / weight.sum())))


def _between(delays_s: Sequence[float], cost: Floats, best: int) -> float:
    """Return the delay of the least cost, by a parabola through the best pair's and both neighbours' of its rate."""
    of_rate = cost.reshape(len(delays_s), -1)[:, best % (cost.size // len(delays_s))]
    k = best // (cost.size // len(delays_s))
    if not 0 < k < len(delays_s) - 1:
        return delays_s[k]
    before, here, after = of_rate[k - 1 : k + 2]
    bend = before - 2 * here + after
    step_s = (delays_s[k + 1] - delays_s[k - 1]) / 2
    return delays_s[k] + float((before - after) / (2 * bend)) * step_s if bend > 0 else delays_s[k]


def _sums(response: Floats, value: Floats, weights: Floats) -> Floats:
    """Return the sums that a weighted line needs, for each row of weights (k, n) and each pair: (k, 6, pairs)."""
    ones, times_value = np.ones(len(response)), weights * value
    count, y, yy = (np.outer(one.sum(axis=1), ones) for one in (weights, times_value, times_value * value))
    sums = count, weights @ response.T, weights @ (response**2).T, times_value @ response.T, y, yy
    return np.stack(sums, axis=1)


def _lines(sums: Floats) -> tuple[int, Floats, Floats, Floats]:
    """Return the best pair, and gain, offset and cost of every pair's line, (pairs,)."""
    n, x, xx, xy, y, yy = sums
    spread = n * xx - x * x
    with np.errstate(invalid="ignore", divide="ignore"):
        gain = np.where(spread > 1e-12 * n * n, (n * xy - x * y) / spread, 0.0)
        offset = (y - gain * x) / n
    cost = yy - gain * xy - offset * y
    return int(np.nanargmin(cost)), gain, offset, cost
