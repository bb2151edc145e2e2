"""Steering and speed by a ball's path. Wall on the left."""

import math
from typing import Any

from wallride.drivers.accelerated import accelerated
from wallride.runtime.control.wall_following.ball_law import Aim, Steered, pursuit_steering
from wallride.runtime.control.wall_following.ball_path import BallPath
from wallride.runtime.control.wall_following.speed_profile import fastest_mps, speed_limit_mps

TOO_NEAR_M = 0.05
SLIPPING_SHARE = 0.6
"""Share of the assumed grip that is used when the car is too near to the wall and still approaches it at full lock: the
floor may have 0.5 where 0.65 is assumed, and a bend that takes more than 0.6 of that binds the car (`BOUND_SHARE` of
`emergency`). Slower is no nearer to the wanted distance: the arc stays that of full lock, the car is beside the wall
for longer, and braking takes grip from the turn."""


def _flat_drive(path: BallPath, aim: Aim, car: Steered, wanted_mps: float, mu: float) -> tuple[Any, ...]:
    return (
        path.radius_m, path.bearing_rad, path.meets, path.crosses, aim.error_m, aim.line_rad, aim.line_error_m,
        aim.mean_bend_per_m, aim.speed_mps, car.kp, car.kd, car.wheelbase_m, car.trim_rad, car.most_rad, wanted_mps, mu,
    )  # fmt: skip


@accelerated(flat=_flat_drive)
def drive_along_ball(
    path: BallPath, aim: Aim, car: Steered, wanted_mps: float, mu: float
) -> tuple[float, float, float, float]:
    """Return the error, how far the wall is one straight line, the steering and the speed.

    The last three circles of the path are those of `look_aheads_m`. mu: the friction to count on, infinite where the
    path is not to limit the speed.
    """
    most_rad, trim_rad, wheelbase_m = car.most_rad, car.trim_rad, car.wheelbase_m
    error_m, heading_rad, straight, steering_rad = pursuit_steering(path, aim, car)
    steering_rad = min(max(steering_rad - trim_rad, -most_rad), most_rad)
    if math.isinf(mu):
        return error_m, straight, steering_rad, wanted_mps
    if steering_rad <= -most_rad and error_m < -TOO_NEAR_M and heading_rad < 0.0:
        mu *= SLIPPING_SHARE
    now_mps = speed_limit_mps(steering_rad, wheelbase_m, mu)
    ahead_mps = fastest_mps(path.radius_m, path.bearing_rad, path.meets, path.crosses, aim.speed_mps, mu)
    return error_m, straight, steering_rad, min(wanted_mps, now_mps, ahead_mps)
