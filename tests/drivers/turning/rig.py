"""A head that turns in a room and a driver that listens, for the tests of the drivers of turning lidars."""

import asyncio
from collections.abc import AsyncIterator, Callable
from contextlib import asynccontextmanager
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from tests.drivers.lidar_rig import LidarRig
from wallride.drivers.api import Scan
from wallride.drivers.rplidar.driver import Rplidar
from wallride.drivers.rplidar.settings import RplidarSettings
from wallride.drivers.turning.driver import TurningLidar
from wallride.drivers.turning.grid import AskMotion, standing
from wallride.drivers.ydlidar.driver import Ydlidar
from wallride.drivers.ydlidar.settings import YdlidarSettings
from wallride.runtime.ending import end
from wallride.sim.devices.rplidar import RplidarDevice
from wallride.sim.devices.turning import Rays, TurningEmulator
from wallride.sim.devices.ydlidar import YdlidarDevice

WALL_M, ROUND_M = 2.0, 3.0
"""A wall ahead at 2 m, and a round wall everywhere else."""
Floats = npt.NDArray[np.float64]
_RNG = np.random.default_rng(2)


def room_m(bearing_rad: Floats) -> Floats:
    """Return the true ranges of the room."""
    cos = np.cos(bearing_rad)
    return np.where(cos > WALL_M / ROUND_M, WALL_M / np.maximum(cos, 0.1), ROUND_M)


def room_mm(rays: Rays) -> npt.NDArray[np.int64]:
    """Return the same as the emulators want it: the lengths of rays that begin anywhere near the middle."""
    way = np.exp(1j * rays.bearing_rad)
    along_m = (rays.start_m * way.conjugate()).real
    round_m = np.sqrt(ROUND_M**2 - np.abs(rays.start_m) ** 2 + along_m**2) - along_m
    wall_m = (WALL_M - rays.start_m.real) / np.maximum(way.real, 0.01)
    noise_m = _RNG.normal(0.0, 0.004, way.size)
    mm: npt.NDArray[np.int64] = np.rint((np.minimum(round_m, wall_m) + noise_m) * 1000).astype(np.int64)
    return mm


@asynccontextmanager
async def turning(emulator: TurningEmulator, path: Path) -> AsyncIterator[TurningEmulator]:
    """Plug an emulated sensor into a serial port, and let its head turn."""
    emulator.start_serial(path)

    async def turn() -> None:
        while True:
            emulator.advance(asyncio.get_running_loop().time(), room_mm)
            await asyncio.sleep(0.004)

    running = asyncio.create_task(turn())
    try:
        yield emulator
    finally:
        await end(running)
        emulator.close()


class Rig(LidarRig):
    """An emulated sensor that turns, and a driver that listens."""

    look_s = 0.004

    def __init__(self, emulator: TurningEmulator, address: str, **settings: Any) -> None:
        super().__init__(emulator, driver_for(emulator, address, **settings))

    async def until(self, condition: Callable[[], bool]) -> None:
        """Wait for a condition while the head turns."""
        await self.wait(condition, lambda: self.emulator.advance(self.clock(), room_mm))

    async def more_scans(self, number: int = 3) -> list[Scan]:
        """Wait for so many further scans and return them."""
        before = len(self.scans)
        await self.until(lambda: len(self.scans) >= before + number)
        return self.scans[before:]

    async def run_for(self, duration_s: float) -> None:
        end_s = self.clock() + duration_s
        await self.until(lambda: self.clock() >= end_s)


def driver_for(emulator: TurningEmulator, address: str, **settings: Any) -> TurningLidar:
    """Return the driver that an emulated sensor needs."""
    settings = {"silent_after_s": 0.5, **settings}
    motion: AskMotion = settings.pop("motion", standing)
    clock = asyncio.get_running_loop().time
    if isinstance(emulator.device, YdlidarDevice):
        model = emulator.device.model
        named = {"model": model.name.lower()} if model.one_way else {}
        return Ydlidar(YdlidarSettings(address=address, **named, **settings), clock=clock, motion=motion)
    assert isinstance(emulator.device, RplidarDevice)
    return Rplidar(RplidarSettings(address=address, **settings), clock=clock, motion=motion)
