"""Readers that know nothing of wallride, at a running car: plain zenoh, and others' decoders of ROS 2 messages."""

import asyncio
import json
import math

import numpy as np
import pytest
import zenoh
from mcap.records import Schema
from mcap_ros2.decoder import DecoderFactory

from tests.runtime.ros.test_messages import AckermannDriveStamped, LaserScan
from wallride.runtime.ros.definitions import SCHEMA_ENCODING, definition
from wallride.runtime.wire.ports import free_endpoint
from wallride.sim.live.runtime_process import WallrideProcess

pytestmark = pytest.mark.timeout(60)
TOPICS = ("scan", "odom", "output", "status")


def first_of_each(endpoint):
    """Return payload and encoding of the first sample of each topic and of the first drive; None without a car."""
    config = zenoh.Config()
    config.insert_json5("mode", '"client"')
    config.insert_json5("connect/endpoints", json.dumps([endpoint]))
    heard = {}
    try:
        session = zenoh.open(config)
    except zenoh.ZError:
        return None
    with session, session.declare_subscriber("wallride/*/*") as subscriber:
        for sample in subscriber:
            topic, payload = str(sample.key_expr).rpartition("/")[2], sample.payload.to_bytes()
            drives = topic != "output" or AckermannDriveStamped.deserialize(payload).drive.speed > 0
            if topic in TOPICS and drives:
                heard.setdefault(topic, (payload, str(sample.encoding)))
            if len(heard) == len(TOPICS):
                return heard
    raise AssertionError("the session ended first")


@pytest.fixture
async def heard(tmp_path):
    endpoint = free_endpoint()
    where = [f'telemetry.listen=["{endpoint}"]', f"recording.folder={tmp_path}"]
    car = WallrideProcess(
        ["sim", "loop", "--headless", "--duration", "30", *(part for one in where for part in ("--set", one))]
    )
    await car.start()
    try:
        async with asyncio.timeout(30):
            while (found := await asyncio.to_thread(first_of_each, endpoint)) is None:
                await asyncio.sleep(0.1)  # it does not listen yet
        yield found
    finally:
        await car.stop()


async def test_what_is_on_the_air_is_what_the_samples_say_it_is(heard):
    scan, encoding = heard["scan"]
    assert encoding == "application/cdr;sensor_msgs/msg/LaserScan"
    ranges_m = np.array(LaserScan.deserialize(scan).ranges, np.float32)
    assert ranges_m.size == 1081
    assert 0.5 < np.median(ranges_m) < 10, "the walls of the loop"
    output = AckermannDriveStamped.deserialize(heard["output"][0])
    assert 0 < output.drive.speed <= 3
    odom, encoding = heard["odom"]
    schema = encoding.partition(";")[2]
    record = Schema(id=1, name=schema, encoding=SCHEMA_ENCODING, data=definition(schema).encode())
    decode = DecoderFactory().decoder_for("cdr", record)
    assert decode is not None
    pose = decode(odom).pose.pose
    assert math.hypot(pose.orientation.z, pose.orientation.w) == pytest.approx(1.0)
    status, encoding = heard["status"]
    assert encoding == "application/json"
    assert {"lidar", "battery"} <= json.loads(status).keys()
