"""Fixtures of the tests of this folder."""

from collections.abc import AsyncIterator
from pathlib import Path
from typing import Any

import pytest

from tests import wire_time
from tests.drivers.turning.rig import MakeRig, Rig, stop
from wallride.sim.devices.turning import TurningEmulator

pytest_asyncio_loop_factories = wire_time.chosen


@pytest.fixture
async def plugged(tmp_path: Path) -> AsyncIterator[MakeRig]:
    """A rig maker over a serial port, for emulators that are prepared first."""
    rigs: list[Rig] = []

    async def make(emulator: TurningEmulator, **settings: Any) -> Rig:
        emulator.start_serial(tmp_path / "lidar")
        rigs.append(Rig(emulator, f"serial://{tmp_path / 'lidar'}", **settings))
        return rigs[-1]

    yield make
    for rig in rigs:
        await stop(rig)
        rig.emulator.close()


@pytest.fixture
async def bridged() -> AsyncIterator[MakeRig]:
    """A rig maker over a TCP bridge."""
    rigs: list[Rig] = []

    async def make(emulator: TurningEmulator, **settings: Any) -> Rig:
        rigs.append(Rig(emulator, f"tcp://127.0.0.1:{await emulator.start_tcp()}", **settings))
        return rigs[-1]

    yield make
    for rig in rigs:
        await stop(rig)
        rig.emulator.close()
