"""A sensor that turns and a driver that listens, for the tests of the driver."""

import asyncio
from collections.abc import Awaitable, Callable
from typing import Any

import numpy as np
import numpy.typing as npt

from wallride.drivers.api import Health, LinkState, Scan
from wallride.drivers.hokuyo.driver import Hokuyo
from wallride.drivers.hokuyo.settings import HokuyoSettings
from wallride.sim.devices.scip import ScipEmulator
from wallride.sim.devices.scip_encode import UST_10LX, SensorModel

LIMIT_S = 8.0
Ranges = npt.NDArray[np.int_]


def sensor(model: SensorModel = UST_10LX) -> ScipEmulator:
    """Return a sensor by the clock of the loop."""
    return ScipEmulator(model, clock=asyncio.get_running_loop().time)


class Rig:
    """A sensor that turns, and a driver that listens; `scans` collects what came out."""

    def __init__(self, emulator: ScipEmulator, address: str, **settings: Any) -> None:
        self.clock = asyncio.get_running_loop().time
        self.emulator = emulator
        emulator.sensor.ahead_ms = 16_777_100
        self.driver = Hokuyo(HokuyoSettings(address=address, **settings), clock=self.clock)
        self.scans: list[Scan] = []
        self.stamp_ms = 16_777_100
        self.task = asyncio.create_task(self.driver.run(self.scans.append))

    @property
    def health(self) -> Health:
        return self.driver.health

    def link(self) -> LinkState:
        return self.driver.health.link

    @property
    def counts(self) -> dict[str, int]:
        return self.driver.health.counts

    async def until(self, condition: Callable[[], bool], *, turning: bool = False) -> None:
        """Wait for a condition, publishing scans at 200 Hz meanwhile if the sensor is `turning`."""
        async with asyncio.timeout(LIMIT_S):
            while not condition():
                if self.task.done():
                    self.task.result()
                if turning:
                    self.turn()
                await asyncio.sleep(0.005)

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


async def stop(rig: Rig) -> None:
    rig.task.cancel()
    await asyncio.gather(rig.task, return_exceptions=True)
