"""Where the car will be when the answer to this scan takes effect."""

import math
from collections import deque
from dataclasses import dataclass, field

from drivers.api import MotorState
from drivers.twin import twin
from drivers.value import value

_STEP_S = 0.015
_GRAVITY_MPS2 = 9.81
_SLOWEST_MPS = 0.1
_GRIP_MU = 0.8
"""Only bounds the yaw rate that the steering angle promises; the car turns no faster than it can grip."""
WIRE_S = 0.02
"""From a scan's arrival to its answer on the wire, until it has been measured."""
_SCAN_S = 0.025
LONGEST_WIRE_S = 0.2
SAME_RAD = 1e-6
"""Two angles so near to each other are the same answer."""
OBEYED_WITHIN_S = 0.5
"""Answers that the motor has not shown for so long are somebody else's to override: nothing of them is in flight."""


@value()
class Shift:
    """Motion of the rear axle from the scan to the moment of effect: base_link then, in base_link now."""

    x_m: float = 0.0
    y_m: float = 0.0
    yaw_rad: float = 0.0

    def mirrored(self) -> "Shift":
        """Return the motion in a mirror along x."""
        return Shift(self.x_m, -self.y_m, -self.yaw_rad)


@dataclass(slots=True)
class Answers:
    """The last steering answers, and how long they take to the wire, by what the motor says it was told.

    rate_radps: the limiter before the wire lets the steering change no faster.
    """

    rate_radps: float
    _told: deque[tuple[float, float]] = field(default_factory=lambda: deque(maxlen=12))
    _obeyed_s: float = -math.inf
    _least_s: float = WIRE_S
    _most_s: float = WIRE_S

    @property
    def wire_s(self) -> float:
        """From a scan's arrival to its answer on the wire, as far as it has been measured."""
        return (self._least_s + self._most_s) / 2

    def said(self, now_s: float, steering_rad: float) -> None:
        """Remember the answer to a scan that came at that time."""
        last_s, last_rad = self._told[-1] if self._told else (now_s - _SCAN_S, 0.0)
        self._told.append((now_s, towards(last_rad, steering_rad, self.rate_radps * max(now_s - last_s, 0.0))))

    def heard(self, motor: MotorState) -> None:
        """Compare with what the motor was told last: that answer had arrived by then, and the next one had not."""
        told = tuple(self._told)
        place = only_one(told, motor.steering_rad)
        if place < 0:
            return  # none of mine, or a steady wheel, which tells nothing
        self._obeyed_s = motor.stamp_s
        most_s = motor.stamp_s - told[place][0]
        newest = place + 1 == len(told)
        least_s = 0.0 if newest else max(motor.stamp_s - told[place + 1][0], 0.0)
        if not 0.0 <= most_s <= LONGEST_WIRE_S:
            return
        if most_s < self._least_s or least_s > self._most_s:  # it has changed, or was never measured
            self._least_s, self._most_s = least_s, most_s
        else:
            self._least_s, self._most_s = max(self._least_s, least_s), min(self._most_s, most_s)

    def in_flight(self, now_s: float) -> list[tuple[float, float]]:
        """Return (time on the wire, angle) of the answers that the motor cannot have shown yet, in order."""
        coming: list[tuple[float, float]] = []
        if now_s - self._obeyed_s > OBEYED_WITHIN_S:
            return coming
        wire_s = self.wire_s
        for told_s, angle_rad in reversed(self._told):  # the newest ones, as a rule one or two
            if told_s + wire_s <= now_s:
                break
            coming.insert(0, (told_s + wire_s, angle_rad))
        return coming


@twin
def only_one(told: tuple[tuple[float, float], ...], angle_rad: float) -> int:
    """Return the place of the only answer with this angle, -1 where there is none or where there are several.

    told: time and angle of each.
    """
    same = [place for place, (_, told_rad) in enumerate(told) if abs(told_rad - angle_rad) < SAME_RAD]
    return same[0] if len(same) == 1 else -1


class Predictor:
    """Follows the servo, which has no read-back, by its slew rate, and rolls the car ahead by the latency."""

    def __init__(self, wheelbase_m: float, steering_rate_radps: float) -> None:
        self._wheelbase_m = wheelbase_m
        self._rate_radps = steering_rate_radps
        self._servo_rad = 0.0
        self._stamp_s: float | None = None
        self.answers = Answers(steering_rate_radps)
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
        self._servo_rad = towards(before_rad, motor.steering_rad, self._rate_radps * since_s)
        self.wheel_rad = (before_rad + self._servo_rad) / 2
        self.answers.heard(motor)
        coming = self.answers.in_flight(motor.stamp_s)
        after_s = [(told_s - stamp_s, angle_rad) for told_s, angle_rad in coming]
        ahead_s += self.answers.wire_s
        steps = max(1, round(ahead_s / _STEP_S))
        motion = motor.speed_mps, self._wheelbase_m, trim_rad, self._rate_radps, ahead_s / steps
        return Shift(*rolled_ahead(motion, (self._servo_rad, motor.steering_rad), after_s, steps))


@twin
def rolled_ahead(
    motion: tuple[float, float, float, float, float],
    steering: tuple[float, float],
    coming: list[tuple[float, float]],
    steps: int,
) -> tuple[float, float, float]:
    """Return x_m, y_m, yaw_rad after so many steps (kinematic single-track model).

    motion: speed_mps, wheelbase_m, trim_rad, slew rate_radps, seconds of a step. steering: the servo's angle and where
    it goes. coming: (seconds from the beginning, angle) of the targets that follow, in order; at most 32.
    """
    speed_mps, wheelbase_m, trim_rad, rate_radps, dt_s = motion
    angle_rad, target_rad = steering
    x_m = y_m = yaw_rad = 0.0
    most_radps = _GRIP_MU * _GRAVITY_MPS2 / max(abs(speed_mps), _SLOWEST_MPS)
    waiting = deque(coming)
    for step in range(steps):
        while waiting and waiting[0][0] <= step * dt_s:
            target_rad = waiting.popleft()[1]
        angle_rad = towards(angle_rad, target_rad, rate_radps * dt_s)
        rate = min(max(speed_mps * math.tan(angle_rad + trim_rad) / wheelbase_m, -most_radps), most_radps)
        middle_rad = yaw_rad + rate * dt_s / 2
        x_m += speed_mps * math.cos(middle_rad) * dt_s
        y_m += speed_mps * math.sin(middle_rad) * dt_s
        yaw_rad += rate * dt_s
    return x_m, y_m, yaw_rad


def towards(from_rad: float, to_rad: float, most_rad: float) -> float:
    """Return the angle at most so far from the first one on the way to the second."""
    return from_rad + min(max(to_rad - from_rad, -most_rad), most_rad)
