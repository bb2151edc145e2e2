"""From the ball's path to a steering angle, wall on the left.

    steering = kd (approach(e) + a) - kd phi_c + atan(L c) - trim

    e: distance error. a: heading of the path beside the car, so the wanted heading is a + approach(e).
    phi_c = asin(c l / 2) - c v^2 * SLIP: what a seems to be on an arc of curvature c that is driven without any error.

The shortest way back to a line for a car with a tightest arc 1/c is that arc, then the opposite one, tangent to the
line (Dubins 1957). At distance e the second arc has the heading acos(1 - c |e|): steering hard until the car heads so,
and as hard the other way from there on, is what the optimum of `sim.lab.limit` does as well. `approach` is that
heading; near the line, where its slope would be infinite, it is the straight kp e / kd (a square-root controller, as
PX4 and ArduPilot call it).

Gains are those at 1 m/s. A heading error decays within L / (v kd), a small distance error within kd / (v kp): a faster
car is given the same 0.07 s and 0.33 s by kd / v and kp / v^2.

Without the two terms of the curvature c, a car that drives a bend perfectly would be told to turn by kd phi_c instead
of atan(L c) (kinematic single-track model): it cuts slow bends by 2 to 5 cm and, as its tyres slip, drifts out of fast
ones. The slip of the rear axle is a / (mu g C) with lateral acceleration a = c v^2 (linear tyre, C = 5.46 per rad of
f1tenth_gym); SLIP is that for mu = 0.5, the low guess: better a little to the inside on a good floor.
"""

import math

from drivers.value import value
from runtime.control.ball_path import WIDEST_RAD

SLOW_MPS = 1.0
"""At this speed and below, the gains are what the settings say."""
ARC_M = 0.933
ARC_S = 0.45
"""The approach's arc has the radius ARC_M + ARC_S v: the tightest one, and the way on which the servo slews from one
stop to the other (0.21 s) and the tyres follow."""
STEEPEST_RAD = 1.4
CORNER_LOOK_M = 0.95
CORNER_LOOK_S = 0.185
"""A corner away from the wall is looked for this far ahead: a car that turns as sharply as it can (0.933 m) has to
begin that far before the kink. Sooner costs error in the corner, later costs room on a slippery floor."""
CORNER_AT_LEAST_RAD = 0.05
"""What noise may fake between the two look-aheads."""
STRAIGHT_RAD, NOT_STRAIGHT_RAD = 0.06, 0.12
STRAIGHT_PER_M, BENT_PER_M = 0.05, 0.1
"""The wall's line is steered by where the ball is seen so near to it and its path so straight; beyond, by the ball."""
SMOOTH_BELOW_PER_M = 0.3
KINKED_ABOVE_PER_M = 0.6
"""A path that turns away from the wall more sharply is a kink, not a bend: nothing to be fed forward."""
TIGHTEST_PER_M = 1.0 / ARC_M
"""A ball smaller than the car's own tightest arc turns more sharply round a corner than the car can. Were all of that
fed forward, the car would swing out before the corner, by 0.3 m round one at 0.6 m, and miss it."""
SLIP_S2_PER_M = 0.037


@value()
class Aim:
    """What the law steers by. straight: how far the wall beside and ahead is one straight line, 0 to 1."""

    error_m: float
    heading_rad: float
    straight: float


def look_aheads_m(look_ahead_m: float, look_ahead_s: float, speed_mps: float) -> tuple[float, float]:
    """Return the distances at which the law wants to know the ball: for the law itself, and for corners."""
    return look_ahead_m + look_ahead_s * abs(speed_mps), CORNER_LOOK_M + CORNER_LOOK_S * abs(speed_mps)


def pursued(
    near_m: float,
    near_rad: float,
    far_m: float,
    far_rad: float,
    error_m: float,
    line_rad: float,
    line_error_m: float,
    mean_bend_per_m: float,
    bend_per_m: float,
    speed_mps: float,
    kp: float,
    kd: float,
    wheelbase_m: float,
) -> tuple[float, float, float, float]:
    """Return error_m, heading_rad and straight of the Aim, and the steering angle for it.

    The first eight arguments are those of `ball_aim`. bend_per_m: of this scan's path.
    """
    aim = ball_aim(near_m, near_rad, far_m, far_rad, error_m, line_rad, line_error_m, mean_bend_per_m)
    steering_rad = steering_for_rad(aim, speed_mps, kp, kd)
    if aim.straight < 1.0:
        steering_rad += (1.0 - aim.straight) * bend_correction_rad(bend_per_m, near_m, speed_mps, kd, wheelbase_m)
    return aim.error_m, aim.heading_rad, aim.straight, steering_rad


