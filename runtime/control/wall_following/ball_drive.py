"""Steering and speed by a ball's path. Wall on the left."""

import math

from drivers.accelerated import accelerated
from runtime.control.wall_following.ball_law import pursuit_steering
from runtime.control.wall_following.speed_profile import fastest_mps, speed_limit_mps

TOO_NEAR_M = 0.05
SLIPPING_SHARE = 0.3
"""Share of the assumed grip that is used when the car is too near to the wall and still approaches it at full lock: the
floor may have less grip than assumed."""


@accelerated
def drive_along_ball(  # flat arguments, as the C wants them
    radius_m: tuple[float, ...],
    bearing_rad: tuple[float, ...],
    meets: tuple[bool, ...],
    crosses: tuple[bool, ...],
    error_m: float,
    line_rad: float,
    line_error_m: float,
    mean_bend_per_m: float,
    speed_mps: float,
    kp: float,
    kd: float,
    wheelbase_m: float,
    trim_rad: float,
    most_rad: float,
    wanted_mps: float,
    mu: float,
) -> tuple[float, float, float, float]:
    """Return the error, how far the wall is one straight line, the steering and the speed.

    The first four are those of a BallPath, whose last three circles are those of `look_aheads_m`; from error_m on the
    arguments are those of `pursuit_steering`. trim_rad: at which the wheels stand while the servo stands in the middle.
    most_rad: the steering's end. mu: the friction to count on, infinite where the path is not to limit the speed.
    """
    error_m, heading_rad, straight, steering_rad = pursuit_steering(
        radius_m, bearing_rad, crosses, error_m, line_rad, line_error_m, mean_bend_per_m, speed_mps, kp, kd, wheelbase_m
    )
    steering_rad = min(max(steering_rad - trim_rad, -most_rad), most_rad)
    if math.isinf(mu):
        return error_m, straight, steering_rad, wanted_mps
    if steering_rad <= -most_rad and error_m < -TOO_NEAR_M and heading_rad < 0.0:
        mu *= SLIPPING_SHARE
    now_mps = speed_limit_mps(steering_rad, wheelbase_m, mu)
    ahead_mps = fastest_mps(radius_m, bearing_rad, meets, crosses, speed_mps, mu)
    return error_m, straight, steering_rad, min(wanted_mps, now_mps, ahead_mps)
