"""Fixtures of the tests of this folder."""

from collections.abc import AsyncIterator
from pathlib import Path

import pytest

from tests import wire_time
from tests.drivers.vesc.rig import controller
from wallride.sim.devices.vesc import VescEmulator

pytest_asyncio_loop_factories = wire_time.chosen


@pytest.fixture
async def emulator(tmp_path: Path) -> AsyncIterator[VescEmulator]:
    emulator = controller(tmp_path)
    emulator.start()
    yield emulator
    emulator.close()
