"""Mechanics behind the emulated VESC: its demand moves the vehicle; meters and inertial sensor see the result."""

import math
import random
from collections.abc import Iterator
from typing import Final

from wallride.drivers.vesc.replies import STANDARD_GRAVITY_MPS2
from wallride.drivers.vesc.settings import VescSettings
from wallride.sim.car.vehicle import BrakeDemand, CoastDemand, Demand, SpeedDemand, Vehicle
from wallride.sim.devices.esc import EmulatedEsc
from wallride.sim.devices.maestro import MaestroEmulator
from wallride.sim.devices.own import OwnMotorEmulator
from wallride.sim.devices.vesc import MotorDemand, VescEmulator
from wallride.sim.world.pose import Pose

MEMS_BIAS_G: Final = (0.02, -0.015, 0.03)
MEMS_BIAS_DEGPS: Final = (0.3, -0.2, 0.4)
MEMS_SCALE: Final = 1.01
NOISE_G, NOISE_DEGPS = 0.01, 0.1
_SEED: Final = 11
STEP_S = 0.0025
PART_S, PAUSED_S = 0.02, 0.25
"""Longest part of a catch-up: at 8 m/s no wall is passed in it; and time after which a process was stopped, as with its
container, rather than late."""
IMU_S = 0.0095
"""Time over which the emulated inertial sensor averages, about its 100 Hz."""


class EmulatedImu:
    """Measures a vehicle at the rear axle, x forward, y left, z up; call `measure` with each step of it.

    Bias, scale error and noise are of the kind that small MEMS sensors show after their own calibration.
    """

    def __init__(self, vehicle: Vehicle) -> None:
        self._vehicle = vehicle
        self._before = vehicle.twist
        self._random = random.Random(_SEED)

    def measure(self, over_s: float) -> tuple[float, ...]:
        """Return the 16 numbers of GET_IMU_DATA (rad, g, deg/s, uT, quaternion w x y z), of the time since the last.

        Accelerations beyond 4 g are cut off, as of a car that hits something.
        """
        before, now = self._before, self._vehicle.twist
        self._before = now
        rate_radps = now.yaw_rate_radps
        along_mps2 = (now.speed_mps - before.speed_mps) / over_s - rate_radps * now.lateral_mps
        aside_mps2 = (now.lateral_mps - before.lateral_mps) / over_s + rate_radps * now.speed_mps
        true_g = along_mps2 / STANDARD_GRAVITY_MPS2, aside_mps2 / STANDARD_GRAVITY_MPS2, 1.0
        true_degps = 0.0, 0.0, math.degrees(rate_radps)
        yaw_rad = self._vehicle.pose.yaw_rad
        return (
            0.0, 0.0, yaw_rad,
            *(max(-4.0, min(one, 4.0)) for one in self._reported(true_g, MEMS_BIAS_G, NOISE_G)),
            *self._reported(true_degps, MEMS_BIAS_DEGPS, NOISE_DEGPS),
            0.0, 0.0, 0.0, math.cos(yaw_rad / 2), 0.0, 0.0, math.sin(yaw_rad / 2),
        )  # fmt: skip

    def _reported(self, true: tuple[float, ...], bias: tuple[float, ...], noise: float) -> list[float]:
        return [MEMS_SCALE * one + of + self._random.gauss(0.0, noise) for one, of in zip(true, bias, strict=True)]


class Plant:
    """Steps the vehicle to the present in fixed steps, so that a run depends on the clock only through its commands.

    wiring: the true gains of this car; the runtime's settings should agree with them.
    """

    def __init__(
        self,
        vehicle: Vehicle,
        vesc: VescEmulator | MaestroEmulator | EmulatedEsc | OwnMotorEmulator,
        wiring: VescSettings,
        start_s: float,
    ) -> None:
        self.vehicle = vehicle
        self._vesc = vesc
        self._wiring = wiring
        self._now_s = start_s
        self._tachometer_steps = 0.0
        self._imu, self._measured_s = EmulatedImu(vehicle), start_s
        self.crashed = False

    def advance(self, to_s: float) -> None:
        """Advance the time; a crashed car stays at the point of impact."""
        while self._now_s + STEP_S <= to_s:
            self._now_s += STEP_S
            if not self.crashed:
                demand = _demand(self._vesc.demand(self._now_s), self._wiring)
                self.vehicle.step(STEP_S, demand, self.steering_rad)
                # Six commutation steps an electrical revolution: metres per step = 10 / gain (vesc.md, section 8).
                metres_per_step = 10 / self._wiring.speed_to_erpm_gain
                self._tachometer_steps += self.vehicle.wheel_speed_mps * STEP_S / metres_per_step
        self._report()

    def catch_up(self, to_s: float) -> Iterator[float]:
        """Advance the time part by part, and yield it after each, to look for a contact.

        While its process did not run, beyond PAUSED_S, the car stood still: it does not drive on in one go, blind.
        """
        self._now_s = max(self._now_s, to_s - PAUSED_S)
        at_s = self._now_s
        while at_s < to_s:
            at_s = min(to_s, at_s + PART_S)
            self.advance(at_s)
            yield at_s

    def crash(self) -> None:
        """Stop at once: the car hit something."""
        self.crashed = True

    def put_back(self, start: Pose) -> None:
        """Let a car that hit something stand at its start, ready to drive; another one drives on."""
        if self.crashed:
            self.vehicle.place(start)
            self.crashed = False

    @property
    def steering_rad(self) -> float:
        """Return the commanded servo angle, before its delay and slew."""
        wiring = self._wiring
        return (self._vesc.servo - wiring.steering_to_servo_offset) / wiring.steering_to_servo_gain

    def _report(self) -> None:
        wheel_mps = 0.0 if self.crashed else self.vehicle.wheel_speed_mps
        erpm = wheel_mps * self._wiring.speed_to_erpm_gain + (
            self._wiring.speed_to_erpm_offset if abs(wheel_mps) > 0 else 0.0
        )
        self._vesc.report(erpm=round(erpm), tachometer=math.floor(self._tachometer_steps))
        if self._now_s - self._measured_s >= IMU_S:
            self._vesc.imu = self._imu.measure(self._now_s - self._measured_s)
            self._measured_s = self._now_s


def _demand(demand: MotorDemand, wiring: VescSettings) -> Demand:
    match demand.kind:
        case "speed":
            return SpeedDemand((demand.value - wiring.speed_to_erpm_offset) / wiring.speed_to_erpm_gain)
        case "brake":
            return BrakeDemand(demand.value)
        case _:  # currents and duty are never commanded by our driver; a released motor coasts
            return CoastDemand()
