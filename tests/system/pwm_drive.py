"""A car without a tachometer, whole and in virtual time: the unmodified runtime, a PCA9685 behind its bus, an ESC that
drives a quarter faster than its settings say, and a simulated car whose scans alone tell the speed."""

import asyncio
from collections.abc import Callable
from typing import Any, Final, Never

import numpy as np
import numpy.typing as npt

from tests.system.timed_drive import drive_for
from wallride.drivers.api import Health, Scan
from wallride.drivers.pca9685.driver import Pca9685
from wallride.drivers.pca9685.settings import Pca9685Settings
from wallride.drivers.vesc.settings import VescSettings
from wallride.runtime.app import Car
from wallride.runtime.settings.tree import Settings
from wallride.sim.car.plant import Plant
from wallride.sim.car.vehicle import Vehicle
from wallride.sim.devices.esc import EmulatedEsc, esc_of
from wallride.sim.devices.lidar_kinds import HOKUYO, assignments
from wallride.sim.devices.pca9685 import Pca9685Chip
from wallride.sim.virtual.closed_loop import ROUGH_BEAMS, as_scan
from wallride.sim.virtual.devices import MemoryBus, MemoryLidar
from wallride.sim.virtual.turning_sensor import TurningSensor
from wallride.sim.virtual.virtual_time import run_virtual
from wallride.sim.world.beams import LidarSettings, scan
from wallride.sim.world.worlds import load_world

LEFT_RAD: Final = np.radians(np.linspace(30.0, 150.0, 121))
READ_EVERY_S: Final = 0.005


class TurningMemoryLidar:
    """A lidar of a full circle: `measure` is called as often as its bytes are read, and returns the whole scans."""

    def __init__(self, measure: Callable[[], list[Scan]], health: Health) -> None:
        self._measure, self.health = measure, health

    async def run(self, on_scan: Callable[[Scan], None]) -> Never:
        while True:
            await asyncio.sleep(READ_EVERY_S)
            for one in self._measure():
                on_scan(one)


class PwmDrive:
    """A drive. lidar: a word of the command line; beams: the noise of its ranges; motor: settings of it.

    seen: time, true speed, distance to the wall on the left, and whether the scans do not tell the speed, of each look
    of the lidar. touched: whether the car touched a wall.
    """

    def __init__(
        self, world: str, speed_mps: float = 1.0, lidar: str = HOKUYO, beams: LidarSettings = ROUGH_BEAMS,
        seed: int = 5, **motor: float,
    ) -> None:  # fmt: skip
        self.world = load_world(world, side="left")
        self.settings = Settings.model_validate({
            "lidar": dict(one.removeprefix("lidar.").split("=") for one in assignments(lidar)),
            "motor": {"driver": "pca9685", **motor},
            "operator": {"permit": "always"},
            "wall_follow": {"speed_mps": speed_mps},
            "telemetry": {"enabled": False},
        })  # fmt: skip
        self.seen: list[tuple[float, float, float, bool]] = []
        self.touched = False
        self._lidar, self._beams, self._rng = lidar, beams, np.random.default_rng(seed)

    def run(self, seconds: float, *events: tuple[float, Callable[["PwmDrive"], object]]) -> npt.NDArray[np.float64]:
        """Drive so long; each event is called with this drive at its time. Return what was seen, (n, 4)."""
        run_virtual(self._drive(seconds, events))
        return np.array(self.seen, float)

    def reason(self) -> str:
        """Return why the car does what it does."""
        return self.car.mux.output.decision.reason

    async def _drive(self, seconds: float, events: Any) -> None:
        loop = asyncio.get_running_loop()
        assert isinstance(self.settings.motor, Pca9685Settings)
        self.esc = EmulatedEsc(esc_of(self.settings.motor))
        self.chip = Pca9685Chip(self.esc, clock=loop.time)
        self.vehicle = Vehicle(pose=self.world.start)
        self.plant = Plant(self.vehicle, self.esc, VescSettings(), loop.time())
        self.motor = Pca9685(self.settings.motor, clock=loop.time, open_bus=self.chip.open)
        self.car = Car(self.settings, self._fitted(loop.time), self.motor, MemoryBus(loop.time), loop.time)
        await drive_for(seconds, self.car, self, events)

    def _fitted(self, clock: Callable[[], float]) -> MemoryLidar | TurningMemoryLidar:
        """Return the lidar of this car."""
        if self._lidar == HOKUYO:
            return MemoryLidar(self._ranges_m, clock)
        sensor = TurningSensor(self._lidar, self._beams, self.settings.car, lambda: self.motor.state, self._rng)

        def measure() -> list[Scan]:
            now_s = clock()
            self._look(now_s)
            return sensor.measure(now_s, self.world, self.vehicle.pose)

        return TurningMemoryLidar(measure, sensor.health)

    def _ranges_m(self, now_s: float) -> npt.NDArray[np.float32]:
        self._look(now_s)
        sent_mm = scan(self.world, self.vehicle.pose, self.vehicle.twist, now_s, self._rng, self._beams)
        return as_scan(sent_mm, self._beams, now_s, 0).ranges_m

    def _look(self, now_s: float) -> None:
        """Move the car on, and note where it is."""
        self.plant.advance(now_s)
        pose = self.vehicle.pose
        wall_m = float(self.world.cast(pose.x_m, pose.y_m, LEFT_RAD + pose.yaw_rad).min())
        blind = any("the scans do not tell the speed" in words for words in self.motor.words)
        self.seen.append((now_s, self.vehicle.speed_mps, wall_m, blind))
        self.touched = self.touched or self.world.collides(pose)
