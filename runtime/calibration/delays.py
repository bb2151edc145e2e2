"""Delays and rates of servo and motor, from quick changes of their commands at walking speed.

At up to about 0.5 m/s the tyres hardly slip, so that the yaw rate follows the wheels' angle at once.
"""

from dataclasses import dataclass, replace

import numpy as np

from wallride.runtime.calibration.responses import (
    CommandSteps,
    Estimate,
    ResponseFit,
    Samples,
    fit_response,
    unidentified,
)
from wallride.runtime.calibration.scan_motion import MAX_GAP_S, follow_each_other, motion_of_scans
from wallride.runtime.calibration.stop_match import MAX_RANGE_M
from wallride.runtime.calibration.trace import Trace
from wallride.runtime.control.perception.geometry import Booleans, Floats

MIN_SPEED_MPS = 0.25
MAX_ANGLE_RAD = 0.6
MOMENT_S = 1e-3
DELAYS_S = tuple(0.0025 * k for k in range(101))
SERVO_RATES_RADPS = (0.75, 1.0, 1.25, 1.5, 1.75, 2.0, 2.25, 2.5, 2.75, 3.0, 3.2, 3.5, 4.0, 5.0, 6.0, 8.0, 12.0)
RAMPS_MPS2 = (0.5, 0.75, 1.0, 1.5, 2.0, 2.5, 3.0, 3.5, 4.0, 4.5, 5.0, 5.4, 6.0, 7.0, 8.0, 10.0, 15.0, 25.0)
MAX_DELAY_WIDTH_S = 0.02
MIN_STEERING_STD_RAD, MIN_SPEED_STD_MPS = 0.03, 0.05
FEW = "fewer than 3 s of driving"


@dataclass(frozen=True, slots=True)
class DelayFit:
    """delay_s: from the command on the wire to the beginning of its effect. rate: of the effect, per second."""

    delay_s: Estimate
    rate: Estimate


@dataclass(frozen=True, slots=True)
class KnownMotion:
    """What is known of the drive.

    wheelbase_m, speed_factor: as the arcs gave them. rate_radps: commands change no faster, so a faster servo looks
    the same. ignored: (beams,), beams that see the car itself.
    """

    wheelbase_m: float
    speed_factor: float
    rate_radps: float
    ignored: Booleans | None = None


def fit_servo(trace: Trace, known: KnownMotion) -> DelayFit:
    """Return delay and rate [rad/s] of the servo. trace: driving, with quick changes of the steering."""
    samples = _angles(trace, known)
    steps = CommandSteps(trace.command_s, trace.asked_rad)
    if samples is None or float(np.std(steps.at(samples.from_s))) < MIN_STEERING_STD_RAD:
        return _without("the steering hardly moved while the car drove")
    rates = [*(rate for rate in SERVO_RATES_RADPS if rate < known.rate_radps), known.rate_radps]
    return _fit(fit_response(steps, samples, DELAYS_S, rates), known.rate_radps)


def fit_motor(trace: Trace) -> DelayFit:
    """Return delay and ramp [m/s2] of the motor, from the speeds that it reports while it does not stand."""
    before_s = np.diff(trace.motor_s, prepend=trace.motor_s[:1])
    good = (before_s > 0) & (before_s < MAX_GAP_S) & (np.abs(trace.speed_mps) > MIN_SPEED_MPS / 2)
    if np.count_nonzero(good) < 2:
        return _without(FEW)
    at_s = trace.motor_s[good]
    samples = Samples(at_s - MOMENT_S, at_s, trace.speed_mps[good], np.ones(at_s.size))
    steps = CommandSteps(trace.command_s, trace.asked_mps)
    if float(np.std(steps.at(samples.from_s))) < MIN_SPEED_STD_MPS:
        return _without("the speed hardly changed")
    return _fit(fit_response(steps, samples, DELAYS_S, RAMPS_MPS2), RAMPS_MPS2[-1])


def _fit(fit: ResponseFit | None, fastest: float) -> DelayFit:
    if fit is None:
        return _without(FEW)
    delay_s, rate = fit.delay_s, fit.rate
    if delay_s.high - delay_s.low > MAX_DELAY_WIDTH_S:
        delay_s = replace(delay_s, why=f"between {delay_s.low:.3f} and {delay_s.high:.3f} s; drive more changes")
    if rate.high >= fastest:
        rate = replace(rate, why=f"at least {rate.low:g}; no change was large enough to show more")
    return DelayFit(delay_s, rate)


def _without(why: str) -> DelayFit:
    none = unidentified(why)
    return DelayFit(none, none)


def _angles(trace: Trace, known: KnownMotion) -> Samples | None:
    """Return the wheels' angles that the scans' yaw rates mean, while the car drives; None where it does not."""
    if len(trace.scan_s) < 2 or len(trace.motor_s) < 2:
        return None
    ranges_m = trace.ranges_m if known.ignored is None else np.where(known.ignored, np.nan, trace.ranges_m)
    at_s = middle_of_sweep_s(trace)
    motion = motion_of_scans(at_s, ranges_m, trace.kind, MAX_RANGE_M)
    elapsed_s = np.diff(at_s)
    speed_mps = known.speed_factor * np.interp((at_s[1:] + at_s[:-1]) / 2, trace.motor_s, trace.speed_mps)
    with np.errstate(invalid="ignore", divide="ignore"):
        angle_rad: Floats = np.arctan(np.diff(motion.yaw_rad) / elapsed_s * known.wheelbase_m / speed_mps)
    good = (np.abs(speed_mps) >= MIN_SPEED_MPS) & (np.abs(angle_rad) < MAX_ANGLE_RAD)  # NaN is neither
    good &= follow_each_other(elapsed_s)
    if np.count_nonzero(good) < 2:
        return None
    weight = speed_mps[good] ** 2
    return Samples(at_s[:-1][good], at_s[1:][good], angle_rad[good], weight / weight.mean())


def middle_of_sweep_s(trace: Trace) -> Floats:
    """Return the times of the scans' middle beams, (n,)."""
    return trace.scan_s - trace.sweep_s / 2
