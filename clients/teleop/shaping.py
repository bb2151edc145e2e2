"""Stick shaping to a speed and a steering angle: dead zone, expo, ramp, limits. Pure; time comes in as `elapsed_s`."""

import math
from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class InputShape:
    """Response of the sticks.

    deadzone: part of the half range around the middle that means nothing. expo: 0 linear, 1 cubic.
    ramp_mps2: how fast a wished speed may grow; it never delays slowing down.
    steering_rate_radps: how fast the wished angle may change; keys need it, sticks do not.
    """

    max_speed_mps: float = 1.5
    max_steering_rad: float = 0.34
    deadzone: float = 0.08
    expo: float = 0.3
    ramp_mps2: float = 2.0
    steering_rate_radps: float = math.inf


class Shaper:
    """Remembers the last wish, so that the next one can be a small step from it."""

    def __init__(self, feel: InputShape) -> None:
        self._feel = feel
        self.speed_mps = 0.0
        self.steering_rad = 0.0

    def reset(self) -> None:
        """Reset to standstill and straight wheels, because the deadman was released."""
        self.speed_mps = self.steering_rad = 0.0

    def wants_speed(self, speed: float) -> bool:
        """Return whether this stick is out of its dead zone."""
        return curve(speed, self._feel.deadzone, self._feel.expo) != 0

    def step(self, speed: float, steering: float, elapsed_s: float) -> tuple[float, float]:
        """Return the wish (m/s, rad) for two sticks (-1 to 1), elapsed_s after the last one."""
        feel = self._feel
        wanted_mps = curve(speed, feel.deadzone, feel.expo) * feel.max_speed_mps
        wanted_rad = curve(steering, feel.deadzone, feel.expo) * feel.max_steering_rad
        self.speed_mps = ramp(self.speed_mps, wanted_mps, feel.ramp_mps2 * elapsed_s)
        step_rad = feel.steering_rate_radps * elapsed_s if elapsed_s > 0 else 0.0
        self.steering_rad += max(-step_rad, min(wanted_rad - self.steering_rad, step_rad))
        return self.speed_mps, self.steering_rad


def curve(stick: float, deadzone: float, expo: float) -> float:
    """Return the stick without its dead zone, gentle around the middle: (1 - expo) x + expo x^3; 0 for no number.

    Continuous and increasing, full deflection stays full.
    """
    if not math.isfinite(stick):
        return 0.0
    size = (min(abs(stick), 1.0) - deadzone) / (1 - deadzone)
    if size <= 0:
        return 0.0
    return math.copysign((1 - expo) * size + expo * size**3, stick)


def ramp(last_mps: float, wanted_mps: float, step_mps: float) -> float:
    """Let the speed grow by at most one step; slowing down is immediate, and the other direction starts from 0."""
    start_mps = last_mps if last_mps * wanted_mps > 0 else 0.0
    if abs(wanted_mps) <= abs(start_mps):
        return wanted_mps
    return math.copysign(min(abs(wanted_mps), abs(start_mps) + max(step_mps, 0.0)), wanted_mps)
