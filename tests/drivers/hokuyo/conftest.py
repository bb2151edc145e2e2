"""Fixtures of the tests of this folder."""

from collections.abc import AsyncIterator
from pathlib import Path
from typing import Any

import pytest

from tests import wire_time
from tests.drivers.hokuyo.rig import MakeRig, Rig, sensor, stop
from wallride.sim.devices.scip import ScipEmulator

pytest_asyncio_loop_factories = wire_time.chosen


@pytest.fixture(params=["tcp", "serial"])
async def rig(request: pytest.FixtureRequest, tmp_path: Path) -> AsyncIterator[Rig]:
    emulator = sensor()
    if request.param == "tcp":
        address = f"tcp://127.0.0.1:{await emulator.start_tcp()}"
    else:
        emulator.start_serial(tmp_path / "lidar")
        address = f"serial://{tmp_path / 'lidar'}"
    rig = Rig(emulator, address, silent_after_s=0.3)
    yield rig
    await stop(rig)
    emulator.close()


@pytest.fixture
async def tcp() -> AsyncIterator[MakeRig]:
    """A rig maker over TCP, for emulators that are prepared first."""
    rigs: list[Rig] = []

    async def make(emulator: ScipEmulator, **settings: Any) -> Rig:
        address = f"tcp://127.0.0.1:{await emulator.start_tcp()}"
        rigs.append(Rig(emulator, address, **{"silent_after_s": 0.3, **settings}))
        return rigs[-1]

    yield make
    for rig in rigs:
        await stop(rig)
        rig.emulator.close()
