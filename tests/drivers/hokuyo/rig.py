"""A sensor that turns and a driver that listens, for the tests of the driver."""

import asyncio
from collections.abc import Awaitable, Callable
from typing import Any

import numpy as np
import numpy.typing as npt

from tests.drivers.lidar_rig import LidarRig
from wallride.drivers.api import LinkState, Scan
from wallride.drivers.hokuyo.driver import Hokuyo
from wallride.drivers.hokuyo.settings import HokuyoSettings
from wallride.sim.devices.scip import ScipEmulator
from wallride.sim.devices.scip_encode import UST_10LX, SensorModel

LIMIT_S = 8.0
Ranges = npt.NDArray[np.int_]


def sensor(model: SensorModel = UST_10LX) -> ScipEmulator:
    """Return a sensor by the clock of the loop."""
    return ScipEmulator(model, clock=asyncio.get_running_loop().time)


class Rig(LidarRig):
    """A sensor that turns, and a driver that listens."""

    limit_s = LIMIT_S
    emulator: ScipEmulator

    def __init__(self, emulator: ScipEmulator, address: str, **settings: Any) -> None:
        emulator.sensor.ahead_ms = self.stamp_ms = 16_777_100
        made = HokuyoSettings(address=address, **{"silent_after_s": 0.3, **settings})
        super().__init__(emulator, Hokuyo(made, clock=asyncio.get_running_loop().time))

    async def until(self, condition: Callable[[], bool], *, turning: bool = False) -> None:
        """Wait for a condition, publishing scans at 200 Hz meanwhile if the sensor is `turning`."""
        await self.wait(condition, self.turn if turning else lambda: None)

    def turn(self, ranges_mm: Ranges | None = None) -> float | None:
        """Publish one revolution 5 ms after the last; the stamp follows our clock, as a sensor's does."""
        self.stamp_ms = 16_777_100 + round(self.clock() * 1000)
        count = self.emulator.sensor.model.beam_count
        return self.emulator.publish(np.full(count, 1234) if ranges_mm is None else ranges_mm, self.stamp_ms)

    async def scan(self, ranges_mm: Ranges | None = None) -> Scan:
        """Publish one revolution and return the scan that comes out of it."""
        before = len(self.scans)
        await asyncio.sleep(0.002)
        assert self.turn(ranges_mm) is not None
        await self.until(lambda: len(self.scans) > before)
        return self.scans[-1]

    async def ready(self) -> None:
        await self.until(lambda: self.emulator.streaming)

    async def lost_and_found(self) -> None:
        """Wait until scans have stopped, and come again by themselves."""
        await self.until(lambda: self.emulator.streaming)
        before = len(self.scans)
        await self.until(lambda: len(self.scans) >= before + 3 and self.health.link is LinkState.READY, turning=True)


MakeRig = Callable[..., Awaitable[Rig]]
