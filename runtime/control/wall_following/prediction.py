"""Prediction of the car's pose at the time when the answer to this scan takes effect."""

import math
from collections import deque
from dataclasses import dataclass
from typing import Any

from wallride.drivers.accelerated import accelerated
from wallride.drivers.api import MotorState
from wallride.drivers.value import value
from wallride.runtime.control.vehicle import GRAVITY_MPS2

_STEP_S = 0.015
_MIN_SPEED_MPS = 0.1
_GRIP_MU = 0.8
"""Friction that bounds the yaw rate of the steering angle; the car turns no faster than its grip allows."""
WIRE_S = 0.02
"""Time from a scan's arrival to its answer on the wire, until it has been measured."""
_SCAN_S = 0.025
MAX_WIRE_S = 0.2
MAX_TOLD = 12
"""Maximum number of stored answers."""
SAME_RAD = 1e-6
"""Maximum difference of two angles of the same answer."""
OBEYED_WITHIN_S = 0.5
"""Maximum time until the motor reports an answer; older ones were overridden by another source, not in flight."""


@value()
class Shift:
    """Motion of the rear axle from the scan to the moment of effect: base_link then, in base_link now."""

    x_m: float = 0.0
    y_m: float = 0.0
    yaw_rad: float = 0.0

    def mirrored(self) -> "Shift":
        """Return the motion in a mirror along x."""
        return Shift(self.x_m, -self.y_m, -self.yaw_rad)


Told = tuple[tuple[float, float], ...]
"""Time [s] and angle [rad] of the last answers, the oldest first."""
Wire = tuple[float, float, float]
"""obeyed_s: when the motor last reported an answer; least_s, most_s: bounds of an answer's time to the wire."""

Times = tuple[float, float, float]
"""scan_s: when the scan was taken; since_s: time since the one before; ahead_s: how long the motion goes on after its
answer is on the wire."""


@dataclass(slots=True)
class SteeringHistory:
    """Stores the last steering answers and estimates their time to the wire from the motor's reported commands.

    rate_radps: the limiter before the wire lets the steering change no faster.
    """

    rate_radps: float
    told: Told = ()
    wire: Wire = (-math.inf, WIRE_S, WIRE_S)

    def said(self, now_s: float, steering_rad: float) -> None:
        """Store the answer to a scan that arrived at that time."""
        last_s, last_rad = self.told[-1] if self.told else (now_s - _SCAN_S, 0.0)
        angle_rad = slew_towards(last_rad, steering_rad, self.rate_radps * max(now_s - last_s, 0.0))
        self.told = (*self.told[1 - MAX_TOLD :], (now_s, angle_rad))


def to_wire_s(wire: Wire) -> float:
    """Return the middle of the bounds of the time to the wire."""
    return (wire[1] + wire[2]) / 2


def learn_wire_delay(told: Told, wire: Wire, stamp_s: float, angle_rad: float) -> Wire:
    """Return the bounds after the motor reported its last command: that had arrived, and the next answer had not."""
    same = [place for place, (_, told_rad) in enumerate(told) if abs(told_rad - angle_rad) < SAME_RAD]
    if len(same) != 1:
        return wire  # not an answer of this follower, or a steady wheel, which carries no information
    _, least_s, most_s = wire
    next_s = [told_s for told_s, _ in told[same[0] + 1 :]]
    now_most_s = stamp_s - told[same[0]][0]
    now_least_s = max(stamp_s - next_s[0], 0.0) if next_s else 0.0
    if not 0.0 <= now_most_s <= MAX_WIRE_S:
        return stamp_s, least_s, most_s
    if now_most_s < least_s or now_least_s > most_s:  # it has changed, or was never measured
        return stamp_s, now_least_s, now_most_s
    return stamp_s, max(least_s, now_least_s), min(most_s, now_most_s)


def in_flight(told: Told, wire: Wire, now_s: float) -> list[tuple[float, float]]:
    """Return (time on the wire, angle) of the answers that the motor cannot have reported yet, in order."""
    coming: list[tuple[float, float]] = []
    if now_s - wire[0] > OBEYED_WITHIN_S:
        return coming
    wire_s = to_wire_s(wire)
    for told_s, angle_rad in reversed(told):  # the newest ones, as a rule one or two
        if told_s + wire_s <= now_s:
            break
        coming.insert(0, (told_s + wire_s, angle_rad))
    return coming


