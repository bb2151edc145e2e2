"""Speed, steering and the lidar's pose from arcs: what the wheels report against what the lidar saw between two stops.

A car whose motor reports the way s and whose servo stands still drives an arc:

    way = k s + slide,    curvature = tan(g * steering + offset) / wheelbase,    turn = way * curvature

The brake at the end locks the wheels, which then slide some millimetres unreported; ways of different lengths tell it.

The lidar, at (x, y, yaw) on the car, moves by X^-1 B X for a motion B of the rear axle (hand-eye calibration; for cars
with encoders: Censi, Franchi, Marchionni and Oriolo 2013). Weighted least squares over all arcs, Gauss-Newton, Huber.
Wheelbase and gain act nearly alike: one of them is taken as it was measured or configured.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from wallride.runtime.calibration.responses import Estimate, unidentified
from wallride.runtime.calibration.scan_motion import Shift
from wallride.runtime.calibration.stop_match import MeasuredShift
from wallride.runtime.control.perception.geometry import Floats

NORMAL_90 = 1.645
SLIP = 0.002
"""Standard deviation of a way on the floor over that of the wheels."""
HUBER_STDS = 2.5
ROUNDS = 30
MIN_ARCS = 4
INNER_SHARE, SHORT_SHARE = 0.7, 0.06
"""Share of the widest angle below which arcs are narrow; share by which the wheels may turn less than those say."""
MIN_TURN_RAD = 0.15
MAX_SPEED_STD, MAX_STEERING_STD, MAX_PLACE_STD_M, MAX_YAW_STD_RAD = 0.01, 0.02, 0.01, 0.006
SLIDE_STD_M = 0.01
PRIOR = np.diag([*[1e-3] * 6, SLIDE_STD_M**-2])
"""Information of the start values: what the arcs do not tell stays where it was."""
TOO_PLAIN = "the walls here do not tell how far the car went: turn it, or put boxes where it looks"
NO_BENDS = "no bends to both sides: drive arcs to the left and to the right"


@dataclass(frozen=True, slots=True)
class Arc:
    """One way between two stops. way_m, steering_rad: as the car reports them; lidar: as the scans show."""

    way_m: float
    steering_rad: float
    lidar: MeasuredShift


@dataclass(frozen=True, slots=True)
class AssumedCar:
    """Settings while the arcs were driven. ruler: the wheelbase was measured, so that the gain is fitted."""

    wheelbase_m: float
    lidar_x_m: float
    lidar_y_m: float = 0.0
    ruler: bool = False


@dataclass(frozen=True, slots=True)
class ArcFit:
    """speed_factor: true over reported way. steering_factor: true over commanded angle. wheelbase_m: effective one.

    offset_rad: wheel angle at a commanded 0. lidar_*: pose of the lidar in base_link; yaw left positive, in addition to
    the configured one. rms: of the residuals in standard deviations. arcs: how many were used.
    """

    speed_factor: Estimate
    steering_factor: Estimate
    wheelbase_m: Estimate
    offset_rad: Estimate
    lidar_x_m: Estimate
    lidar_y_m: Estimate
    lidar_yaw_rad: Estimate
    rms: float
    arcs: int


def within_ends(arcs: Sequence[Arc]) -> list[Arc]:
    """Return the arcs without those on which the wheels turned less than the narrower ones let expect.

    There the linkage was at its end, which has no part in gain and middle.
    """
    steering = np.array([math.tan(arc.steering_rad) for arc in arcs])
    curvature = np.array([arc.lidar.shift[2] / arc.way_m for arc in arcs])
    inner = np.abs(steering) < INNER_SHARE * np.abs(steering).max(initial=0.0)
    if np.count_nonzero(inner) < MIN_ARCS or not np.ptp(steering[inner]):
        return list(arcs)
    slope, middle = np.polyfit(steering[inner], curvature[inner], 1)
    expected = np.abs(slope * steering)
    followed = (curvature - middle) * np.sign(slope * steering)
    return [arc for k, arc in enumerate(arcs) if inner[k] or followed[k] > (1 - SHORT_SHARE) * expected[k]]


def fit_arcs(arcs: Sequence[Arc], assumed: AssumedCar) -> ArcFit:
    """Return the fit; values that the arcs do not identify say why."""
    if len(arcs) < MIN_ARCS:
        return _nothing(f"{len(arcs)} ways between stops; it needs {MIN_ARCS}")
    start = _start(arcs, assumed)
    values, covariance, rms = _solve(arcs, assumed, start)
    std = np.sqrt(np.maximum(np.diag(covariance), 0.0)) * max(1.0, rms)
    turns = [arc.lidar.shift[2] for arc in arcs]
    bends = max(turns) > MIN_TURN_RAD and min(turns) < -MIN_TURN_RAD
    limits = np.array(
        [MAX_SPEED_STD, MAX_STEERING_STD, MAX_STEERING_STD, MAX_PLACE_STD_M, MAX_PLACE_STD_M, MAX_YAW_STD_RAD]
    )
    reasons = ["" if std[k] <= limits[k] else TOO_PLAIN for k in range(6)]
    if not bends:
        reasons[1] = reasons[3] = reasons[4] = NO_BENDS
    found = [_estimate(float(values[k]), float(std[k]), reasons[k]) for k in range(6)]
    speed, steering, offset, x_m, y_m, yaw = found
    wheelbase = _estimate(assumed.wheelbase_m / float(values[1]), assumed.wheelbase_m * float(std[1]), reasons[1])
    return ArcFit(speed, steering, wheelbase, offset, x_m, y_m, yaw, rms, len(arcs))


def _estimate(value: float, std: float, why: str) -> Estimate:
    return Estimate(value, value - NORMAL_90 * std, value + NORMAL_90 * std, why)


def _nothing(why: str) -> ArcFit:
    none = unidentified(why)
    return ArcFit(none, none, none, none, none, none, none, math.nan, 0)


def _start(arcs: Sequence[Arc], assumed: AssumedCar) -> Floats:
    """Return start values: the signs of speed and steering are those of the measured motion."""
    forward = sum(arc.way_m * arc.lidar.shift[0] for arc in arcs)
    turned = sum(arc.lidar.shift[2] * arc.way_m * arc.steering_rad for arc in arcs)
    speed = math.copysign(1.0, forward)
    return np.array([speed, math.copysign(1.0, turned * speed), 0.0, assumed.lidar_x_m, assumed.lidar_y_m, 0.0, 0.0])


def _solve(arcs: Sequence[Arc], assumed: AssumedCar, start: Floats) -> tuple[Floats, Floats, float]:
    """Return values (7,), covariance (7, 7) and the residuals' rms in standard deviations."""
    measured = np.array([arc.lidar.shift for arc in arcs])
    std = np.array([arc.lidar.std for arc in arcs])
    slip_m = SLIP * np.abs([arc.way_m for arc in arcs])
    std[:, :2] = np.hypot(std[:, :2], slip_m[:, None])
    std[:, 2] = np.hypot(std[:, 2], SLIP * np.abs(measured[:, 2]))
    values = start.copy()
    slopes, weight, off = np.empty((0, 7)), np.empty(0), np.empty(0)
    for _ in range(ROUNDS):
        off = ((measured - _moved(arcs, values, assumed)) / std).ravel()
        slopes = np.stack([_slope(arcs, values, assumed, k) / std for k in range(7)], axis=-1).reshape(-1, 7)
        weight = 1.0 / np.maximum(1.0, np.abs(off) / HUBER_STDS)
        matrix = slopes.T @ (slopes * weight[:, None]) + PRIOR
        step = np.linalg.solve(matrix, slopes.T @ (weight * off) + PRIOR @ (start - values))
        values = values + step
        if np.abs(step).max() < 1e-9:
            break
    covariance = np.linalg.inv(slopes.T @ (slopes * weight[:, None]) + PRIOR)
    freedom = max(off.size - 7, 1)
    return values, np.asarray(covariance, np.float64), float(np.sqrt(np.sum(weight * off**2) / freedom))


