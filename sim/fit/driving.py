"""Drive of a real car: delay and ramp of the motor command, gain of the reported speed, and the grip that was used."""

from dataclasses import dataclass, replace

import numpy as np

from wallride.runtime.calibration.responses import (
    INTERVAL,
    CommandSteps,
    Estimate,
    ResponseFit,
    Samples,
    fit_response,
    unidentified,
)
from wallride.runtime.calibration.scan_motion import MAX_GAP_S
from wallride.runtime.control.vehicle import GRAVITY_MPS2
from wallride.sim.fit.drive import RecordedDrive
from wallride.sim.recordings import OdometryTrack

MIN_SPEED_MPS = 0.3
MIN_SPEED_ROWS = 40
MOMENT_S = 1e-3
MIN_SPEED_STD_MPS = 0.15
MAX_DELAY_WIDTH_S = 0.06
DELAYS_S = tuple(0.0025 * k for k in range(121))
RAMPS_MPS2 = (0.5, 0.75, 1.0, 1.5, 2.0, 2.5, 3.0, 3.5, 4.0, 4.5, 5.0, 5.4, 6.0, 7.0, 8.0, 10.0, 15.0, 25.0)
NO_COMMANDS = "the recording has no commands"
NO_ODOMETRY = "the recording has no odometry"


@dataclass(frozen=True, slots=True)
class DriveFit:
    """Result for the drive.

    delay_s, ramp_mps2: of the motor command. speed_gain: true speed over reported speed. used_mu: the greatest share of
    gravity that the car used sideways, a lower bound of the floor's friction.
    """

    delay_s: Estimate
    ramp_mps2: Estimate
    speed_gain: Estimate
    used_mu: float


def fit_drive(drive: RecordedDrive) -> DriveFit:
    """Return the drive's fit."""
    motion = drive.motion
    aside_mps2 = np.abs(motion.yaw_rate_radps * drive.speed_mps)
    aside_mps2 = aside_mps2[np.isfinite(aside_mps2)]
    used_mu = float(np.percentile(aside_mps2, 99)) / GRAVITY_MPS2 if aside_mps2.size else 0.0
    delay_s, ramp_mps2 = _response(drive)
    return DriveFit(delay_s, ramp_mps2, _speed_gain(drive), used_mu)


def _response(drive: RecordedDrive) -> tuple[Estimate, Estimate]:
    """Return delay and ramp."""
    if drive.command is None:
        none = unidentified(NO_COMMANDS)
        return none, none
    if drive.odometry is None:
        none = unidentified(NO_ODOMETRY)
        return none, none
    samples, step = _samples(drive.odometry), CommandSteps(drive.command.received_s, drive.command.speed_mps)
    if float(np.std(step.at(samples.from_s))) < MIN_SPEED_STD_MPS:
        none = unidentified("the speed hardly changed: record starts, not only the drive")
        return none, none
    fit = fit_response(step, samples, DELAYS_S, RAMPS_MPS2)
    if fit is None:
        none = unidentified("fewer than 3 s in which the speed is known")
        return none, none
    return _delay(fit), _ramp(fit)


def _samples(odometry: OdometryTrack) -> Samples:
    """Return the speeds by odometry, each of a moment."""
    at_s = odometry.received_s
    before_s = np.diff(at_s, prepend=at_s[0])
    good = (before_s > 0) & (before_s < MAX_GAP_S)
    return Samples(at_s[good] - MOMENT_S, at_s[good], odometry.vx_mps[good], np.ones(np.count_nonzero(good)))


def _speed_gain(drive: RecordedDrive) -> Estimate:
    """Return the scans' speed over the odometry's; the scans say too little in a bare corridor."""
    if drive.odometry is None:
        return unidentified(NO_ODOMETRY)
    good = np.abs(drive.speed_mps) > MIN_SPEED_MPS
    if np.count_nonzero(good) < MIN_SPEED_ROWS:
        return unidentified("the car hardly drove")
    ratio = drive.motion.forward_mps[good] / drive.speed_mps[good]
    drawn = np.median(np.random.default_rng(0).choice(ratio, (200, ratio.size)), axis=1)
    low, high = np.percentile(drawn, INTERVAL)
    return Estimate(float(np.median(ratio)), float(low), float(high))


def _delay(fit: ResponseFit) -> Estimate:
    found = fit.delay_s
    if found.high - found.low > MAX_DELAY_WIDTH_S:
        return replace(found, why=f"between {found.low:.3f} and {found.high:.3f} s; it needs more starts")
    return found


def _ramp(fit: ResponseFit) -> Estimate:
    if fit.rate.high >= RAMPS_MPS2[-1]:
        return replace(fit.rate, why=f"at least {fit.rate.low:g} m/s2")
    return fit.rate
