"""A car whose scans come over a real zenoh session: it drives by them, and a second publisher stops it."""

import asyncio
import time
from contextlib import asynccontextmanager

import pytest

from tests.system.bench import STARTS_WITHIN_S, bench
from wallride.drivers.hokuyo.driver import Hokuyo
from wallride.drivers.hokuyo.settings import HokuyoSettings
from wallride.runtime.ending import end
from wallride.runtime.ros.graph import scan_source
from wallride.runtime.ros.messages import ros_laser_scan
from wallride.runtime.wire.bus import Bus
from wallride.runtime.wire.network import CDR
from wallride.runtime.wire.ports import free_endpoint, is_taken
from wallride.runtime.wire.rmw_zenoh import Distro, RosGraph, attachment
from wallride.runtime.wire.zenoh_config import client_config

pytestmark = pytest.mark.timeout(90)
KEY = RosGraph(0, Distro.JAZZY, "lidar").data_key(scan_source("lidar/scan"))


class Publisher:
    """A driver of ROS 2 in the test: reads the emulated Hokuyo, and publishes what it measures."""

    def __init__(self, bus, gid):
        self.bus, self.gid, self.sequence = bus, gid, 0
        self.rival = None

    def send(self, scan):
        self.sequence += 1
        stamp_ns = time.time_ns() - round((time.monotonic() - scan.stamp_s) * 1e9)
        note = attachment(self.sequence, time.time_ns(), self.gid)
        self.bus.put_attached(KEY, ros_laser_scan(stamp_ns, scan, 0.025), encoding=CDR, attachment=note)
        if self.rival is not None:
            # Half a scan later: of two at once the session's limit on the rate lets one in.
            asyncio.get_running_loop().call_later(0.0125, self.rival.send, scan)


@asynccontextmanager
async def published(tmp_path):
    endpoint = free_endpoint()
    settings = "lidar.driver=topic", "ros2.enabled=true", "telemetry.enabled=true", f'telemetry.listen=["{endpoint}"]'
    async with bench(tmp_path, *settings) as car:
        bus = Bus(client_config(endpoint, None))
        await car.until(lambda: is_taken(endpoint), "listening", STARTS_WITHIN_S)
        await bus.open()
        first = Publisher(bus, b"a" * 16)
        sensor = Hokuyo(HokuyoSettings(address=f"tcp://127.0.0.1:{car.lidar_port}"))
        reading = asyncio.create_task(sensor.run(first.send))
        try:
            yield car, first, bus
        finally:
            await end(reading)
            await bus.close()


async def test_it_drives_by_the_topic_and_a_second_publisher_stops_it(tmp_path):
    async with published(tmp_path) as (car, first, bus):
        await car.until_driving()
        since_s, first.rival = time.monotonic(), Publisher(bus, b"b" * 16)
        await car.until(lambda: car.first_brake_s(since_s) < since_s + 1.0, "braking", 2.0)
        await car.until(lambda: car.wheel_mps < 0.05, "standing", 3.0)
        assert any("two publishers" in line for line in car.runtime.log)
