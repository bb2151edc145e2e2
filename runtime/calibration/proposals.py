"""Settings from estimates: the new value of each setting that is measured, beside the one in effect."""

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass

from wallride.runtime.calibration.arc_fit import ArcFit
from wallride.runtime.calibration.delays import DelayFit
from wallride.runtime.calibration.responses import Estimate
from wallride.runtime.control.vehicle import GRAVITY_MPS2

SPEED_GAIN, WHEELBASE = "motor.speed_to_erpm_gain", "car.wheelbase_m"
SERVO_GAIN, SERVO_OFFSET = "motor.steering_to_servo_gain", "motor.steering_to_servo_offset"
LIDAR_X, LIDAR_Y, LIDAR_YAW = "car.lidar_x_m", "car.lidar_y_m", "lidar.yaw_rad"
LATENCY, ACTUATION, GRIP = "wall_follow.latency_s", "safety.actuation_s", "safety.grip_mu"
HALF_SCAN_S = 0.0125
BUILD_UP_S = 0.03
"""Time in which the deceleration builds up after the delay: as in the default of safety.actuation_s."""
SWAPPED = "the car drove backward when asked forward: swap two motor phases, or invert the motor in VESC Tool"


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
    if fit.speed_factor.value < 0.0 and not fit.speed_factor.why:
        for name in (SPEED_GAIN, SERVO_OFFSET, WHEELBASE, LIDAR_X, LIDAR_Y, LIDAR_YAW):
            yield Proposal(name, now[name], None, SWAPPED)
        return
    yield _proposal(SPEED_GAIN, now, fit.speed_factor, lambda factor: now[SPEED_GAIN] / factor, 1)
    reversed_ = fit.steering_factor.value < 0.0 and not fit.steering_factor.why
    gain = now[SERVO_GAIN] / fit.steering_factor.value if ruler else -now[SERVO_GAIN] if reversed_ else now[SERVO_GAIN]
    if ruler:
        yield _proposal(SERVO_GAIN, now, fit.steering_factor, lambda factor: now[SERVO_GAIN] / factor, 4)
    else:
        if reversed_:
            yield Proposal(SERVO_GAIN, now[SERVO_GAIN], gain, "left was right")
        yield _proposal(WHEELBASE, now, fit.wheelbase_m, abs, 4)
    yield _proposal(SERVO_OFFSET, now, fit.offset_rad, lambda rad: now[SERVO_OFFSET] - rad * gain, 4)
    yield _proposal(LIDAR_X, now, fit.lidar_x_m, lambda m: m, 3)
    yield _proposal(LIDAR_Y, now, fit.lidar_y_m, lambda m: m, 3)
    yield _proposal(LIDAR_YAW, now, fit.lidar_yaw_rad, lambda rad: now[LIDAR_YAW] + rad, 4)


def of_delays(servo: DelayFit, motor: DelayFit, now: Mapping[str, float]) -> Iterator[Proposal]:
    """Yield the follower's latency and safety's."""
    yield _proposal(LATENCY, now, servo.delay_s, lambda delay_s: delay_s + HALF_SCAN_S, 3)
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
