"""Odometry whose heading comes from a gyro, for `odom`, where the motor controller has an inertial sensor.

Trim, servo and tyres make the steering a bad measure of the turn: over 10 m it errs by 1.5 to 3.3 m, a gyro by 0.1 to
0.3 m (racing.md, section 1). The gyro's bias is learnt while the wheels stand. Until then, and without a sensor that is
level and agrees with the steering, the steering tells the heading as before.
"""

import math
from typing import Final

from wallride.drivers.api import MotorState
from wallride.runtime.control.localization.pose_filter import SLIP_S2PM, WheelStep
from wallride.runtime.control.localization.wheel_steps import WheelSteps
from wallride.runtime.control.perception.odometry import OdometryState, dead_reckon

Vector = tuple[float, float, float]

STANDS_MPS: Final = 0.02
STILL_RADPS: Final = 0.1
"""Rate of a standing car below which it is the bias of its gyro, and not a hand that turns it."""
LEARNT: Final = 50
"""Samples that tell the bias, about a second."""
KEPT: Final = 500
"""Samples over which the bias is averaged: it drifts with the temperature."""
GAP_S: Final = 0.1
"""Time without a sample after which the angle is not known."""
LEVEL_SHARE: Final = 0.9
"""Least share of gravity along the sensor's z axis, 25 degrees off."""
BEND_RAD: Final = 0.1
"""Steering above which a bend is one, and not the trim."""
COMPARED_RAD: Final = 3.0
"""Turn by the steering over which the gyro has to agree with it."""
AGREES: Final = (0.3, 3.0)
"""Turn by the gyro over that by the steering: tyres at the grip's limit take half of it."""

NO_SENSOR: Final = "no inertial sensor"
UNKNOWN_BIAS: Final = "the gyro's bias is not known: let the car stand for a second"
NOT_LEVEL: Final = "the inertial sensor is not level: enter its mounting in VESC Tool"
SILENT: Final = "the gyro is silent"
DISAGREES: Final = "the gyro does not agree with the steering: is its mounting entered in VESC Tool?"


class Gyro:
    """Turn about the vertical axis. bias_radps: NaN until it is known. trouble: why it tells nothing, "" if it does."""

    def __init__(self) -> None:
        self.disagrees = False
        self._learnt = 0
        self._bias_radps = 0.0
        self._mean_mps2: Vector = (0.0, 0.0, 0.0)
        self._stamp_s, self._rate_radps = -math.inf, 0.0
        self._angle_rad = 0.0
        self._read: tuple[float, float] | None = None

    def take(self, stamp_s: float, rate_radps: Vector, acceleration_mps2: Vector, *, stands: bool) -> None:
        """Add a sample, in the axes of base_link. stands: whether the wheels stand."""
        since_s, rate = stamp_s - self._stamp_s, rate_radps[2]
        if not 0.0 < since_s < GAP_S:
            self._read, since_s = None, 0.0
        self._angle_rad += 0.5 * (self._rate_radps + rate) * since_s
        self._stamp_s, self._rate_radps = stamp_s, rate
        if stands and abs(rate) < STILL_RADPS:
            self._learnt = min(self._learnt + 1, KEPT)
            self._bias_radps += (rate - self._bias_radps) / self._learnt
            now = zip(self._mean_mps2, acceleration_mps2, strict=True)
            x, y, z = (mean + (one - mean) / self._learnt for mean, one in now)
            self._mean_mps2 = x, y, z

    @property
    def bias_radps(self) -> float:
        """Return the rate that a standing car's gyro reads, NaN until it is known."""
        return self._bias_radps if self._learnt >= LEARNT else math.nan

    @property
    def trouble(self) -> str:
        """Return why the gyro does not tell the heading, "" where it does."""
        if self._stamp_s == -math.inf:
            return NO_SENSOR
        if self._learnt < LEARNT:
            return UNKNOWN_BIAS
        if self._mean_mps2[2] < LEVEL_SHARE * math.hypot(*self._mean_mps2):
            return NOT_LEVEL
        return DISAGREES if self.disagrees else ""

    def turned_rad(self, stamp_s: float) -> float:
        """Return the turn since the last call; NaN where it is not known."""
        after_s = stamp_s - self._stamp_s
        angle_rad = self._angle_rad + self._rate_radps * after_s if abs(after_s) < GAP_S else math.nan
        last, self._read = self._read, (stamp_s, angle_rad)
        return math.nan if last is None else angle_rad - last[1] - self.bias_radps * (stamp_s - last[0])


