"""The simulator hears what the runtime says about itself, in whichever order the two come up."""

import asyncio
import math
from dataclasses import asdict

import pytest

from wallride.runtime.parameters.history import ChangeHistory, SettingChange
from wallride.runtime.ros import messages
from wallride.runtime.ros.definitions import encoding
from wallride.runtime.wire import topics, zenoh_config
from wallride.runtime.wire.bus import Bus
from wallride.runtime.wire.ports import free_endpoint
from wallride.sim.live.listener import Listener


@pytest.fixture
async def pair():
    """A listener, its task, and a car that is not open yet."""
    endpoint = free_endpoint()
    listener = Listener(endpoint, "car1", "0000cafe")
    listening = asyncio.create_task(listener.run())
    car = Bus(zenoh_config.car_config([endpoint], None, (), "car1"))
    yield listener, listening, car
    listening.cancel()
    await asyncio.wait([listening])
    await car.close()


def say(car, topic, payload):
    car.put(topics.key("car1", topic), payload, encoding=encoding(topic))


async def said_until(met, car, **status):
    """Have the car tell its status and an error until something is so."""
    async with asyncio.timeout(10):
        while not met():
            car.put(topics.key("car1", topics.STATUS), topics.encode(status))
            say(car, topics.DISTANCE_ERROR, messages.float32(-0.25))
            say(car, topics.SCAN, b"\x00\x01")
            await asyncio.sleep(0.02)


async def test_it_waits_for_the_runtime_and_then_keeps_the_newest(pair):
    listener, _, car = pair
    await asyncio.sleep(0.05)  # the first attempt finds no client
    await car.open()
    both = {topics.STATUS, topics.DISTANCE_ERROR}
    await said_until(lambda: set(listener.latest) == both, car, session="0000cafe", reason="wall", measure=math.nan)
    assert listener.latest == {
        topics.STATUS: {"session": "0000cafe", "reason": "wall", "measure": None},
        topics.DISTANCE_ERROR: {"error_m": -0.25},
    }
    assert not listener.problem


async def test_what_another_start_of_the_car_says_is_not_taken_and_named(pair):
    listener, _, car = pair
    await car.open()
    await said_until(lambda: "0000beef" in listener.problem, car, session="0000beef")
    assert not listener.latest


async def test_it_can_be_called_off_while_no_client_listens(pair):
    _, listening, _ = pair
    await asyncio.sleep(0.05)
    listening.cancel()
    with pytest.raises(asyncio.CancelledError):
        await listening


async def test_it_asks_which_settings_were_changed_since_the_drive_began(pair):
    listener, _, car = pair
    assert await listener.changes_since(0.0) == [], "it was never connected"
    history = ChangeHistory(10)
    history.add([SettingChange(at_s, "", "ann", "wall_follow.kp", 13.5, at_s) for at_s in (90.0, 110.0)])
    changes = [asdict(change) for change in history.newest(10)]
    car.answer(topics.key("car1", "param/history"), lambda _: topics.encode({"changes": changes}))
    await car.open()
    await said_until(lambda: not listener.problem, car, session="0000cafe")
    (change,) = await listener.changes_since(100.0)
    assert (change.stamp_s, change.new) == (110.0, 110.0)


@pytest.mark.parametrize(
    ("topic", "payload"),
    [
        *((topics.STATUS, payload) for payload in (b"", b"3", b"{", b"\xff", b'{"session": "0000cafe", "output": 3}')),
        (topics.STATUS, b'{"session": "0000cafe", "pose": {"whereabouts": "located"}, "stamp_s": 2.0}'),
        (topics.DISTANCE_ERROR, b""),
    ],
)
def test_what_cannot_be_read_is_dropped_and_counted(topic, payload):
    listener = Listener("", "car1", "0000cafe")
    good = {"session": "0000cafe", "stamp_s": 1.0, "output": {"reason": "wall"}}
    for message, text in ((topics.STATUS, topics.encode(good)), (topic, payload), (topics.STATUS, topics.encode(good))):
        listener._on_sample(topics.key("car1", message), text, 0.0)
    assert listener.malformed == 1
    assert listener.latest == {topics.STATUS: good}
