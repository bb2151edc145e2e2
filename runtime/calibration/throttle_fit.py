"""Throttle pulses of a hobby ESC from ways at steady pulses: where it begins to drive, and the pulse for each m/s.

    pulse = forward + way * us_per_mps * speed        way: 1 where a longer pulse drives forward, else -1

A straight line through the forward ways; the backward ways, of the same slope, tell where it begins to drive backward.
Neutral is the middle of the two.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from wallride.runtime.calibration.responses import Estimate, unidentified
from wallride.runtime.calibration.trace import Trace
from wallride.runtime.control.perception.geometry import Floats

NORMAL_90 = 1.645
STEADY_SHARE = 0.5
"""Share of a way at its end on which the speed is steady."""
MIN_STATES = 5
MIN_SPREAD_MPS = 0.15
MIN_WAYS = 3
PULSE_STD_US = 1.0
"""Standard deviation of a pulse that no average undercuts: boards round to 4 us."""
MAX_SLOPE_STD = 0.15
"""Maximum share of the slope that its standard deviation may be."""


@dataclass(frozen=True, slots=True)
class PulseSpeed:
    """One way at a steady pulse [us], with the speed by the scans, negative backward."""

    pulse_us: float
    speed_mps: float


@dataclass(frozen=True, slots=True)
class ThrottleFit:
    """Pulses [us] of neutral, and where the car begins to drive forward and backward; us per m/s beyond them."""

    neutral_us: Estimate
    forward_us: Estimate
    reverse_us: Estimate
    us_per_mps: Estimate


def steady_mps(trace: Trace) -> float | None:
    """Return the speed at the end of a way, of its states; None where there are too few."""
    if len(trace.motor_s) < 2 * MIN_STATES:
        return None
    begin_s, end_s = float(trace.motor_s[0]), float(trace.motor_s[-1])
    late = trace.motor_s >= end_s - STEADY_SHARE * (end_s - begin_s)
    if np.count_nonzero(late) < MIN_STATES:
        return None
    return float(np.polyfit(trace.motor_s[late] - end_s, trace.distance_m[late], 1)[0])


def fit_throttle(ways: Sequence[PulseSpeed], way: float) -> ThrottleFit:
    """Return the line of these ways; an estimate that they do not identify says why."""
    forward = np.array([(one.speed_mps, one.pulse_us) for one in ways if one.speed_mps > 0]).reshape(-1, 2)
    back = np.array([(one.speed_mps, one.pulse_us) for one in ways if one.speed_mps < 0]).reshape(-1, 2)
    if len(forward) < MIN_WAYS or not len(back):
        return _nothing(f"{len(forward)} ways forward and {len(back)} backward; it needs {MIN_WAYS} and 1")
    if np.ptp(forward[:, 0]) < MIN_SPREAD_MPS:
        low_us, high_us = forward[:, 1].min(), forward[:, 1].max()
        return _nothing(
            f"{low_us:.0f} to {high_us:.0f} us drive alike, {forward[:, 0].mean():.2f} m/s: the ESC does not follow its"
            " pulse (motor.throttle_channel? a limit in the ESC?)"
        )
    slope, begin_us, slope_std, begin_std = _line(forward)
    if slope * way <= 0 or slope_std > MAX_SLOPE_STD * abs(slope):
        return _nothing("the speeds do not lie on a line over their pulses: charge the battery, and drive on one floor")
    backward_us = back[:, 1] - slope * back[:, 0]
    back_std = float(np.hypot(begin_std, np.std(backward_us) / np.sqrt(len(backward_us))))
    reverse_us = float(backward_us.mean())
    return ThrottleFit(
        _estimate((begin_us + reverse_us) / 2, float(np.hypot(begin_std, back_std)) / 2),
        _estimate(begin_us, begin_std), _estimate(reverse_us, back_std), _estimate(abs(slope), slope_std),
    )  # fmt: skip


def _line(points: Floats) -> tuple[float, float, float, float]:
    """Return slope and intercept of pulses over speeds, and their standard deviations."""
    speeds, pulses = points.T
    table = np.stack([speeds, np.ones(len(points))], axis=1)
    (slope, begin), *_ = np.linalg.lstsq(table, pulses, rcond=None)
    rms_us = np.sqrt(np.sum((pulses - table @ (slope, begin)) ** 2) / max(len(points) - 2, 1))
    std = np.sqrt(np.diag(np.linalg.inv(table.T @ table))) * max(float(rms_us), PULSE_STD_US)
    return float(slope), float(begin), float(std[0]), float(std[1])


def _estimate(value: float, std: float) -> Estimate:
    return Estimate(value, value - NORMAL_90 * std, value + NORMAL_90 * std)


def _nothing(why: str) -> ThrottleFit:
    none = unidentified(why)
    return ThrottleFit(none, none, none, none)
