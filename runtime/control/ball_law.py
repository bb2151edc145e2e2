"""From the ball's path to a steering angle, wall on the left.

    steering = kp e + kd (phi - phi_c) + atan(L c)            e: distance error, phi: bearing of the ball
    phi_c    = asin(c l / 2) - c v^2 * SLIP                   what phi is on an arc of curvature c without any error

Without the two terms of the curvature c, a car that drives a bend perfectly would be told to turn by kd phi_c instead
of atan(L c) (kinematic single-track model): it cuts slow bends by 2 to 5 cm and, as its tyres slip, drifts out of fast
ones. The slip of the rear axle is a / (mu g C) with lateral acceleration a = c v^2 (linear tyre, C = 5.46 per rad of
f1tenth_gym); SLIP is that for mu = 0.5, the low guess again: better a little to the inside on a good floor.
"""

import math

from runtime.control.ball_path import BallPath

CORNER_LOOK_M = 1.0
CORNER_LOOK_S = 0.1
"""A corner away from the wall is looked for this far ahead: a car that turns as sharply as it can (0.933 m) has to
begin that far before the kink; the shorter look-ahead alone turns in 0.3 m late and passes the kink 0.35 m outside."""
CORNER_AT_LEAST_RAD = 0.05
"""What noise may fake between the two look-aheads."""
SMOOTH_BELOW_PER_M = 0.3
KINKED_ABOVE_PER_M = 0.6
"""A path that turns away from the wall more sharply is a kink, not a bend: nothing to be fed forward."""
SLIP_S2_PER_M = 0.037


def look_aheads_m(look_ahead_m: float, look_ahead_s: float, speed_mps: float) -> tuple[float, float]:
    """Return the distances at which the law wants to know the ball: for the law itself, and for corners."""
    return look_ahead_m + look_ahead_s * abs(speed_mps), CORNER_LOOK_M + CORNER_LOOK_S * abs(speed_mps)


def ball_bearing_rad(path: BallPath, error_m: float) -> float:
    """Return phi; the last two circles of the path are those of `look_aheads_m`.

    Beside a straight wall the ball lies at asin(e/l) to the car's heading, less far aside the farther one looks. If it
    lies more to the free side than that at the long look-ahead, then a corner is coming, and phi turns with it now.
    """
    near_m, far_m = float(path.radius_m[-2]), float(path.radius_m[-1])
    near_rad, far_rad = float(path.bearing_rad[-2]), float(path.bearing_rad[-1])
    straight_rad = _asin(error_m / near_m) - _asin(error_m / far_m)
    return min(near_rad, far_rad + straight_rad + CORNER_AT_LEAST_RAD)


def bend_correction_rad(bend_per_m: float, look_m: float, speed_mps: float, kd: float, wheelbase_m: float) -> float:
    """Return atan(L c) - kd phi_c, for the smooth part of the curvature."""
    share = (bend_per_m + KINKED_ABOVE_PER_M) / (KINKED_ABOVE_PER_M - SMOOTH_BELOW_PER_M)
    curvature = bend_per_m * min(max(share, 0.0), 1.0)
    on_arc_rad = _asin(curvature * look_m / 2) - SLIP_S2_PER_M * speed_mps * speed_mps * curvature
    return math.atan(wheelbase_m * curvature) - kd * on_arc_rad


def _asin(sine: float) -> float:
    """Return the angle; beyond what a triangle allows, that of the last one that exists."""
    return math.asin(min(max(sine, -0.95), 0.95))
