"""The live server as a viewer sees it: topics, their very bytes on demand, settings, and the e-stop."""

import argparse
import asyncio
import json
from contextlib import asynccontextmanager

import pytest

from runtime.recording.channels import text_of
from runtime.ros.definitions import TYPES, encoding
from runtime.ros.messages import float32
from runtime.wire import topics, zenoh_config
from runtime.wire.bus import Bus
from runtime.wire.ports import free_endpoint
from tests.clients.monitor.fake_car import FakeCar

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
        host="127.0.0.1", port=0, car=None, connect=car[1], session=None, keys=None, print_line=said.put_nowait
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
        assert {"parameters", "clientPublish"} <= set(info["capabilities"])
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


@asynccontextmanager
async def watched(car, endpoint, **more):
    """A viewer of the server at a car with a desk."""
    from clients import foxglove_server

    said = asyncio.Queue()
    options = argparse.Namespace(
        host="127.0.0.1",
        port=0,
        car=None,
        connect=endpoint,
        session=None,
        keys=None,
        print_line=said.put_nowait,
        **more,
    )
    async with car:
        task = asyncio.create_task(foxglove_server.run(options))
        address = (await asyncio.wait_for(said.get(), 15)).split()[2]
        async with (
            aiohttp.ClientSession() as session,
            session.ws_connect(address, protocols=["foxglove.sdk.v1"]) as viewer,
        ):
            yield viewer
        task.cancel()
        with pytest.raises(asyncio.CancelledError):
            await task


async def answer(viewer, operation):
    async with asyncio.timeout(15):
        while True:
            frame = await viewer.receive()
            if frame.type is aiohttp.WSMsgType.TEXT and (said := json.loads(frame.data))["op"] == operation:
                return said


async def test_a_viewer_reads_and_changes_settings_by_the_cars_rules():
    endpoint = free_endpoint()
    car = FakeCar(endpoint)
    async with watched(car, endpoint) as viewer:
        await viewer.send_json(
            {"op": "getParameters", "parameterNames": ["wall_follow.kp", "safety.method"], "id": "1"}
        )
        before = {one["name"]: one["value"] for one in (await answer(viewer, "parameterValues"))["parameters"]}
        assert before == {"wall_follow.kp": 13.5, "safety.method": "swept"}
        for value, expected in ((10.0, 10.0), (-5.0, 10.0)):
            wish = [{"name": "wall_follow.kp", "value": value, "type": "float64"}]
            await viewer.send_json({"op": "setParameters", "parameters": wish, "id": "2"})
            said = await answer(viewer, "parameterValues")
            assert {one["name"]: one["value"] for one in said["parameters"]} == {"wall_follow.kp": expected}


async def test_a_viewer_presses_the_e_stop_and_nothing_else():
    endpoint = free_endpoint()
    car = FakeCar(endpoint)
    async with watched(car, endpoint) as viewer:
        names = ("/drive", "/e_stop")
        channels = [
            {"id": number, "topic": name, "encoding": "json", "schemaName": "std_msgs/msg/Empty"}
            for number, name in enumerate(names, 1)
        ]
        await viewer.send_json({"op": "advertise", "channels": channels})
        await viewer.send_bytes(b"\x01" + (1).to_bytes(4, "little") + b"{}")
        await asyncio.sleep(0.7)
        assert not car.e_stop.latched
        await viewer.send_bytes(b"\x01" + (2).to_bytes(4, "little") + b"{}")
        await car.until(lambda: car.e_stop.latched, "the e-stop is latched")


def test_its_layout_is_printed(capsys):
    from wallride.cli import main

    assert main(["foxglove", "--layout"]) == 0
    assert "configById" in json.loads(capsys.readouterr().out)
