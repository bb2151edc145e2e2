"""Fixtures of the tests of this folder."""

from collections.abc import AsyncIterator
from pathlib import Path

import pytest

from wallride.sim.devices.vesc import VescEmulator


@pytest.fixture
async def emulator(tmp_path: Path) -> AsyncIterator[VescEmulator]:
    emulator = VescEmulator(tmp_path / "vesc")
    emulator.start()
    yield emulator
    emulator.close()
