"""The live server as a viewer sees it: topics, their very bytes on demand, settings, and the e-stop."""

import argparse
import asyncio
import json
from contextlib import asynccontextmanager
from typing import Any

import aiohttp
import pytest

from tests.clients.monitor.fake_car import FakeCar
from tests.clients.speaking_car import CarSession
from wallride.clients.foxglove import control, server, viewer
from wallride.runtime.recording.channels import text_of
from wallride.runtime.ros.definitions import TYPES, encoding
from wallride.runtime.ros.messages import float32
from wallride.runtime.wire import topics
from wallride.runtime.wire.ports import free_endpoint

SUBSCRIBE = {"op": "subscribe"}
MESSAGE_DATA, HEAD_B = 1, 1 + 4 + 8
PROTOCOLS = ["foxglove.sdk.v1", "foxglove.websocket.v1"]
CHANNEL = {"encoding": "json", "schemaName": "std_msgs/msg/Empty"}
PRESS = b"\x01" + (1).to_bytes(4, "little") + b"{}"


@pytest.fixture
async def car():
    async with CarSession() as car:
        yield car


@pytest.fixture
async def address(car):
    async with serving(car.endpoint) as address:
        yield address


@asynccontextmanager
async def serving(endpoint, pages=()):
    """The address of a server that watches the car at an endpoint."""
    said = asyncio.Queue()
    options = argparse.Namespace(
        host="127.0.0.1", port=0, car=None, connect=endpoint, session=None, keys=None, pages=list(pages),
        print_line=said.put_nowait,
    )  # fmt: skip
    task = asyncio.create_task(server.run(options))
    async with asyncio.timeout(15):
        address = (await said.get()).split()[2]
    yield address
    task.cancel()
    with pytest.raises(asyncio.CancelledError):
        await task


async def test_a_viewer_is_offered_everything_and_gets_the_cars_bytes(car, address):
    bus = car.bus
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
        assert not bus.wanted(key, encoding=encoding(topics.DISTANCE_ERROR)), "no viewer subscribes yet"

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
async def served(car, *, pages=()):
    """The address of the server at a car with a desk."""
    async with car, serving(car.bus.endpoint, pages) as address:
        yield address


@asynccontextmanager
async def visiting(address):
    async with aiohttp.ClientSession() as session, session.ws_connect(address, protocols=PROTOCOLS) as viewer:
        yield viewer


@asynccontextmanager
async def watched(car):
    """A viewer of the server at a car with a desk."""
    async with served(car) as address, visiting(address) as viewer:
        yield viewer


async def answer(viewer, operation):
    async with asyncio.timeout(15):
        while True:
            frame = await viewer.receive()
            if frame.type is aiohttp.WSMsgType.TEXT and (said := json.loads(frame.data))["op"] == operation:
                return said


async def test_a_viewer_reads_and_changes_settings_by_the_cars_rules():
    car = FakeCar(free_endpoint())
    async with watched(car) as viewer:
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
    car = FakeCar(free_endpoint())
    async with watched(car) as viewer:
        channels = [CHANNEL | {"id": number, "topic": name} for number, name in enumerate(("/drive", "/e_stop"), 1)]
        await viewer.send_json({"op": "advertise", "channels": channels})
        await viewer.send_bytes(PRESS)
        await asyncio.sleep(0.7)
        assert not car.e_stop.latched
        await viewer.send_bytes(b"\x01" + (2).to_bytes(4, "little") + b"{}")
        await car.until(lambda: car.e_stop.latched, "the e-stop is latched")


async def test_an_e_stop_that_no_car_confirms_is_repeated_and_said(car, address, monkeypatch):
    monkeypatch.setattr(control, "INSIST_S", 1.0)
    pressed = []
    car.bus.subscribe(topics.key("car1", topics.COMMAND), lambda _key, payload, _s: pressed.append(payload))
    async with visiting(address) as viewer:
        await viewer.send_json({"op": "advertise", "channels": [CHANNEL | {"id": 1, "topic": "/e_stop"}]})
        await viewer.send_bytes(PRESS)
        assert (await answer(viewer, "status"))["message"] == control.UNCONFIRMED
    assert len(pressed) > control.PRESSED_STEPS + 5


