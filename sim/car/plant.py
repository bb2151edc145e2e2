"""Mechanics behind the emulated VESC: its demand moves the vehicle, and it receives the resulting state."""

import math

from wallride.drivers.vesc.settings import VescSettings
from wallride.sim.car.inertia import EmulatedImu
from wallride.sim.car.vehicle import BrakeDemand, CoastDemand, Demand, SpeedDemand, Vehicle
from wallride.sim.devices.esc import EmulatedEsc
from wallride.sim.devices.maestro import MaestroEmulator
from wallride.sim.devices.own import OwnMotorEmulator
from wallride.sim.devices.vesc import MotorDemand, VescEmulator
from wallride.sim.world.pose import Pose

STEP_S = 0.0025
IMU_S = 0.0095
"""Time over which the emulated inertial sensor averages, about its 100 Hz."""


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
