"""Deceleration of a stop, by the scans: wheels that lock report 0 while the car still slides."""

from collections.abc import Sequence

import numpy as np

from wallride.runtime.calibration.delays import middle_of_sweep_s
from wallride.runtime.calibration.responses import Estimate, unidentified
from wallride.runtime.calibration.scan_motion import motion_of_scans
from wallride.runtime.calibration.stop_match import MAX_RANGE_M
from wallride.runtime.calibration.trace import STANDS_BELOW_MPS, Trace
from wallride.runtime.control.perception.geometry import Booleans, Floats

MIN_SPEED_MPS = 0.6
STEADY_S = 0.3
"""Time before a stop in which the speed is taken to be steady."""
STANDS_AFTER_S, LONGEST_S = 0.6, 3.0
"""Least and greatest time of a stop."""
MAX_DECELERATION_MPS2 = 15.0
MIN_STOPS = 2


def fit_braking(trace: Trace, delay_s: float, ignored: Booleans | None = None) -> Estimate:
    """Return the mean deceleration [m/s2] of the stops in a drive; delay_s: of the motor.

    Way from the command to the standstill: v t + v^2 / (2 a).
    """
    found = [value for at_s in stops_from_speed(trace) if (value := _deceleration(trace, at_s, delay_s, ignored))]
    if len(found) < MIN_STOPS:
        return unidentified(f"{len(found)} stops from {MIN_SPEED_MPS} m/s; it needs {MIN_STOPS}")
    return _estimate(found)


def stops_from_speed(trace: Trace) -> list[float]:
    """Return the times of commands to stop that came while the car drove steadily."""
    at: list[float] = []
    for k in np.flatnonzero((trace.asked_mps[1:] == 0.0) & (np.abs(trace.asked_mps[:-1]) > MIN_SPEED_MPS)):
        at_s = float(trace.command_s[k + 1])
        before = (trace.motor_s > at_s - STEADY_S) & (trace.motor_s < at_s)
        if before.any() and np.abs(trace.speed_mps[before]).min() > MIN_SPEED_MPS:
            at.append(at_s)
    return at


def _deceleration(trace: Trace, at_s: float, delay_s: float, ignored: Booleans | None) -> float | None:
    reported_s = trace.motor_s[(trace.motor_s > at_s) & (np.abs(trace.speed_mps) < STANDS_BELOW_MPS)]
    stands_s = max(at_s + STANDS_AFTER_S, float(reported_s.min(initial=at_s + LONGEST_S)))
    part = trace.between(at_s - STEADY_S, stands_s + 0.6)
    if len(part.scan_s) < 8:
        return None
    ranges_m = part.ranges_m if ignored is None else np.where(ignored, np.nan, part.ranges_m)
    times_s = middle_of_sweep_s(part)
    motion = motion_of_scans(times_s, ranges_m, part.kind, MAX_RANGE_M)
    along_m = _along(motion.x_m, motion.y_m)
    steady, stands = times_s < at_s + delay_s, times_s > stands_s
    if np.count_nonzero(steady) < 3 or not stands.any():
        return None
    speed_mps, begin_m = np.polyfit(times_s[steady] - at_s, along_m[steady], 1)
    way_m = float(np.median(along_m[stands]) - begin_m) - speed_mps * delay_s
    if speed_mps < MIN_SPEED_MPS or way_m < speed_mps**2 / (2 * MAX_DECELERATION_MPS2):
        return None
    return float(speed_mps**2 / (2 * way_m))


def _along(x_m: Floats, y_m: Floats) -> Floats:
    """Return the way along the straight line of the drive."""
    end = np.hypot(x_m[-1], y_m[-1])
    along: Floats = (x_m * x_m[-1] + y_m * y_m[-1]) / max(float(end), 1e-9)
    return along


def _estimate(found: Sequence[float]) -> Estimate:
    """Return the harmonic mean, since ways are what varies evenly, with the interval of the mean."""
    ways = 1.0 / np.array(found)
    std = float(np.std(ways, ddof=1) / np.sqrt(ways.size))
    mean = float(ways.mean())
    return Estimate(1.0 / mean, 1.0 / (mean + 2.0 * std), 1.0 / max(mean - 2.0 * std, 1e-3))
