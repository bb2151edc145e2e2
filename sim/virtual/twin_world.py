"""Simulated car in a simulated world behind the in-memory devices: the whole process drives it in virtual time.

The world has no thread of its own. A request for a scan or the motor's state, or a command, first advances the world to
the clock's now, in steps of 2.5 ms; so the same story gives the same run, bit by bit.
"""

import math
from collections.abc import Callable
from dataclasses import replace

import numpy as np
import numpy.typing as npt

from wallride.drivers.api import Clock, Drive, LinkState, MotorState
from wallride.drivers.vesc.app_config import RECOMMENDED_BRAKE_A
from wallride.drivers.vesc.settings import VescSettings
from wallride.sim.car.vehicle import BrakeDemand, CoastDemand, Demand, SpeedDemand, Vehicle, VehicleSettings
from wallride.sim.car.wiring import NO_ERRORS, WiringConversion, WiringErrors
from wallride.sim.virtual.closed_loop import ROUGH_BEAMS, STANDING_BELOW_MPS, STEP_S, as_scan
from wallride.sim.virtual.devices import MemoryLidar, MemoryMotor
from wallride.sim.world.beams import LidarSettings, Millimetres, scan
from wallride.sim.world.obstacles import Obstacle, ObstacleWorld
from wallride.sim.world.place import World
from wallride.sim.world.pose import Pose

_WIRING = VescSettings()


class TwinWorld:
    """Ground truth. pose, speed: of the car, moved on by `advance`. contact_mps: speed at the first touch, None before.

    A car that touches something stops dead and stays there. way_m: driven so far. cover: as that of a Case.
    """

    def __init__(
        self,
        world: World,
        clock: Clock,
        *,
        start: Pose | None = None,
        vehicle: VehicleSettings | None = None,
        lidar: LidarSettings = ROUGH_BEAMS,
        obstacles: tuple[Obstacle, ...] = (),
        seed: int = 0,
    ) -> None:
        self.world = world
        self.scene = ObstacleWorld(world, obstacles)
        self.vehicle = Vehicle(vehicle, start or world.start)
        self.lidar_settings = lidar
        self.steering_rad = 0.0
        self.demand: Demand = CoastDemand()
        self.contact_mps: float | None = None
        self.way_m = 0.0
        self.cover: Callable[[Millimetres, float], Millimetres] | None = None
        self._clock = clock
        self._now_s = clock()
        self._steps = 0
        self._free_m = 0.0
        self._rng = np.random.default_rng(seed)

    def advance(self) -> None:
        """Advance to now."""
        while (self._steps + 1) * STEP_S + self._now_s <= self._clock() + 1e-9:
            self._steps += 1
            self._step(self._now_s + self._steps * STEP_S)

    def ranges_at(self, now_s: float) -> npt.NDArray[np.float32]:
        """Return the scan that the driver would make of the sensor's, (beams,), metres, NaN without a distance."""
        self.advance()
        self._look(now_s)
        reported_mm = scan(self.scene, self.vehicle.pose, self.vehicle.twist, now_s, self._rng, self.lidar_settings)
        if self.cover is not None:
            reported_mm = self.cover(reported_mm, now_s)
        return as_scan(reported_mm, self.lidar_settings, now_s, 0).ranges_m

    def _step(self, now_s: float) -> None:
        if self.contact_mps is not None:
            return
        vehicle = self.vehicle
        vehicle.step(STEP_S, self.demand, self.steering_rad)
        moved_m = abs(vehicle.speed_mps) * STEP_S
        self.way_m += moved_m
        self._free_m -= 2 * moved_m + 4.0 * STEP_S * bool(self.scene.obstacles)  # people walk, and corners turn faster
        if self._free_m <= 0.0:
            self._look(now_s)

    def _look(self, now_s: float) -> None:
        """Move the obstacles, and check whether the car touches one."""
        vehicle = self.vehicle
        self.scene.update(now_s, vehicle.pose, vehicle.speed_mps)
        self._free_m = self.scene.clearance(vehicle.pose)
        if self._free_m <= 0.0 and self.contact_mps is None:
            self.contact_mps = abs(vehicle.speed_mps)
            vehicle.halt()


