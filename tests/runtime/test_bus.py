"""The zenoh session on loopback: heard by a client, out of the way when its port is taken, silent when closed."""

import asyncio
import socket

from runtime import wire
from runtime.bus import Bus, free_endpoint
from sim.listener import Listener


async def test_a_subscriber_hears_what_is_put():
    endpoint = free_endpoint()
    bus = Bus(endpoint)
    bus.put("wallride/car1/status", b"{}")
    assert bus.dropped == 1, "before it is open nothing is queued"
    await bus.open()
    listener = Listener(endpoint, "car1")
    listening = asyncio.create_task(listener.run())
    try:
        async with asyncio.timeout(10):
            while wire.STATUS not in listener.latest:
                bus.put(wire.key("car1", wire.STATUS), wire.encode({"reason": "wall", "measure": float("nan")}))
                bus.put(wire.key("car2", "other"), b"{}")
                await asyncio.sleep(0.01)
        assert listener.latest == {wire.STATUS: {"reason": "wall", "measure": None}}
    finally:
        listening.cancel()
        await asyncio.gather(listening, return_exceptions=True)
        await bus.close()


async def test_a_taken_port_is_left_to_its_owner_and_another_one_is_used():
    with socket.socket() as owner:
        owner.bind(("127.0.0.1", 0))
        owner.listen()
        taken = f"tcp/127.0.0.1:{owner.getsockname()[1]}"
        bus = Bus(taken)
        await bus.open()
        assert bus.endpoint != taken
        await bus.close()
    await bus.close()
