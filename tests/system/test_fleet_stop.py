"""One STOP for all cars of two routers, while one of the routers dies: every car brakes within 0.3 s."""

import asyncio
import time
from argparse import Namespace

import pytest

from tests.system.bench import bench
from tests.system.test_uplink import router
from wallride.clients.fleet.links import fleet_links
from wallride.clients.fleet.stop import PERIOD_S, FleetStop
from wallride.runtime.wire.ports import free_endpoint

BOUND_S = 0.3
CARS = ("car1", "car2")


def settings(name, *routers):
    places = ", ".join(f'"{place}"' for place in routers)
    return (
        "telemetry.enabled=true", f"telemetry.listen={free_endpoint()}", f"telemetry.connect=[{places}]",
        f"car.name={name}", "operator.permit=always",
    )  # fmt: skip


async def pressing(stop, until):
    """Press, and repeat as a client does, until a condition holds; return the time of the press."""
    pressed_s = time.monotonic()
    stop.press(pressed_s)
    async with asyncio.timeout(5.0):
        while not until():
            stop.step(time.monotonic())
            await asyncio.sleep(PERIOD_S)
    return pressed_s


@pytest.mark.timeout(120)
async def test_one_stop_brakes_every_car_while_a_router_dies(tmp_path):
    first, second = free_endpoint(), free_endpoint()
    folders = [tmp_path / name for name in CARS]
    for folder in folders:
        folder.mkdir()
    async with (
        router(first) as dying,
        router(second),
        bench(folders[0], *settings("car1", first, second)) as one,
        bench(folders[1], *settings("car2", first, second)) as other,
        fleet_links(Namespace(connect=f"{first},{second}", keys=None)) as links,
    ):
        stop = FleetStop(links, "marshal")
        for car in (one, other):
            await car.until_driving()
        await one.until(lambda: len(stop._known) == 4, "each car by each router", 20.0)
        dying.kill()
        pressed_s = await pressing(stop, lambda: list(stop.cars.values()).count(None) == 0)
        brakes_s = [car.first_brake_s(pressed_s) - pressed_s for car in (one, other)]
        assert max(brakes_s) <= BOUND_S
        assert max(took_s for took_s in stop.cars.values() if took_s is not None) < 2 * BOUND_S
        for car in (one, other):
            await car.until(lambda car=car: car.wheel_mps == 0.0, "standing")
