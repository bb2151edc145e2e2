"""Fixtures of the tests of this folder."""

import pytest

from tests import wire_time
from tests.drivers.hokuyo.rig import Rig, sensor
from tests.drivers.lidar_rig import over_serial, over_tcp, rigs

pytest_asyncio_loop_factories = wire_time.chosen


@pytest.fixture
async def tcp():
    """A rig maker over TCP."""
    async with rigs(Rig, over_tcp) as make:
        yield make


@pytest.fixture
async def serial(tmp_path):
    """A rig maker over a serial port."""
    async with rigs(Rig, over_serial, tmp_path) as make:
        yield make


@pytest.fixture(params=["tcp", "serial"])
async def rig(request, tcp, serial):
    return await {"tcp": tcp, "serial": serial}[request.param](sensor())