async def test_numbers_of_channels_are_each_viewers_own():
    car = FakeCar(free_endpoint())
    async with served(car) as address, visiting(address) as one, visiting(address) as other:
        await one.send_json({"op": "advertise", "channels": [CHANNEL | {"id": 1, "topic": "/e_stop"}]})
        await other.send_json({"op": "advertise", "channels": [CHANNEL | {"id": 1, "topic": "/other"}]})
        await other.send_bytes(PRESS)
        await other.send_json({"op": "getParameters", "parameterNames": ["wall_follow.kp"], "id": "1"})
        await answer(other, "parameterValues")  # the car has answered: a press before it would have arrived
        assert not car.e_stop.latched
        await one.send_bytes(PRESS)
        await car.until(lambda: car.e_stop.latched, "the e-stop is latched")


async def test_a_change_is_told_to_the_viewers_that_follow_it():
    async with served(FakeCar(free_endpoint())) as address, visiting(address) as one, visiting(address) as other:
        await other.send_json({"op": "subscribeParameterUpdates", "parameterNames": ["wall_follow.kp"]})
        await other.send_json({"op": "nonsense"})
        assert (await answer(other, "status"))["level"] == viewer.ERROR  # what it sent before has been understood
        await one.send_json({"op": "setParameters", "parameters": [{"name": "wall_follow.kp", "value": 9}]})
        told = (await answer(other, "parameterValues"))["parameters"]
        assert told == [{"name": "wall_follow.kp", "value": 9.0, "type": "float64"}]


@pytest.mark.parametrize(
    ("headers", "query"),
    [
        ({"Origin": "https://evil.example"}, True),
        ({"Origin": "null"}, True),
        ({"Origin": ""}, True),
        ({"Host": "evil.example:8765"}, True),
        ({}, False),
        ({"Origin": "https://app.foxglove.dev"}, False),
    ],
)
async def test_other_pages_names_and_programs_without_the_token_stay_outside(headers, query):
    async with served(FakeCar(free_endpoint())) as address, aiohttp.ClientSession() as session:
        place = address if query else address.partition("?")[0]
        with pytest.raises(aiohttp.WSServerHandshakeError) as refused:
            await session.ws_connect(place, protocols=PROTOCOLS, headers=headers)
        assert refused.value.status == 403


@pytest.mark.parametrize("origin", ["file://", "https://app.foxglove.dev", "http://localhost:8080"])
async def test_pages_of_viewers_come_in_with_the_token(origin):
    async with (
        served(FakeCar(free_endpoint()), pages=["http://localhost:8080/"]) as address,
        aiohttp.ClientSession() as session,
        session.ws_connect(address, protocols=PROTOCOLS[1:], headers={"Origin": origin}) as viewer,
    ):
        assert (await answer(viewer, "serverInfo"))["name"] == "car1"


HOSTILE = [
    "", "x", "[]", "{}", '{"op": []}', '{"op": "subscribe"}', '{"op": "subscribe", "subscriptions": 1}',
    '{"op": "subscribe", "subscriptions": [{"id": -1, "channelId": 1}]}', '{"op": "unadvertise", "channelIds": [[]]}',
    '{"op": "subscribe", "subscriptions": [{"id": 1, "channelId": 9999}]}', '{"op": "unsubscribe"}',
    '{"op": "getParameters", "parameterNames": 3}', '{"op": "setParameters", "parameters": [{"value": 1}]}',
    '{"op": "advertise", "channels": [{"id": 1e99, "topic": 0}]}', '{"op": "subscribeParameterUpdates"}',
    "[" * 9000,
]  # fmt: skip


async def test_what_is_not_understood_is_said_and_the_viewer_stays():
    async with served(FakeCar(free_endpoint())) as address, visiting(address) as viewer:
        for words in HOSTILE:
            await viewer.send_str(words)
            assert (await answer(viewer, "status"))["level"] == 2
        for data in (b"", b"\x01", b"\x01\x01\0\0\0"):
            await viewer.send_bytes(data)
        await viewer.send_json({"op": "getParameters", "parameterNames": ["wall_follow.kp"], "id": "1"})
        assert (await answer(viewer, "parameterValues"))["id"] == "1"


async def test_a_slow_viewer_loses_the_oldest_messages():
    unused: Any = None
    bus: Any = RecordedBus()
    slow = viewer.Viewer(unused, viewer.Served("car1", viewer.CarChannels(bus, "car1"), unused, unused))
    slow._select({"subscriptions": [{"id": 7, "channelId": 1}]})
    for number in range(1000):
        slow._take(1, number, b"")
    assert len(slow._waiting) == viewer.WAITING
    assert slow._waiting[-1][5:] == (999).to_bytes(8, "little")


class RecordedBus:
    def subscribe(self, *_):
        pass


def test_its_layout_is_printed(capsys):
    from wallride.cli import main

    assert main(["foxglove", "--layout"]) == 0
    assert "configById" in json.loads(capsys.readouterr().out)
