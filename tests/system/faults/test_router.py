"""A zenoh router between car and operator dies while the operator drives, and comes back: nothing moves by itself."""

import asyncio
import json
import os
import sys
import time
from contextlib import asynccontextmanager
from pathlib import Path

import pytest

from runtime.wire.bus import free_endpoint
from tests.system.faults import document
from tests.system.operated import operated

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
