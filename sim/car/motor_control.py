"""Motor controller from demand to force at the wheels. Facts: VESC firmware 6, see `VehicleSettings`."""

import math
from dataclasses import dataclass

from wallride.sim.car.vehicle_settings import VehicleSettings


@dataclass(frozen=True, slots=True)
class SpeedDemand:
    """Holds a speed, forward positive (SET_RPM). Zero is no brake: see MotorControl."""

    mps: float


@dataclass(frozen=True, slots=True)
class BrakeDemand:
    """Brakes with a current until the wheels stand; does not hold (SET_CURRENT_BRAKE)."""

    current_a: float


@dataclass(frozen=True, slots=True)
class CoastDemand:
    """Applies no current (SET_CURRENT 0)."""


Demand = SpeedDemand | BrakeDemand | CoastDemand
COAST = CoastDemand()


class MotorControl:
    """Converts demands into a driving and a braking acceleration at the wheels.

    A speed demand is ramped from the speed at which it began; once the ramp is below the lowest speed the
    controller can hold, there is no output and the car coasts, so a demand of zero rolls out.
    """

    def __init__(self, settings: VehicleSettings) -> None:
        self._ramp_mps2 = settings.ramp_mps2
        self._min_speed_mps = settings.min_speed_mps
        self._lag_s = settings.speed_lag_s
        self._drag_mps2 = settings.drag_mps2
        self._limit_mps2 = settings.drive_limit_mps2
        self._brake_mps2_per_a = settings.brake_mps2_per_a
        self._ramped_mps: float | None = None
        self.motor_mps2 = 0.0

    def reset(self) -> None:
        """Reset the ramp."""
        self._ramped_mps = None
        self.motor_mps2 = 0.0

    def forces(self, demand: Demand, wheel_mps: float, dt_s: float) -> tuple[float, float]:
        """Return (drive, brake) in m/s2: drive has a sign, brake (the motor's and the drag) opposes rolling.

        A drive that pushes against the rolling direction is the regenerating speed control.
        """
        if isinstance(demand, SpeedDemand):
            self.motor_mps2 = self._speed_control(demand.mps, wheel_mps, dt_s)
            return self.motor_mps2, self._drag_mps2
        self._ramped_mps = None
        if isinstance(demand, BrakeDemand):
            brake_mps2 = self._brake_mps2_per_a * abs(demand.current_a)
            self.motor_mps2 = -math.copysign(brake_mps2, wheel_mps) if wheel_mps else 0.0
            return 0.0, brake_mps2 + self._drag_mps2
        self.motor_mps2 = 0.0
        return 0.0, self._drag_mps2

    def _speed_control(self, set_mps: float, wheel_mps: float, dt_s: float) -> float:
        before = wheel_mps if self._ramped_mps is None else self._ramped_mps
        step = self._ramp_mps2 * dt_s
        ramped = min(max(set_mps, before - step), before + step)
        self._ramped_mps = ramped
        if abs(ramped) < self._min_speed_mps:
            return 0.0
        # Proportional to the error; the ramp and the drag stand for the integral term of the real controller.
        learnt = (ramped - before) / dt_s + math.copysign(self._drag_mps2, ramped)
        wanted = (ramped - wheel_mps) / self._lag_s + learnt
        return min(max(wanted, -self._limit_mps2), self._limit_mps2)
