"""A zenoh router between car and operator dies while the operator drives, and comes back: nothing moves by itself."""

import asyncio
import json
import os
import random
import sys
import time
from contextlib import asynccontextmanager
from pathlib import Path

import pytest

from tests.system.faults import document
from tests.system.operated import CAR, operated
from tests.system.soak.operator import HAND_MPS, SEND_PERIOD_S, Operator
from wallride.runtime.wire import topics, zenoh_config
from wallride.runtime.wire.bus import Bus
from wallride.runtime.wire.network import BYTES
from wallride.runtime.wire.ports import free_endpoint
from wallride.runtime.wire.teleop import Press

KEY = "process zenoh router dies"
BOUND_S = 0.25
AWAY_S = 1.5
BACK_S = 2.0
ROUTER = """
import sys, zenoh
session = zenoh.open(zenoh.Config.from_json5(sys.argv[1]))
print("open", flush=True)
sys.stdin.read()
"""


@asynccontextmanager
async def router(listens, car):
    """Run a router of zenoh's own in a process: clients connect to it, and it connects to the car."""
    config = {
        "mode": "router",
        "listen": {"endpoints": [listens]},
        "connect": {"endpoints": [car]},
        "scouting": {"multicast": {"enabled": False}},
    }
    process = await asyncio.create_subprocess_exec(
        sys.executable, "-c", ROUTER, json.dumps(config),
        stdin=asyncio.subprocess.PIPE, stdout=asyncio.subprocess.PIPE,
    )  # fmt: skip
    try:
        assert process.stdout is not None
        assert await process.stdout.readline() == b"open\n"
        yield process
    finally:
        if process.returncode is None:
            process.kill()
        await process.wait()


@pytest.mark.timeout(90)
async def test_a_router_that_dies_stops_the_car_and_one_that_comes_back_moves_nothing(tmp_path):
    listens = free_endpoint()
    async with operated(tmp_path) as scene:
        car = scene.radio.endpoint
        async with router(listens, car) as first:
            scene.entrance = listens
            await scene.drive_by_hand()
            first.kill()
            died_s = time.monotonic()
            brake_s = await scene.brake_after(died_s)
            await asyncio.sleep(AWAY_S)
        async with router(listens, car):
            await asyncio.sleep(BACK_S)
            assert not scene.moves_after(brake_s + 0.05), "the operator still holds everything"
            await scene.drive_by_hand(name="ben")
    if path := os.environ.get("FAULTS_MEASURED"):
        document.note(Path(path), KEY, brake_s - died_s)
    assert brake_s - died_s <= BOUND_S


class Stubborn(Operator):
    """A client without a gate of its own: it releases once, and then holds "drive" whatever happens."""

    def _flags(self, now_s):
        if self._echo and self._releases_until_s < 0:
            self._releases_until_s = now_s + 0.5
        return Press(0) if now_s < self._releases_until_s else Press.MANUAL


@asynccontextmanager
async def holding(entrance):
    """Let such a client send for ever; yields the numbers of the beats that it hears."""
    bus, beats = Bus(zenoh_config.client_config(entrance, None)), []
    operator = Stubborn(
        lambda payload, *_: bus.put(topics.key(CAR, topics.COMMAND), payload, encoding=BYTES, urgent=True),
        random.Random(1), session=7, name="cat",
    )  # fmt: skip
    bus.subscribe(topics.key(CAR, topics.BEAT), lambda _key, payload, _at_s: beats.append(operator.hear(payload)))
    await bus.open()

    async def send():
        while True:
            operator.step(time.monotonic())
            await asyncio.sleep(SEND_PERIOD_S)

    sending = asyncio.create_task(send())
    try:
        yield beats
    finally:
        sending.cancel()
        await bus.close()


@pytest.mark.timeout(90)
async def test_what_a_client_without_a_gate_holds_all_the_time_moves_nothing_when_the_router_is_back(tmp_path):
    listens = free_endpoint()
    async with (
        operated(tmp_path, "operator.permit=required") as scene,
        router(listens, scene.radio.endpoint) as first,
        holding(listens) as beats,
    ):
        await scene.car.until(lambda: scene.car.wheel_mps > 0.9 * HAND_MPS, "driving by hand")
        first.kill()
        brake_s = await scene.brake_after(time.monotonic())
        await asyncio.sleep(AWAY_S)
        count = len(beats)
        async with router(listens, scene.radio.endpoint):
            await scene.car.until(lambda: len(beats) > count + 20, "hearing the car again")
            await asyncio.sleep(BACK_S)
            assert not scene.moves_after(brake_s + 0.05)
