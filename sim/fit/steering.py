"""Steering of a real car: delay and rate of the servo, trim, and the gain from the command to the wheels' angle.

    yaw rate = speed * tan(angle of the wheels) / wheelbase,    angle = gain * servo + trim

The angle follows from the scans' yaw rate. Wheelbase and gain act alike, so only their ratio is found, as the wheelbase
of a car whose gain is right.
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
from wallride.sim.car.vehicle import SpeedDemand, Vehicle, VehicleSettings
from wallride.sim.fit.drive import RecordedDrive
from wallride.sim.world.pose import Floats, Pose

MIN_SPEED_MPS = 0.3
MAX_ANGLE_RAD = 0.6
MIN_STEERING_STD_RAD = 0.02
MAX_DELAY_WIDTH_S = 0.04
MAX_RATE_SHARE = 0.95
DELAYS_S = tuple(0.0025 * k for k in range(101))
RATES_RADPS = (0.75, 1.0, 1.25, 1.5, 1.75, 2.0, 2.25, 2.5, 2.75, 3.0, 3.2, 3.5, 4.0, 5.0, 6.0, 8.0, 12.0)
STOOD_STILL = "the steering hardly moved while the car drove; record a drive with curves"
STEP_S = 0.0025
EXACT_DRIVE = VehicleSettings(drive_delay_s=0.0, speed_lag_s=0.01, ramp_mps2=50.0, drive_limit_mps2=50.0)
"""A car that has the recorded speed at once."""


@dataclass(frozen=True, slots=True)
class SteeringFit:
    """Result for the steering.

    delay_s, rate_radps: of the servo. trim_rad: left positive. wheelbase_m: for a gain of 1.
    rms_rad: of the angle that the fit leaves unexplained; assumed_rms_rad: the same of the assumed
    delay and rate.
    """

    delay_s: Estimate
    rate_radps: Estimate
    trim_rad: Estimate
    wheelbase_m: Estimate
    rms_rad: float
    assumed_rms_rad: float


def fit_steering(drive: RecordedDrive, wheelbase_m: float, assumed: tuple[float, float]) -> SteeringFit:
    """Return the steering's fit. wheelbase_m: as configured. assumed: delay and rate to compare with."""
    if drive.command is None:
        return _without("the recording has no commands")
    samples = _angles(drive, wheelbase_m)
    step = CommandSteps(drive.command.received_s, drive.command.steering_rad)
    if samples is None or float(np.std(step.at(samples.from_s))) < MIN_STEERING_STD_RAD:
        return _without(STOOD_STILL)
    fit = fit_response(step, samples, DELAYS_S, RATES_RADPS)
    like = fit_response(step, samples, assumed[:1], assumed[1:])
    if fit is None or like is None:
        return _without("fewer than 3 s of driving")
    again = _of_simulated_car(drive, step, samples, fit, wheelbase_m)
    lag_s = again.delay_s.value - fit.delay_s.value if again is not None else 0.0
    slip = again.gain.value if again is not None else 1.0
    found = fit.delay_s
    delay = Estimate(max(found.value - lag_s, 0.0), max(found.low - lag_s, 0.0), max(found.high - lag_s, 0.0))
    wheelbase = _wheelbase(fit.gain, wheelbase_m * slip)
    return SteeringFit(_delay(delay), _rate(fit), fit.offset, wheelbase, fit.rms, like.rms)


def _of_simulated_car(
    drive: RecordedDrive, step: CommandSteps, samples: Samples, fit: ResponseFit, wheelbase_m: float
) -> ResponseFit | None:
    """Return the same fit of the simulated car with this steering: what is not the servo's; see `yaw_lag`."""
    known = np.isfinite(drive.speed_mps)
    speed = CommandSteps(drive.motion.from_s[known], drive.speed_mps[known])
    delay_s, rate_radps = fit.delay_s.value, fit.rate.value
    simulated = simulated_angles(step, speed, samples, delay_s=delay_s, rate_radps=rate_radps, wheelbase_m=wheelbase_m)
    return fit_response(step, simulated, DELAYS_S, RATES_RADPS)


def _angles(drive: RecordedDrive, wheelbase_m: float) -> Samples | None:
    """Return the wheels' angles that the yaw rates mean; None where the car does not drive."""
    motion, speed_mps = drive.motion, drive.speed_mps
    with np.errstate(invalid="ignore", divide="ignore"):
        angle_rad = np.arctan(motion.yaw_rate_radps * wheelbase_m / speed_mps)
        good = (np.abs(speed_mps) >= MIN_SPEED_MPS) & (np.abs(angle_rad) < MAX_ANGLE_RAD)  # NaN is neither
    if np.count_nonzero(good) < 2:
        return None
    weight = speed_mps[good] ** 2
    return Samples(motion.from_s[good], motion.to_s[good], angle_rad[good], weight / weight.mean())


def _without(why: str) -> SteeringFit:
    none = unidentified(why)
    return SteeringFit(none, none, none, none, np.nan, np.nan)


def _delay(found: Estimate) -> Estimate:
    if found.high - found.low > MAX_DELAY_WIDTH_S:
        return replace(found, why=f"between {found.low:.3f} and {found.high:.3f} s; it needs quicker changes")
    return found


def _rate(fit: ResponseFit) -> Estimate:
    found = fit.rate
    if found.high >= MAX_RATE_SHARE * RATES_RADPS[-1]:
        return replace(found, why=f"at least {found.low:g} rad/s; no change was large enough to show more")
    return found


def _wheelbase(gain: Estimate, wheelbase_m: float) -> Estimate:
    if gain.low <= 0.1:
        return unidentified(STOOD_STILL)
    return Estimate(wheelbase_m / gain.value, wheelbase_m / gain.high, wheelbase_m / gain.low)


def simulated_angles(
    command: CommandSteps,
    speed: CommandSteps,
    samples: Samples,
    *,
    delay_s: float,
    rate_radps: float,
    wheelbase_m: float,
) -> Samples:
    """Return what `samples` would be of the simulated car with this steering. speed: the recorded one over time.

    A delay that is fitted to yaw rates contains what tyres and inertia add by themselves: 8 ms at 0.5 m/s, 35 ms at
    2.5 m/s. So the simulated car is given the fitted steering, drives the same commands at the same speeds, and is
    measured in the same way; what it needs longer than it was told, and turns less, is taken off (indirect inference,
    Gouriéroux, Monfort and Renault 1993).
    """
    steering = {"steering_delay_s": delay_s, "steering_rate_radps": rate_radps}
    car = Vehicle(EXACT_DRIVE.model_copy(update=steering), Pose(0.0, 0.0, 0.0))
    times_s = np.arange(float(samples.from_s[0]) - 1.0, float(samples.to_s[-1]) + STEP_S, STEP_S)
    wanted_rad, wanted_mps, yaw_rad = command.at(times_s), speed.at(times_s), np.zeros(times_s.size)
    demand = SpeedDemand(0.0)
    for k in range(times_s.size - 1):
        if demand.mps != wanted_mps[k]:
            demand = SpeedDemand(float(wanted_mps[k]))
        car.step(STEP_S, demand, float(wanted_rad[k]))
        yaw_rad[k + 1] = yaw_rad[k] + car.yaw_rate_radps * STEP_S
    turned_rad = np.interp(samples.to_s, times_s, yaw_rad) - np.interp(samples.from_s, times_s, yaw_rad)
    speed_mps = speed.at((samples.from_s + samples.to_s) / 2)
    angle_rad: Floats = np.arctan(turned_rad / (samples.to_s - samples.from_s) * wheelbase_m / speed_mps)
    return replace(samples, value=angle_rad)
