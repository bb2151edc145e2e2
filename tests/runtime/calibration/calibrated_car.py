"""A simulated car that is driven for a calibration, in virtual time and without a process: with errors to be found.

Scans, motor reports and commands come as often as over the network: 20 scans and 20 motor reports a second, each
command. The laws are not asked: as by hand, safety does not bind.
"""

import math
from dataclasses import dataclass

import numpy as np

from wallride.drivers.api import Drive, MotorState
from wallride.runtime.calibration.trace import TraceBuilder
from wallride.runtime.control.limiter import Limiter
from wallride.runtime.control.vehicle import CarSettings
from wallride.sim.car.vehicle import VehicleSettings
from wallride.sim.car.wiring import NO_ERRORS, WiringErrors
from wallride.sim.virtual.closed_loop import ROUGH_BEAMS, STEP_S, as_scan
from wallride.sim.virtual.twin_world import TwinWorld, WorldMotor
from wallride.sim.world.beams import LidarSettings, scan
from wallride.sim.world.place import World

SCAN_S, PUBLISHED = 0.025, 2
REPORT_S, POLL_S = 0.05, 0.0203
_VEHICLE = VehicleSettings()


@dataclass(frozen=True, slots=True)
class PlantedCar:
    """The true car. errors: of its settings."""

    vehicle: VehicleSettings = _VEHICLE
    lidar: LidarSettings = ROUGH_BEAMS
    errors: WiringErrors = NO_ERRORS


class VirtualCar:
    """Implements CalibratedCar over a TwinWorld. car, yaw_rad: settings in effect, the latter of the lidar."""

    def __init__(
        self, world: World, planted: PlantedCar, *, car: CarSettings | None = None, yaw_rad: float = 0.0, seed: int = 0
    ) -> None:
        self.seen = TraceBuilder()
        self._now_s = 0.0
        self.twin = TwinWorld(world, lambda: self._now_s, vehicle=planted.vehicle, lidar=planted.lidar, seed=seed)
        self.motor = WorldMotor(self.twin, lambda: self._now_s, planted.errors)
        self._limiter = Limiter(car or CarSettings())
        self._asked = Drive(0.0, 0.0)
        self._ticks = 0
        self._polled: MotorState | None = None
        self._yaw_rad = yaw_rad
        self._rng = np.random.default_rng(seed + 1)
        self._phase_s = float(self._rng.uniform(0.0, POLL_S))

    @property
    def now_s(self) -> float:
        """Return the present time."""
        return self._now_s

    def send(self, speed_mps: float, steering_rad: float) -> None:
        """Ask for a drive."""
        self._asked = Drive(speed_mps, steering_rad)

    def release(self) -> None:
        """Stop."""
        self._asked = Drive(0.0, 0.0)

    def wait(self) -> None:
        """Go on to the next published scan."""
        for _ in range(PUBLISHED):
            self._until_scan()
        at = scan(
            self.twin.scene, self.twin.vehicle.pose, self.twin.vehicle.twist, self._now_s, self._rng,
            self.twin.lidar_settings,
        )  # fmt: skip
        seen = as_scan(at, self.twin.lidar_settings, self._now_s, 0, self._yaw_rad)
        self.seen.kind = seen.angle_min_rad, seen.angle_step_rad, seen.ranges_m.size
        self.seen.sweep_s = self.twin.lidar_settings.sweep_s
        self.seen.scans.append((self._now_s, seen.ranges_m))

    def _until_scan(self) -> None:
        told = self._limiter.limit(self._asked.speed_mps, self._asked.steering_rad, SCAN_S)
        self.motor.send(told)
        if self.motor.braked_instead or self.twin.vehicle.wheel_speed_mps * told.speed_mps < 0:
            self._limiter.braked()
        self.seen.commands.append((self._now_s, told.speed_mps, told.steering_rad))
        for _ in range(round(SCAN_S / STEP_S)):
            self._ticks += 1
            self._now_s = self._ticks * STEP_S
            self.twin.advance()
            if self._is_due(POLL_S):
                self._polled = self.motor.state
            if self._is_due(REPORT_S) and (state := self._polled) is not None:
                self.seen.motor.append((state.stamp_s, state.distance_m, state.speed_mps, state.steering_rad))

    def _is_due(self, period_s: float) -> bool:
        before = math.floor((self._now_s - STEP_S + self._phase_s) / period_s)
        return math.floor((self._now_s + self._phase_s) / period_s) != before
