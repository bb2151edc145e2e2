"""Settings from estimates: the new value of each setting that is measured, beside the one in effect."""

import math
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass

from wallride.runtime.calibration.arc_fit import SHORT_SHARE, ArcFit
from wallride.runtime.calibration.delays import DelayFit
from wallride.runtime.calibration.responses import Estimate
from wallride.runtime.calibration.throttle_fit import ThrottleFit
from wallride.runtime.control.vehicle import GRAVITY_MPS2

SPEED_GAIN, WHEELBASE = "motor.speed_to_erpm_gain", "car.wheelbase_m"
SERVO_GAIN, SERVO_OFFSET = "motor.steering_to_servo_gain", "motor.steering_to_servo_offset"
PULSE_GAIN, PULSE_CENTER = "motor.steering_us_per_rad", "motor.steering_center_us"
NEUTRAL, FORWARD, REVERSE = "motor.neutral_us", "motor.forward_us", "motor.reverse_us"
THROTTLE, BRAKE_PULSE = "motor.throttle_us_per_mps", "motor.brake_us"
LIDAR_X, LIDAR_Y, LIDAR_YAW = "car.lidar_x_m", "car.lidar_y_m", "lidar.yaw_rad"
LATENCY, ACTUATION, GRIP = "wall_follow.latency_s", "safety.actuation_s", "safety.grip_mu"
MOST_STEERING = "car.max_steering_rad"
BUILD_UP_S = 0.03
"""Time in which the deceleration builds up after the delay: as in the default of safety.actuation_s."""
NO_LIDAR_Y = "not identified: a lidar farther to the left looks like a shorter way, which no tachometer tells; by tape"
SWAPPED = (
    "by the scans the car drove backward when asked forward: swap two motor phases, or invert the motor in VESC Tool;"
    " did you see it drive forward? then the lidar is turned by 180 degrees, see lidar.yaw_rad"
)


@dataclass(frozen=True, slots=True)
class SteeringNames:
    """Settings of a steering that is middle + gain * angle. digits: of the values written."""

    gain: str
    middle: str
    ends: tuple[str, str]
    digits: int


SERVO, PULSES = STEERINGS = (
    SteeringNames(SERVO_GAIN, SERVO_OFFSET, ("motor.servo_min", "motor.servo_max"), 4),
    SteeringNames(PULSE_GAIN, PULSE_CENTER, ("motor.steering_min_us", "motor.steering_max_us"), 1),
)


def steering_names(now: Mapping[str, float]) -> SteeringNames:
    """Return the names that a car with these settings has."""
    return PULSES if PULSE_GAIN in now else SERVO


@dataclass(frozen=True, slots=True)
class Proposal:
    """One setting. old: in effect; new: measured, None where it was not; words: interval, or why there is none."""

    name: str
    old: float
    new: float | None
    words: str

    @property
    def changes(self) -> bool:
        """Return whether there is something to write."""
        return self.new is not None and self.new != self.old


def of_arcs(fit: ArcFit, now: Mapping[str, float], *, ruler: bool) -> Iterator[Proposal]:
    """Yield speed, steering and the lidar's pose. ruler: the wheelbase was measured, so the servo's gain is wrong."""
    names = steering_names(now)
    if fit.speed_factor.value < 0.0 and not fit.speed_factor.why:
        for name in (SPEED_GAIN, names.middle, WHEELBASE, LIDAR_X, LIDAR_Y, LIDAR_YAW):
            yield Proposal(name, now[name], None, SWAPPED)
        return
    if SPEED_GAIN in now:
        yield _proposal(SPEED_GAIN, now, fit.speed_factor, lambda factor: now[SPEED_GAIN] / factor, 1)
    old = now[names.gain]
    reversed_ = fit.steering_factor.value < 0.0 and not fit.steering_factor.why
    gain = old / fit.steering_factor.value if ruler else -old if reversed_ else old
    if ruler:
        yield _proposal(names.gain, now, fit.steering_factor, lambda factor: old / factor, names.digits)
    else:
        if reversed_:
            yield Proposal(names.gain, old, gain, "left was right")
        yield _proposal(WHEELBASE, now, fit.wheelbase_m, abs, 4)
    yield _proposal(names.middle, now, fit.offset_rad, lambda rad: now[names.middle] - rad * gain, names.digits)
    yield _proposal(LIDAR_X, now, fit.lidar_x_m, lambda m: m, 3)
    if SPEED_GAIN in now:
        yield _proposal(LIDAR_Y, now, fit.lidar_y_m, lambda m: m, 3)
    else:
        yield Proposal(LIDAR_Y, now[LIDAR_Y], None, NO_LIDAR_Y)
    yield _proposal(LIDAR_YAW, now, fit.lidar_yaw_rad, lambda rad: math.remainder(now[LIDAR_YAW] + rad, math.tau), 4)