class Predictor:
    """Estimates the angle of the servo, without feedback, by its slew rate; predicts the motion over the latency."""

    def __init__(self, wheelbase_m: float, steering_rate_radps: float) -> None:
        self._wheelbase_m = wheelbase_m
        self._servo_rad = 0.0
        self._stamp_s: float | None = None
        self.answers = SteeringHistory(steering_rate_radps)
        self.wheel_rad = 0.0
        """Mean servo angle between the last two scans."""

    def shift(self, stamp_s: float, motor: MotorState | None, ahead_s: float, trim_rad: float = 0.0) -> Shift:
        """Return the motion from the scan until `ahead_s` after its answer is on the wire.

        No motion while nothing is known about the motor. trim_rad: wheel angle while the servo stands in the middle.
        """
        if motor is None:
            self._stamp_s = None
            self._servo_rad = self.wheel_rad = 0.0
            return Shift()
        since_s = 0.0 if self._stamp_s is None else min(max(stamp_s - self._stamp_s, 0.0), 1.0)
        self._stamp_s = stamp_s
        before_rad = self._servo_rad
        self.answers.wire, self._servo_rad, x_m, y_m, yaw_rad = predict_motion(
            self.answers, motor, before_rad, (stamp_s, since_s, ahead_s), self._wheelbase_m, trim_rad
        )
        self.wheel_rad = (before_rad + self._servo_rad) / 2
        return Shift(x_m, y_m, yaw_rad)


def _flat_motion(
    answers: SteeringHistory, motor: MotorState, servo_rad: float, times_s: Times, wheelbase_m: float, trim_rad: float
) -> tuple[Any, ...]:
    return (
        answers.told, answers.wire, motor.stamp_s, motor.speed_mps, motor.steering_rad, servo_rad, *times_s,
        wheelbase_m, trim_rad, answers.rate_radps,
    )  # fmt: skip


@accelerated(flat=_flat_motion)
def predict_motion(
    answers: SteeringHistory, motor: MotorState, servo_rad: float, times_s: Times, wheelbase_m: float, trim_rad: float
) -> tuple[Wire, float, float, float, float]:
    """Return the wire, the servo's angle at the scan, and x_m, y_m and yaw_rad of the motion from then on.

    servo_rad: its angle at the last scan. trim_rad: wheel angle while the servo stands in the middle.
    """
    told, rate_radps = answers.told, answers.rate_radps
    motor_s, speed_mps, steering_rad = motor.stamp_s, motor.speed_mps, motor.steering_rad
    scan_s, since_s, ahead_s = times_s
    if len(told) > MAX_TOLD:
        raise TypeError(f"predict_motion takes at most {MAX_TOLD} answers, not {len(told)}")
    wire = learn_wire_delay(told, answers.wire, motor_s, steering_rad)
    servo_rad = slew_towards(servo_rad, steering_rad, rate_radps * since_s)
    coming = [(there_s - scan_s, angle_rad) for there_s, angle_rad in in_flight(told, wire, motor_s)]
    ahead_s += to_wire_s(wire)
    steps = max(1, round(ahead_s / _STEP_S))
    motion = speed_mps, wheelbase_m, trim_rad, rate_radps, ahead_s / steps
    return wire, servo_rad, *roll_ahead(motion, (servo_rad, steering_rad), coming, steps)


def roll_ahead(
    motion: tuple[float, float, float, float, float],
    steering: tuple[float, float],
    coming: list[tuple[float, float]],
    steps: int,
) -> tuple[float, float, float]:
    """Return x_m, y_m, yaw_rad after these steps (kinematic single-track model).

    motion: speed_mps, wheelbase_m, trim_rad, slew rate_radps, seconds of a step. steering: the servo's angle and where
    it goes. coming: (seconds from the beginning, angle) of the targets that follow, in order.
    """
    speed_mps, wheelbase_m, trim_rad, rate_radps, dt_s = motion
    angle_rad, target_rad = steering
    x_m = y_m = yaw_rad = 0.0
    most_radps = _GRIP_MU * GRAVITY_MPS2 / max(abs(speed_mps), _MIN_SPEED_MPS)
    waiting = deque(coming)
    for step in range(steps):
        while waiting and waiting[0][0] <= step * dt_s:
            target_rad = waiting.popleft()[1]
        angle_rad = slew_towards(angle_rad, target_rad, rate_radps * dt_s)
        rate = min(max(speed_mps * math.tan(angle_rad + trim_rad) / wheelbase_m, -most_radps), most_radps)
        middle_rad = yaw_rad + rate * dt_s / 2
        x_m += speed_mps * math.cos(middle_rad) * dt_s
        y_m += speed_mps * math.sin(middle_rad) * dt_s
        yaw_rad += rate * dt_s
    return x_m, y_m, yaw_rad


def slew_towards(from_rad: float, to_rad: float, most_rad: float) -> float:
    """Return the angle at most most_rad from the first one towards the second."""
    return from_rad + min(max(to_rad - from_rad, -most_rad), most_rad)