def ball_aim(
    near_m: float,
    near_rad: float,
    far_m: float,
    far_rad: float,
    error_m: float,
    line_rad: float,
    line_error_m: float,
    bend_per_m: float,
) -> Aim:
    """Return what to steer by.

    near, far: the ball on the two circles of `look_aheads_m`. error_m: of the nearest point. line_rad, line_error_m:
    the tracked line's heading, NaN where none is tracked, and the error by it. bend_per_m: of the path, over time.

    Beside a straight wall the ball lies at asin(e/l) to the path's heading, less far aside the farther one looks. If it
    lies more to the free side than that at the long look-ahead, then a corner is coming, and the path turns with it.
    """
    heading_rad = near_rad - _asin(error_m / near_m)
    straight = 0.0
    if not math.isnan(line_rad):
        expected_rad = min(max(line_rad + _asin(line_error_m / near_m), -WIDEST_RAD), WIDEST_RAD)
        straight = _fading(abs(near_rad - expected_rad), STRAIGHT_RAD, NOT_STRAIGHT_RAD)
        straight *= _fading(abs(bend_per_m), STRAIGHT_PER_M, BENT_PER_M)
        error_m += straight * (line_error_m - error_m)
        heading_rad += straight * (line_rad - heading_rad)
    corner_rad = far_rad - _asin(error_m / far_m) + CORNER_AT_LEAST_RAD
    return Aim(error_m, min(heading_rad, corner_rad), straight)


def approach_rad(error_m: float, speed_mps: float, slope_per_m: float) -> float:
    """Return the heading to the path at which it is approached: a straight, then an arc's acos(1 - c |e|)."""
    bend_per_m = 1.0 / (ARC_M + ARC_S * abs(speed_mps))
    size_m = abs(error_m)
    # The arc's heading h grows by c / sin(h) per metre: the straight ends where it is no steeper than that.
    joint_rad = math.asin(min(bend_per_m / slope_per_m, 1.0)) if slope_per_m > 0 else math.inf
    wanted_rad = slope_per_m * size_m
    if wanted_rad > joint_rad:
        cos = math.cos(joint_rad) - bend_per_m * (size_m - joint_rad / slope_per_m)
        wanted_rad = math.acos(max(cos, -1.0))
    return math.copysign(min(wanted_rad, STEEPEST_RAD), error_m)


def steering_for_rad(aim: Aim, speed_mps: float, kp: float, kd: float) -> float:
    """Return kd (approach(e) + a), with the gains for this speed."""
    slower = SLOW_MPS / max(abs(speed_mps), SLOW_MPS)
    slope_per_m = slower * kp / max(kd, 1e-6)
    return slower * kd * (approach_rad(aim.error_m, speed_mps, slope_per_m) + aim.heading_rad)


def bend_correction_rad(bend_per_m: float, look_m: float, speed_mps: float, kd: float, wheelbase_m: float) -> float:
    """Return atan(L c) - kd phi_c, for the smooth part of the curvature that a car can drive."""
    share = (bend_per_m + KINKED_ABOVE_PER_M) / (KINKED_ABOVE_PER_M - SMOOTH_BELOW_PER_M)
    curvature = min(bend_per_m * min(max(share, 0.0), 1.0), TIGHTEST_PER_M)
    on_arc_rad = _asin(curvature * look_m / 2) - SLIP_S2_PER_M * speed_mps * speed_mps * curvature
    slower = SLOW_MPS / max(abs(speed_mps), SLOW_MPS)
    return math.atan(wheelbase_m * curvature) - slower * kd * on_arc_rad


def _fading(value: float, whole_below: float, none_above: float) -> float:
    return min(max((none_above - value) / (none_above - whole_below), 0.0), 1.0)


def _asin(sine: float) -> float:
    """Return the angle; beyond what a triangle allows, that of the last one that exists."""
    return math.asin(min(max(sine, -1.0), 1.0))
