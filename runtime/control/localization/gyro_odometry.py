"""Odometry whose heading comes from a gyro, for `odom`, where the motor controller has an inertial sensor.

Trim, servo and tyres make the steering a bad measure of the turn: over 10 m it errs by 1.5 to 3.3 m, a gyro by 0.1 to
0.3 m, with scans beside it by 0.1 m. The gyro's bias is learnt while the wheels stand. Until then, and without a sensor
that is level and agrees with the steering, the steering tells the heading as before.
"""

import math
from typing import Final

from wallride.drivers.api import MotorState, Scan
from wallride.runtime.control.localization.odometry_errors import AxleStep, OdometryErrors, Reckoned
from wallride.runtime.control.localization.pose_filter import WheelStep
from wallride.runtime.control.localization.wheel_steps import WheelSteps
from wallride.runtime.control.perception.motion.scan_matching import ScanPose
from wallride.runtime.control.perception.odometry import OdometryState, dead_reckon
from wallride.runtime.control.vehicle import CarSettings

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
EASED_M: Final = 0.2
"""Way over which a correction by scans is brought into the pose, so that it does not jump."""

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
    def rate_radps(self) -> float:
        """Return the newest rate, less the bias."""
        return self._rate_radps - self.bias_radps

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

    pose: at the newest report. heading: what tells its heading. errors: of wheels, tyres and gyro, learnt from scans.
    """

    def __init__(self, car: CarSettings) -> None:
        self.gyro = Gyro()
        self.pose = OdometryState()
        self.heading = f"steering: {NO_SENSOR}"
        self.errors = OdometryErrors()
        self._car = car
        self._steps = WheelSteps(car.steering_rate_radps)
        self._last: MotorState | None = None
        self._reckoned: Reckoned | None = None
        self._owed_m = 0j  # corrected already, but not told yet
        self._compared = (0.0, 0.0)

    def take(self, stamp_s: float, rate_radps: Vector, acceleration_mps2: Vector) -> None:
        """Add an inertial measurement, in base_link."""
        stands = self._last is not None and abs(self._last.speed_mps) < STANDS_MPS
        self.gyro.take(stamp_s, rate_radps, acceleration_mps2, stands=stands)

    def update(self, state: MotorState | None) -> OdometryState:
        """Add one report; None (link lost) interrupts the chain, so that nothing is integrated across the gap."""
        last, self._last, at = self._last, state, self.pose
        if state is None:
            self._steps, self._reckoned = WheelSteps(self._car.steering_rate_radps), None
            self.pose = OdometryState(at.x_m, at.y_m, at.yaw_rad)
            return self.pose
        if last is not None and state.stamp_s == last.stamp_s:
            return self.pose  # the same report once more, now with a fault
        step, turn_rad = self._steps.to(state.stamp_s, state), self.gyro.turned_rad(state.stamp_s)
        if step is not None and not math.isnan(turn_rad):
            self._compare(step, turn_rad)
        trouble = self.gyro.trouble or (SILENT if math.isnan(turn_rad) else "")
        self.heading = f"steering: {trouble}" if trouble else "gyro"
        if step is None or trouble:
            self._reckoned = None
            self.pose = self._by_steering(state, state.distance_m - last.distance_m if last is not None else 0.0)
        else:
            if step.slides:
                self.errors.forget()
            self.pose = self._by_gyro(state, AxleStep(step.way_m, step.speed_mps, turn_rad, step.since_s))
        return self.pose

    def learn(self, scan: Scan) -> None:
        """Learn the errors from the newest scan, once it is answered; nothing while the gyro tells no heading."""
        state, last = self._last, self._reckoned
        if state is None or last is None or abs(scan.stamp_s - state.stamp_s) >= GAP_S:
            self.errors.forget()
            return
        since_s, speed_mps = scan.stamp_s - state.stamp_s, state.speed_mps
        carried = AxleStep(speed_mps * since_s, speed_mps, self.gyro.rate_radps * since_s, since_s)
        here = self.errors.after(last, carried)
        found = self.errors.learn(scan, self._car.lidar_m, (speed_mps, self.pose.yaw_rate_radps), here)
        aside_m = found.pose.at_m - here.pose.at_m
        self._reckoned = last._replace(pose=ScanPose(last.pose.at_m + aside_m, last.pose.yaw_rad))
        self._owed_m += aside_m

    def _by_gyro(self, state: MotorState, step: AxleStep) -> OdometryState:
        at, before = self.pose, self._reckoned
        if before is None:
            self._owed_m = 0j
            self.errors.forget()
            before = Reckoned(state.stamp_s - step.since_s, ScanPose(complex(at.x_m, at.y_m), at.yaw_rad))
        self._reckoned = self.errors.after(before, step)
        self._owed_m *= math.exp(-abs(step.way_m) / EASED_M)
        at_m, yaw_rad = self._reckoned.pose.at_m - self._owed_m, self._reckoned.pose.yaw_rad
        turn_radps = (yaw_rad - before.pose.yaw_rad) / step.since_s
        return OdometryState(at_m.real, at_m.imag, math.remainder(yaw_rad, math.tau), state.speed_mps, turn_radps)

    def _by_steering(self, state: MotorState, step_m: float) -> OdometryState:
        at, steering_rad = self.pose, state.steering_rad
        x_m, y_m, yaw_rad, curvature_per_m = dead_reckon(
            at.x_m, at.y_m, at.yaw_rad, step_m, steering_rad, self._car.wheelbase_m
        )
        return OdometryState(x_m, y_m, yaw_rad, state.speed_mps, state.speed_mps * curvature_per_m)

    def _compare(self, step: WheelStep, turn_rad: float) -> None:
        """Find a gyro that is mounted otherwise, speaks other units, or always says the same."""
        if step.slides or step.steering_rad is None or abs(step.steering_rad) < BEND_RAD:
            return
        steered, turned = self._compared
        steered += step.way_m * math.tan(step.steering_rad) / self._car.wheelbase_m
        turned += turn_rad
        self._compared = steered, turned
        if abs(steered) > COMPARED_RAD:
            self.gyro.disagrees = not AGREES[0] < turned / steered < AGREES[1]
            self._compared = 0.0, 0.0
