"""Fixtures of the tests of this folder."""

import pytest

from tests import wire_time
from tests.drivers.lidar_rig import over_serial, over_tcp, rigs
from tests.drivers.turning.rig import Rig

pytest_asyncio_loop_factories = wire_time.chosen


@pytest.fixture
async def plugged(tmp_path):
    """A rig maker over a serial port."""
    async with rigs(Rig, over_serial, tmp_path) as make:
        yield make


@pytest.fixture
async def bridged():
    """A rig maker over a TCP bridge."""
    async with rigs(Rig, over_tcp) as make:
        yield make
