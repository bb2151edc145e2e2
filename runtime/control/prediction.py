"""Where the car will be when the answer to this scan takes effect."""

import math
from dataclasses import dataclass

import numpy as np

from drivers.api import MotorState
from runtime.control.geometry import Floats

_STEP_S = 0.015
_GRAVITY_MPS2 = 9.81
_GRIP_MU = 0.8
"""Only bounds the yaw rate that the steering angle promises; the car turns no faster than it can grip."""


@dataclass(frozen=True, slots=True)
class Shift:
    """Motion of the rear axle from the scan to the moment of effect: base_link then, in base_link now."""

    x_m: float = 0.0
    y_m: float = 0.0
    yaw_rad: float = 0.0

    def mirrored(self) -> "Shift":
        """Return the motion in a mirror along x."""
        return Shift(self.x_m, -self.y_m, -self.yaw_rad)

    def seen_from_there(self, points_m: Floats) -> Floats:
        """Return points (2, n) of base_link now in base_link then."""
        cos, sin = math.cos(self.yaw_rad), math.sin(self.yaw_rad)
        turn = np.array([[cos, sin], [-sin, cos]])
        seen: Floats = turn @ (points_m - np.array([[self.x_m], [self.y_m]]))
        return seen


class Predictor:
    """Follows the servo, which has no read-back, by its slew rate, and rolls the car ahead by the latency."""

    def __init__(self, wheelbase_m: float, steering_rate_radps: float) -> None:
        self._wheelbase_m = wheelbase_m
        self._rate_radps = steering_rate_radps
        self._servo_rad = 0.0
        self._stamp_s: float | None = None
        self.steering_rad = 0.0
        """Wheel angle at the moment of effect."""

    def shift(self, stamp_s: float, motor: MotorState | None, ahead_s: float) -> Shift:
        """Return the motion over the next `ahead_s`; no motion while nothing is known about the motor."""
        if motor is None:
            self._stamp_s = None
            self.steering_rad = self._servo_rad = 0.0
            return Shift()
        since_s = 0.0 if self._stamp_s is None else min(max(stamp_s - self._stamp_s, 0.0), 1.0)
        self._stamp_s = stamp_s
        self._servo_rad = self._towards(self._servo_rad, motor.steering_rad, since_s)
        x_m = y_m = yaw_rad = 0.0
        angle_rad = self._servo_rad
        speed_mps = motor.speed_mps
        steps = max(1, round(ahead_s / _STEP_S))
        dt_s = ahead_s / steps
        most_radps = _GRIP_MU * _GRAVITY_MPS2 / max(abs(speed_mps), 0.1)
        for _ in range(steps):
            angle_rad = self._towards(angle_rad, motor.steering_rad, dt_s)
            rate = min(max(speed_mps * math.tan(angle_rad) / self._wheelbase_m, -most_radps), most_radps)
            middle_rad = yaw_rad + rate * dt_s / 2
            x_m += speed_mps * math.cos(middle_rad) * dt_s
            y_m += speed_mps * math.sin(middle_rad) * dt_s
            yaw_rad += rate * dt_s
        self.steering_rad = angle_rad
        return Shift(x_m, y_m, yaw_rad)

    def _towards(self, from_rad: float, to_rad: float, dt_s: float) -> float:
        most = self._rate_radps * dt_s
        return from_rad + min(max(to_rad - from_rad, -most), most)
