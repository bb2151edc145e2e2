"""A router dies, hangs and comes back while the car drives by itself: the car notices nothing but that it is away."""

import asyncio
import contextlib
import signal
import sys
import time
from itertools import pairwise

import pytest

from tests.system.bench import bench
from tests.system.faults.test_router import holding
from tests.system.operated import operated
from tests.system.soak.operator import HAND_MPS
from wallride.clients.fleet.router import bench_config
from wallride.runtime.wire import topics
from wallride.runtime.wire.bus import Bus
from wallride.runtime.wire.ports import free_endpoint
from wallride.runtime.wire.zenoh_config import client_config

CAR = "sim"
AWAY_S = 2.5
MAX_GAP_S = 0.25
"""A car without a command for longer brakes by itself; on a busy machine gaps of 0.1 s come without any router."""


@contextlib.asynccontextmanager
async def router(endpoint):
    """Run `wallride router` as a user would."""
    process = await asyncio.create_subprocess_exec(
        sys.executable, "-m", "wallride", "router", "--listen", endpoint, stdout=asyncio.subprocess.PIPE
    )
    try:
        assert process.stdout is not None
        assert b"routing at" in await process.stdout.readline()
        yield process
    finally:
        if process.returncode is None:
            with contextlib.suppress(ProcessLookupError):
                process.send_signal(signal.SIGCONT)
            process.kill()
        await process.wait()


@contextlib.asynccontextmanager
async def viewer(endpoint):
    """Yield the list of what a viewer at a router hears of the car's status."""
    bus, heard = Bus(client_config(endpoint, None)), []
    bus.subscribe(topics.key(CAR, topics.STATUS), lambda _key, payload, _s: heard.append(topics.decode(payload)))
    await bus.open()
    try:
        yield heard
    finally:
        await bus.close()


def longest_gap_s(car, since_s):
    moments_s = [since_s, *(at_s for at_s, _ in car.motor_commands(since_s))]
    return max(later - earlier for earlier, later in pairwise([*moments_s, time.monotonic()]))


@pytest.mark.timeout(120)
async def test_a_router_that_dies_hangs_or_comes_back_is_nothing_to_a_driving_car(tmp_path):
    place, other = free_endpoint(), free_endpoint()
    settings = (
        "telemetry.enabled=true", f"telemetry.listen={free_endpoint()}", f'telemetry.connect=["{place}", "{other}"]',
        "operator.permit=always",
    )  # fmt: skip
    async with bench(tmp_path, *settings) as car:
        await car.until_driving()  # without any router
        async with router(place) as first, viewer(place) as heard:
            await car.until(lambda: heard, "a status by way of the router", 15.0)
            assert heard[-1]["routers"][place] == ""
            assert heard[-1]["routers"][other] != ""
            for number in (signal.SIGSTOP, signal.SIGCONT, signal.SIGKILL):
                since_s = time.monotonic()
                first.send_signal(number)
                await asyncio.sleep(AWAY_S)
                assert longest_gap_s(car, since_s) < MAX_GAP_S, number.name
                assert car.wheel_mps > 0.8, number.name
        async with router(place), viewer(place) as heard:
            since_s = time.monotonic()
            await car.until(lambda: heard, "a status by way of the router that is back", 15.0)
            assert longest_gap_s(car, since_s) < MAX_GAP_S
        async with router(place) as last, viewer(place) as heard:
            await car.until(lambda: heard, "a status", 15.0)
            last.send_signal(signal.SIGSTOP)
            await asyncio.sleep(0.3)
            async with asyncio.timeout(10.0):
                assert await car.runtime.stop() == 0, "a router that hangs does not hold it up"


@pytest.mark.timeout(90)
async def test_a_router_that_comes_back_to_a_client_that_holds_drive_moves_nothing(tmp_path):
    """The car is at the router by its uplink; the client has no gate of its own and never lets go."""
    place = free_endpoint()
    settings = (f"telemetry.connect={place}", "operator.permit=required")
    async with router(place) as first, operated(tmp_path, *settings) as scene, holding(place) as beats:
        await scene.car.until(lambda: scene.car.wheel_mps > 0.9 * HAND_MPS, "driving by hand", 20.0)
        first.kill()
        died_s = time.monotonic()
        brake_s = await scene.brake_after(died_s)
        assert brake_s - died_s <= MAX_GAP_S
        await asyncio.sleep(1.0)
        count = len(beats)
        async with router(place):
            await scene.car.until(lambda: len(beats) > count + 20, "hearing the car again", 15.0)
            await asyncio.sleep(2.0)
            assert not scene.moves_after(brake_s + 0.05)


async def test_a_router_without_a_file_serves_this_computer_only():
    config = bench_config("tcp/127.0.0.1:7449")
    assert config["listen"]["endpoints"] == ["tcp/127.0.0.1:7449"]
    with pytest.raises(Exception, match="would let anyone"):
        bench_config("tcp/0.0.0.0:7449")
