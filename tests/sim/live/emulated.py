"""An emulated car in this process, for tests that open its ports."""

import asyncio
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from dataclasses import dataclass

from wallride.drivers.vesc.settings import VescSettings
from wallride.sim.car.vehicle import Vehicle, VehicleSettings
from wallride.sim.devices.lidar_kinds import emulated
from wallride.sim.live.emulated_car import DeviceAddresses, EmulatedCar, EmulatedPorts
from wallride.sim.live.scenes import WorldScene
from wallride.sim.world.beams import LidarSettings
from wallride.sim.world.worlds import load_world


@dataclass
class Stop:
    """A stop request that a test makes."""

    asked: bool = False


def car(folder, *, lidar=None, world="corridor", motor=None, turning="hokuyo", **changes):
    """Return an emulated car with free ports; turning: the word of its lidar; changes: of its ports."""
    place = load_world(world, side="left", seed=0)
    ports = {"tcp_port": 0, "serial_lidar": True, "timeout_s": 0.15, "brake_a": 10.0} | changes
    scene = WorldScene(place, "left", lidar or LidarSettings(), None, 0)
    scene.turning = emulated(turning)
    vehicle = Vehicle(VehicleSettings(), place.start)
    clock = asyncio.get_running_loop().time
    return EmulatedCar(scene, vehicle, VescSettings(), EmulatedPorts(folder, **ports), motor=motor, clock=clock)


@asynccontextmanager
async def running(one: EmulatedCar) -> AsyncIterator[DeviceAddresses]:
    """Keep a car running in the background; yields its addresses, raises what its start raises."""
    told: asyncio.Future[DeviceAddresses] = asyncio.get_running_loop().create_future()
    stop = Stop()
    task = asyncio.create_task(one.keep(60.0, stop, told.set_result))  # type: ignore[arg-type]
    await asyncio.wait((told, task), return_when=asyncio.FIRST_COMPLETED)
    if task.done():
        task.result()
    try:
        yield told.result()
    finally:
        stop.asked = True
        await task