def _slope(arcs: Sequence[Arc], values: Floats, assumed: AssumedCar, k: int) -> Floats:
    step = np.zeros(7)
    step[k] = 1e-5
    slope: Floats = (_moved(arcs, values + step, assumed) - _moved(arcs, values - step, assumed)) / 2e-5
    return slope


def _moved(arcs: Sequence[Arc], values: Floats, assumed: AssumedCar) -> Floats:
    """Return the motions of the lidar that these values mean, (arcs, 3)."""
    return np.array([lidar_shift(arc, values, assumed) for arc in arcs])


def lidar_shift(arc: Arc, values: Floats, assumed: AssumedCar) -> Shift:
    """Return the motion of the lidar on one arc. values: speed, steering, offset, lidar x, y, yaw, slide.

    The factor of the steering is one of the angle with a ruler's wheelbase, else one of the curvature.
    """
    speed, steering, offset_rad, x_m, y_m, yaw_rad, slide_m = values
    if assumed.ruler:
        curvature = math.tan(steering * arc.steering_rad + offset_rad) / assumed.wheelbase_m
    else:
        sign = math.copysign(1.0, steering)
        curvature = abs(steering) * math.tan(sign * arc.steering_rad + offset_rad) / assumed.wheelbase_m
    way_m = speed * arc.way_m + slide_m * math.copysign(1.0, speed * arc.way_m)
    turn_rad = way_m * curvature
    chord_m = way_m * np.sinc(turn_rad / math.tau)
    cos, sin = math.cos(turn_rad), math.sin(turn_rad)
    at_x = chord_m * math.cos(turn_rad / 2) + cos * x_m - sin * y_m - x_m
    at_y = chord_m * math.sin(turn_rad / 2) + sin * x_m + cos * y_m - y_m
    c, s = math.cos(yaw_rad), math.sin(yaw_rad)
    return float(c * at_x + s * at_y), float(c * at_y - s * at_x), float(turn_rad)