class GyroOdometry:
    """Dead reckoning of the rear axle (base_link in odom, REP-105) by wheels and gyro.

    pose: at the newest report. heading: what tells its heading. scale: true way over the reported one. slip_s2pm: the
    rear axle moves aside by that times speed^2 * turn. Both may be set, as a map tells them.
    """

    def __init__(self, wheelbase_m: float, steering_rate_radps: float) -> None:
        self.gyro = Gyro()
        self.pose = OdometryState()
        self.heading = f"steering: {NO_SENSOR}"
        self.scale, self.slip_s2pm = 1.0, SLIP_S2PM
        self._wheelbase_m = wheelbase_m
        self._rate_radps = steering_rate_radps
        self._steps = WheelSteps(steering_rate_radps)
        self._last: MotorState | None = None
        self._compared = (0.0, 0.0)

    def take(self, stamp_s: float, rate_radps: Vector, acceleration_mps2: Vector) -> None:
        """Add an inertial measurement, in base_link."""
        stands = self._last is not None and abs(self._last.speed_mps) < STANDS_MPS
        self.gyro.take(stamp_s, rate_radps, acceleration_mps2, stands=stands)

    def update(self, state: MotorState | None) -> OdometryState:
        """Add one report; None (link lost) interrupts the chain, so that nothing is integrated across the gap."""
        last, self._last, at = self._last, state, self.pose
        if state is None:
            self._steps = WheelSteps(self._rate_radps)
            self.pose = OdometryState(at.x_m, at.y_m, at.yaw_rad)
            return self.pose
        step, turn_rad = self._steps.to(state.stamp_s, state), self.gyro.turned_rad(state.stamp_s)
        if step is not None and not math.isnan(turn_rad):
            self._compare(step, turn_rad)
        trouble = self.gyro.trouble or (SILENT if math.isnan(turn_rad) else "")
        self.heading = f"steering: {trouble}" if trouble else "gyro"
        if step is None or trouble:
            self.pose = self._by_steering(state, state.distance_m - last.distance_m if last is not None else 0.0)
            return self.pose
        way_m, speed_mps = self.scale * step.way_m, self.scale * step.speed_mps
        aside_m = -self.slip_s2pm * speed_mps**2 * turn_rad
        cos, sin = math.cos(at.yaw_rad + 0.5 * turn_rad), math.sin(at.yaw_rad + 0.5 * turn_rad)
        self.pose = OdometryState(
            at.x_m + cos * way_m - sin * aside_m,
            at.y_m + sin * way_m + cos * aside_m,
            math.remainder(at.yaw_rad + turn_rad, math.tau),
            state.speed_mps,
            turn_rad / step.since_s,
        )
        return self.pose

    def _by_steering(self, state: MotorState, step_m: float) -> OdometryState:
        at, steering_rad = self.pose, state.steering_rad
        x_m, y_m, yaw_rad, curvature_per_m = dead_reckon(
            at.x_m, at.y_m, at.yaw_rad, step_m, steering_rad, self._wheelbase_m
        )
        return OdometryState(x_m, y_m, yaw_rad, state.speed_mps, state.speed_mps * curvature_per_m)

    def _compare(self, step: WheelStep, turn_rad: float) -> None:
        """Find a gyro that is mounted otherwise, speaks other units, or always says the same."""
        if step.slides or step.steering_rad is None or abs(step.steering_rad) < BEND_RAD:
            return
        steered, turned = self._compared
        steered += step.way_m * math.tan(step.steering_rad) / self._wheelbase_m
        turned += turn_rad
        self._compared = steered, turned
        if abs(steered) > COMPARED_RAD:
            self.gyro.disagrees = not AGREES[0] < turned / steered < AGREES[1]
            self._compared = 0.0, 0.0