def of_throttle(fit: ThrottleFit, now: Mapping[str, float]) -> Iterator[Proposal]:
    """Yield the pulses of the throttle."""
    for name, found in ((NEUTRAL, fit.neutral_us), (FORWARD, fit.forward_us), (REVERSE, fit.reverse_us)):
        yield _proposal(name, now, found, lambda pulse_us: pulse_us, 0)
    yield _proposal(THROTTLE, now, fit.us_per_mps, lambda us_per_mps: us_per_mps, 1)


def of_lock(commanded_rad: float, driven_rad: float, now: Mapping[str, float]) -> Proposal:
    """Return the linkage's end on the side of a commanded angle: the pulse from which on the wheels turn no further.

    now: with gain and middle as they were measured.
    """
    end = PULSES.ends[commanded_rad * now[PULSE_GAIN] > 0]
    if commanded_rad * driven_rad <= 0:
        return Proposal(
            end, now[end], None, f"{commanded_rad:.2f} rad were asked for, {driven_rad:.2f} rad were driven"
        )
    if abs(driven_rad) > abs(commanded_rad) * (1 - SHORT_SHARE):
        return Proposal(end, now[end], now[end], f"the wheels follow as far as {driven_rad:.2f} rad")
    pulse_us = now[PULSE_CENTER] + now[PULSE_GAIN] * driven_rad
    return Proposal(end, now[end], float(round(pulse_us)), f"the wheels turn no further than {driven_rad:.2f} rad")


def of_delays(servo: DelayFit, motor: DelayFit, now: Mapping[str, float], scan_period_s: float) -> Iterator[Proposal]:
    """Yield the follower's latency, with half of the time between two scans, and safety's."""
    yield _proposal(LATENCY, now, servo.delay_s, lambda delay_s: delay_s + scan_period_s / 2, 3)
    yield _proposal(ACTUATION, now, motor.delay_s, lambda delay_s: delay_s + BUILD_UP_S, 3)


def of_braking(deceleration_mps2: Estimate, now: Mapping[str, float]) -> Iterator[Proposal]:
    """Yield the assumed grip where the car brakes less than it assumes; never more grip than is configured."""
    low, high = deceleration_mps2.low / GRAVITY_MPS2, deceleration_mps2.high / GRAVITY_MPS2
    words = deceleration_mps2.as_text("") if deceleration_mps2.why else f"{low:.4g} to {high:.4g}"
    if deceleration_mps2.why or low >= now[GRIP]:
        yield Proposal(GRIP, now[GRIP], None if deceleration_mps2.why else now[GRIP], words)
    else:
        yield Proposal(GRIP, now[GRIP], round(max(low, 0.2), 2), words)


def _proposal(
    name: str, now: Mapping[str, float], found: Estimate, convert: Callable[[float], float], digits: int
) -> Proposal:
    if found.why:
        return Proposal(name, now[name], None, found.as_text(""))
    low, high = sorted((convert(found.low), convert(found.high)))
    return Proposal(name, now[name], round(convert(found.value), digits), f"{low:.4g} to {high:.4g}")
