"""Odometry from wheel distance and steering: dead reckoning of the rear axle (base_link in odom, REP-105)."""

import math

from wallride.drivers.accelerated import accelerated
from wallride.drivers.api import MotorState
from wallride.drivers.value import value


@value()
class OdometryState:
    """Position [m] and heading [rad, counter-clockwise from x] in the odom frame, with the speeds at that moment."""

    x_m: float = 0.0
    y_m: float = 0.0
    yaw_rad: float = 0.0
    speed_mps: float = 0.0
    yaw_rate_radps: float = 0.0


class Odometry:
    """Integrates the kinematic single-track model: yaw' = v tan(steering) / wheelbase.

    Distance comes from the tachometer difference, which survives missed polls; heading is taken at the middle of
    the step, which removes the first-order error of the usual ROS node (vesc_to_odom integrates at the start).
    """

    def __init__(self, wheelbase_m: float) -> None:
        self._wheelbase_m = wheelbase_m
        self._last: MotorState | None = None
        self.pose = OdometryState()

    def update(self, state: MotorState | None) -> OdometryState:
        """Add one report; None (link lost) interrupts the chain, so that nothing is integrated across the gap."""
        last, self._last = self._last, state
        if state is None:
            self.pose = OdometryState(self.pose.x_m, self.pose.y_m, self.pose.yaw_rad)
            return self.pose
        step_m = state.distance_m - last.distance_m if last is not None else 0.0
        at, speed_mps = self.pose, state.speed_mps
        x_m, y_m, yaw_rad, curvature_per_m = dead_reckon(
            at.x_m, at.y_m, at.yaw_rad, step_m, state.steering_rad, self._wheelbase_m
        )
        self.pose = OdometryState(x_m, y_m, yaw_rad, speed_mps, speed_mps * curvature_per_m)
        return self.pose


@accelerated
def dead_reckon(
    x_m: float, y_m: float, yaw_rad: float, step_m: float, steering_rad: float, wheelbase_m: float
) -> tuple[float, float, float, float]:
    """Return x_m, y_m, yaw_rad and the curvature [1/m] after a step with that steering from that pose."""
    curvature_per_m = math.tan(steering_rad) / wheelbase_m
    turn_rad = step_m * curvature_per_m
    middle_rad = yaw_rad + turn_rad / 2
    return (
        x_m + step_m * math.cos(middle_rad),
        y_m + step_m * math.sin(middle_rad),
        math.remainder(yaw_rad + turn_rad, math.tau),
        curvature_per_m,
    )
