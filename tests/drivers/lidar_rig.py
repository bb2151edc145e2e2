"""A driver of a lidar that listens to an emulated sensor, for the tests of such drivers."""

import asyncio
from collections.abc import Awaitable, Callable
from contextlib import asynccontextmanager
from typing import Any

from wallride.drivers.api import Health, LinkState, Scan


class LidarRig:
    """A sensor, and a driver that listens; `scans` collects what came out."""

    limit_s, look_s = 20.0, 0.005

    def __init__(self, emulator: Any, driver: Any) -> None:
        self.clock = asyncio.get_running_loop().time
        self.emulator, self.driver = emulator, driver
        self.scans: list[Scan] = []
        self.task = asyncio.create_task(driver.run(self.scans.append))

    @property
    def health(self) -> Health:
        health: Health = self.driver.health
        return health

    @property
    def counts(self) -> dict[str, int]:
        return self.health.counts

    def link(self) -> LinkState:
        return self.health.link

    async def wait(self, condition: Callable[[], bool], meanwhile: Callable[[], object]) -> None:
        """Wait for a condition, doing something before each look; raise what ends the driver."""
        async with asyncio.timeout(self.limit_s):
            while not condition():
                if self.task.done():
                    self.task.result()
                meanwhile()
                await asyncio.sleep(self.look_s)

    async def stop(self) -> None:
        self.task.cancel()
        await asyncio.gather(self.task, return_exceptions=True)


async def over_tcp(emulator: Any, _folder: object) -> str:
    return f"tcp://127.0.0.1:{await emulator.start_tcp()}"


async def over_serial(emulator: Any, folder: Any) -> str:
    emulator.start_serial(folder / "lidar")
    return f"serial://{folder / 'lidar'}"


@asynccontextmanager
async def rigs(rig: Callable[..., Any], over: Callable[[Any, Any], Awaitable[str]], folder: Any = None):
    """Yield a rig maker, for emulators that are prepared first. query: of the address; settings: the driver's."""
    made = []

    async def make(emulator: Any, query: str = "", **settings: Any) -> Any:
        made.append(rig(emulator, await over(emulator, folder) + query, **settings))
        return made[-1]

    yield make
    for one in made:
        await one.stop()
        one.emulator.close()
