"""What wheels and steering say of the way between two scans, carried to the scans' own times."""

import math
from typing import Final

from wallride.drivers.api import MotorState
from wallride.runtime.control.localization.pose_filter import WheelStep

LOCKS_MPS2, SLIDES_MPS2 = 11.0, 5.0
"""Deceleration of wheels above which they lock, and that of the car then."""
STALE_S: Final = 0.25
"""An older report says nothing of the motion now."""
LONGEST_S: Final = 0.5
"""Longest time over which the last motion is carried on without a report."""


class WheelSteps:
    """Steps from scan to scan. A report is older than the scan: its speed carries it on, the next one corrects that."""

    def __init__(self, steering_rate_radps: float) -> None:
        self._rate_radps = steering_rate_radps
        self._stamp_s = math.nan
        self._way_m = math.nan
        self._report: MotorState | None = None
        self._true_mps = 0.0
        self._servo_rad = 0.0

    def to(self, stamp_s: float, motor: MotorState | None) -> WheelStep | None:
        """Return the step since the last scan; None where no report tells it, and at the first scan."""
        since_s, self._stamp_s = stamp_s - self._stamp_s, stamp_s
        if motor is None or stamp_s - motor.stamp_s > STALE_S:
            self._way_m, self._report = math.nan, None
            return None
        slides = self._slides(motor)
        way_m = motor.distance_m + self._true_mps * (stamp_s - motor.stamp_s)
        step_m, self._way_m = way_m - self._way_m, way_m
        if slides:
            step_m = self._true_mps * since_s
        if not (math.isfinite(step_m) and math.isfinite(since_s)):
            self._servo_rad = motor.steering_rad
            return None
        turn_rad = min(
            max(motor.steering_rad - self._servo_rad, -self._rate_radps * since_s), self._rate_radps * since_s
        )
        self._servo_rad += turn_rad
        return WheelStep(since_s, step_m, self._true_mps, self._servo_rad - 0.5 * turn_rad, slides)

    def _slides(self, motor: MotorState) -> bool:
        """Return whether the wheels are locked, and set the car's speed."""
        last, self._report = self._report, motor
        if last is None:
            self._true_mps = motor.speed_mps
            return False
        since_s = motor.stamp_s - last.stamp_s
        if since_s <= 0.0:
            return self._true_mps != motor.speed_mps
        if abs(motor.speed_mps) < abs(self._true_mps) - LOCKS_MPS2 * since_s:
            slower_mps = max(abs(motor.speed_mps), abs(self._true_mps) - SLIDES_MPS2 * since_s)
            self._true_mps = math.copysign(slower_mps, self._true_mps)
            return True
        self._true_mps = motor.speed_mps
        return False