class WorldLidar(MemoryLidar):
    """The lidar of a twin world; `pull` and `plug` its cable."""

    def __init__(self, twin: TwinWorld, clock: Clock) -> None:
        super().__init__(self._seen, clock, twin.lidar_settings.rate_hz)
        self.ray_s = twin.lidar_settings.ray_s
        self._twin = twin
        self._plugged = True

    def pull(self) -> None:
        """Pull the cable: no more scans, and the driver notices."""
        self._plugged = False
        self.health.link = LinkState.ABSENT
        self.health.message = "cable pulled"

    def plug(self) -> None:
        """Plug it in again."""
        self._plugged = True
        self.health.link = LinkState.READY
        self.health.message = "in memory"

    def _seen(self, now_s: float) -> npt.NDArray[np.float32] | None:
        return self._twin.ranges_at(now_s) if self._plugged else None


class WorldMotor(MemoryMotor):
    """Motor controller of a twin world; accepts commands as the VESC's driver does and reports the wheels' true state.

    present: False is a pulled cable; the controller then brakes by itself. As the driver does, it brakes while a fault
    is latched; it has none of its own. errors: of the settings. phases_swapped: the wheels turn the other way, and the
    controller reports the requested direction.
    """

    def __init__(self, twin: TwinWorld, clock: Clock, errors: WiringErrors = NO_ERRORS) -> None:
        super().__init__(clock)
        self._twin = twin
        self._wiring = WiringConversion(_WIRING, errors.wired(_WIRING)) if errors != NO_ERRORS else None
        self._allowed_rad = 0.0
        self.phases_swapped = False

    @property
    def state(self) -> MotorState | None:
        """Return the controller's report: speed and way in its own whole numbers."""
        if not self.present:
            return None
        self._twin.advance()
        vehicle, gain = self._twin.vehicle, _WIRING.speed_to_erpm_gain
        steps_m = 10.0 / gain
        sign, steering_rad = -1.0 if self.phases_swapped else 1.0, self._twin.steering_rad
        if self._wiring is not None:
            sign, steering_rad = sign / self._wiring.speed_share, self._allowed_rad
        return MotorState(
            self._clock(), sign * round(vehicle.wheel_speed_mps * gain) / gain,
            sign * math.floor(vehicle.wheel_travel_m / steps_m) * steps_m, steering_rad, 11.8,
            vehicle.motor_current_a, 0.0, 30.0, self.fault,
        )  # fmt: skip

    @property
    def braked_instead(self) -> bool:
        """Whether it braked in place of a speed: while a fault is latched."""
        return bool(self.fault and self.wire and self.wire[-1][1].speed_mps)

    def send(self, drive: Drive) -> bool:
        """Pass a command on to the wheels; False while the cable is pulled."""
        if not self.present:
            return False
        self._twin.advance()
        self.wire.append((self._clock(), drive))
        speed_mps = 0.0 if self.fault else -drive.speed_mps if self.phases_swapped else drive.speed_mps
        steering_rad = drive.steering_rad
        if self._wiring is not None:
            speed_mps *= self._wiring.speed_share
            self._allowed_rad = self._wiring.allowed_rad(steering_rad)
            steering_rad = self._wiring.steering_rad(steering_rad)
        self._twin.demand = demand_of(replace(drive, speed_mps=speed_mps), self._twin.vehicle)
        self._twin.steering_rad = steering_rad
        return True

    def pull(self) -> None:
        """Pull the cable; `brake_by_itself` is due RECOMMENDED_TIMEOUT_S later."""
        self._twin.advance()
        self.present = False

    def brake_by_itself(self) -> None:
        """Brake as the controller does after its timeout without commands."""
        self._twin.advance()
        if not self.present:
            self._twin.demand = BrakeDemand(RECOMMENDED_BRAKE_A)

    def plug(self) -> None:
        """Plug the cable in again."""
        self._twin.advance()
        self.present = True

    def retry_fault(self) -> None:
        """Keep the latched fault."""


def demand_of(drive: Drive, vehicle: Vehicle) -> Demand:
    """Return the driver's demand for a command: too slow, or against the motion, is a brake."""
    wheels_mps = vehicle.wheel_speed_mps
    turns_back = drive.speed_mps * wheels_mps < 0 and abs(wheels_mps) > STANDING_BELOW_MPS
    if abs(drive.speed_mps) >= _WIRING.min_speed_mps and not turns_back:
        return SpeedDemand(drive.speed_mps)
    full_mps2 = _WIRING.brake_current_a * vehicle.settings.brake_mps2_per_a
    by_motor_mps2 = min(max(0.0, drive.brake_mps2 - vehicle.settings.drag_mps2), full_mps2)
    return BrakeDemand(by_motor_mps2 / vehicle.settings.brake_mps2_per_a)
