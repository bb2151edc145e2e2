"""The simulator hears what the runtime says about itself, in whichever order the two come up."""

import asyncio

import pytest

from runtime import wire, zenoh_config
from runtime.bus import Bus, free_endpoint
from runtime.ros import messages
from runtime.ros.definitions import encoding
from sim.listener import Listener


async def test_it_waits_for_the_runtime_and_then_keeps_the_newest():
    endpoint = free_endpoint()
    listener = Listener(endpoint, "car1")
    listening = asyncio.create_task(listener.run())
    await asyncio.sleep(0.05)  # the first attempt finds nobody
    car = Bus(zenoh_config.car_config([endpoint], None, (), "car1"))
    await car.open()
    try:
        async with asyncio.timeout(10):
            while set(listener.latest) != {wire.STATUS, wire.DISTANCE_ERROR}:
                car.put(wire.key("car1", wire.STATUS), wire.encode({"reason": "wall", "measure": float("nan")}))
                payload = messages.float32(-0.25)
                car.put(wire.key("car1", wire.DISTANCE_ERROR), payload, encoding=encoding(wire.DISTANCE_ERROR))
                car.put(wire.key("car1", wire.SCAN), b"\x00\x01", encoding=encoding(wire.SCAN))
                await asyncio.sleep(0.02)
    finally:
        listening.cancel()
        await asyncio.wait([listening])
        await car.close()
    assert listener.latest == {
        wire.STATUS: {"reason": "wall", "measure": None},
        wire.DISTANCE_ERROR: {"error_m": -0.25},
    }


async def test_it_can_be_called_off_while_nobody_listens():
    listening = asyncio.create_task(Listener(free_endpoint(), "car1").run())
    await asyncio.sleep(0.05)
    listening.cancel()
    with pytest.raises(asyncio.CancelledError):
        await listening
