"""Clamps every command to the car's limits, the last rules before the wire."""

import math

from wallride.drivers.api import Drive
from wallride.runtime.control.vehicle import GRAVITY_MPS2, CarSettings

ASIDE_MPS2 = 2.0
"""Lateral force of the front axle per mass of the car, half of its grip on a good floor."""


class Limiter:
    """Clamps steering and speed, and limits their rates, to those of the car's mechanics.

    Slowing down is never delayed: a smoother that stands between "stop" and the brake is a fault, not a comfort.
    A stop that may only brake with b leaves a car v - (b + c) t of its speed, where c is what turned front wheels take
    (their side force times the sine of their angle), and a speed that is allowed again rises from there. From zero, the
    motor would brake the rolling car down to the first step, with the grip that turns it. A brake with all there is
    leaves more than one of 1 g would: no floor gives more.
    """

    def __init__(self, car: CarSettings) -> None:
        self._car = car
        self._last = Drive(0.0, 0.0)
        self._rolls_mps = 0.0

    def tune(self, car: CarSettings) -> None:
        """Change the limits, from the next drive on; a lower speed takes effect like a stop, never delayed."""
        self._car = car

    def limit(self, speed_mps: float, steering_rad: float | None, dt_s: float, brake_mps2: float = math.inf) -> Drive:
        """Return the drive that may be sent now, dt_s after the previous call; steering None holds the wheels.

        brake_mps2 is passed on: how hard to brake is safety's business, not the mechanics'.
        """
        self._rolls_mps = self._last.speed_mps or self._left_mps(dt_s)
        steering_rad = self._last.steering_rad if steering_rad is None else steering_rad
        self._last = Drive(self._speed(speed_mps, dt_s), self._steering(steering_rad, dt_s), brake_mps2)
        return self._last

    def standstill(self) -> None:
        """Forget the speed: nothing was sent, or another source stopped the car."""
        self._last = Drive(0.0, self._last.steering_rad)
        self._rolls_mps = 0.0

    def braked(self) -> None:
        """Note that the last drive went out as a brake: like after a stop, the speed rises from what that leaves."""
        self._last = Drive(0.0, self._last.steering_rad, self._last.brake_mps2)

    def _left_mps(self, dt_s: float) -> float:
        """Return the minimum speed remaining after the last stop command."""
        brake_mps2 = min(self._last.brake_mps2, GRAVITY_MPS2)
        lost_mps = (brake_mps2 + ASIDE_MPS2 * math.sin(abs(self._last.steering_rad))) * dt_s
        left_mps = max(0.0, abs(self._rolls_mps) - lost_mps)
        return math.copysign(left_mps, self._rolls_mps)

    def _speed(self, wanted_mps: float, dt_s: float) -> float:
        wanted_mps = max(-self._car.max_reverse_mps, min(self._car.max_speed_mps, wanted_mps))
        last_mps = self._rolls_mps
        if last_mps * wanted_mps < 0:
            return 0.0  # through standstill, never from gear to gear
        if abs(wanted_mps) <= abs(last_mps):
            return wanted_mps
        step_mps = self._car.max_acceleration_mps2 * dt_s
        return math.copysign(min(abs(wanted_mps), abs(last_mps) + step_mps), wanted_mps)

    def _steering(self, wanted_rad: float, dt_s: float) -> float:
        most_rad = self._car.max_steering_rad
        step_rad = self._car.steering_rate_radps * dt_s
        wanted_rad = max(-most_rad, min(most_rad, wanted_rad))
        return max(self._last.steering_rad - step_rad, min(self._last.steering_rad + step_rad, wanted_rad))
