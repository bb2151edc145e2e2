"""The live server as a viewer sees it: every topic offered, a topic's very bytes on demand, nothing accepted."""

import argparse
import asyncio
import json

import pytest

from runtime.recording.channels import text_of
from runtime.ros.definitions import TYPES, encoding
from runtime.ros.messages import float32
from runtime.wire import topics, zenoh_config
from runtime.wire.bus import Bus, free_endpoint

pytest.importorskip("foxglove", reason="the extra [foxglove] is not installed")
aiohttp = pytest.importorskip("aiohttp", reason="the viewer of this test needs aiohttp")

SUBSCRIBE = {"op": "subscribe"}
MESSAGE_DATA, HEAD_B = 1, 1 + 4 + 8


@pytest.fixture
async def car():
    endpoint = free_endpoint()
    bus = Bus(zenoh_config.car_config([endpoint], None, (), "car1"))
    bus.announce(topics.key("car1", topics.ALIVE))
    await bus.open()
    yield bus, endpoint
    await bus.close()


@pytest.fixture
async def address(car):
    from clients import foxglove_server

    said = asyncio.Queue()
    options = argparse.Namespace(
        host="127.0.0.1", port=0, car=None, connect=car[1], session=None, keys=None, say=said.put_nowait
    )
    task = asyncio.create_task(foxglove_server.run(options))
    line = await asyncio.wait_for(said.get(), 15)
    yield line.split()[2]
    task.cancel()
    with pytest.raises(asyncio.CancelledError):
        await task


async def test_a_viewer_is_offered_everything_and_gets_the_cars_bytes(car, address):
    bus, _ = car
    key, status_key = topics.key("car1", topics.DISTANCE_ERROR), topics.key("car1", topics.STATUS)
    status = topics.encode({"state": "driving"})
    async with aiohttp.ClientSession() as session, session.ws_connect(address, protocols=["foxglove.sdk.v1"]) as viewer:
        info, channels = {}, {}
        async with asyncio.timeout(15):
            while set(channels) != {f"/{topic}" for topic in (*TYPES, topics.STATUS, topics.DECISION)}:
                said = json.loads((await viewer.receive()).data)
                info |= said if said["op"] == "serverInfo" else {}
                channels |= {channel["topic"]: channel for channel in said.get("channels", [])}
        assert info["name"] == "car1"
        assert "clientPublish" not in info["capabilities"]
        assert channels["/scan"]["schemaName"] == "sensor_msgs/msg/LaserScan"
        assert not bus.wanted(key, encoding=encoding(topics.DISTANCE_ERROR)), "nobody looks yet"

        ids = [channels[topic]["id"] for topic in ("/distance_error", "/status")]
        wishes = [{"id": place, "channelId": number} for place, number in enumerate(ids)]
        await viewer.send_json(SUBSCRIBE | {"subscriptions": wishes})
        heard = {}
        async with asyncio.timeout(15):
            while len(heard) < 2:
                bus.put(key, float32(0.25), encoding=encoding(topics.DISTANCE_ERROR))
                bus.put(status_key, status)
                try:
                    frame = await viewer.receive(timeout=0.1)
                except TimeoutError:
                    continue
                if frame.type is aiohttp.WSMsgType.BINARY and frame.data[0] == MESSAGE_DATA:
                    heard[int.from_bytes(frame.data[1:5], "little")] = frame.data[HEAD_B:]
        assert heard[0] == float32(0.25)
        assert text_of(heard[1]) == status
