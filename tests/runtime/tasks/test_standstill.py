"""A car that slides on locked wheels does not stand, however slippery the floor is."""

import asyncio

import pytest

from tests.runtime.observed import HandClock
from wallride.runtime.app import Car
from wallride.runtime.arbitration.emergency_stop import Cause
from wallride.runtime.settings.tree import load_settings
from wallride.runtime.tasks.standstill import STANDS_BELOW_MPS, Standstill
from wallride.runtime.wire.network import RefusedError
from wallride.sim.car.vehicle import VehicleSettings
from wallride.sim.virtual.devices import MemoryBus, MemoryMotor
from wallride.sim.virtual.twin_world import TwinWorld, WorldLidar, WorldMotor
from wallride.sim.virtual.virtual_time import run_virtual
from wallride.sim.world.worlds import load_world

SETTINGS = ("wall_follow.speed_mps=2.35", "operator.permit=always", "battery.settle_s=0", "recording.enabled=false")


async def locked_at_speed():
    """Return (true speed, wheels' speed, whether it counts as standing) from an e-stop on a slippery floor on."""
    loop, stop = asyncio.get_running_loop(), asyncio.Event()
    twin = TwinWorld(load_world("corridor"), loop.time, vehicle=VehicleSettings(grip_mu=0.25))
    motor = WorldMotor(twin, loop.time)
    settings = load_settings(None, SETTINGS)
    car = Car(settings, WorldLidar(twin, loop.time), motor, MemoryBus(loop.time, listened_to=False), loop.time)
    driving = loop.create_task(car.drive(stop))
    await asyncio.sleep(1.5)
    car.emergency_stop.latch(Cause.OPERATOR, "test")
    found = []
    for _ in range(250):
        await asyncio.sleep(0.01)
        state = motor.state
        stands = car.standstill.holds()
        found.append((twin.vehicle.speed_mps, state.speed_mps, stands))
        if not stands:
            with pytest.raises(RefusedError):
                car.own_parts.forget()
    stop.set()
    await driving
    return found


def test_a_car_that_slides_on_locked_wheels_does_not_stand():
    found = run_virtual(locked_at_speed())
    assert any(speed_mps > 1.5 and wheels_mps == 0.0 for speed_mps, wheels_mps, _ in found), "it slides"
    assert not [speed_mps for speed_mps, _, stands in found if stands and abs(speed_mps) >= STANDS_BELOW_MPS]
    assert found[-1][2], "in the end it stands"


def test_a_car_without_a_motor_report_does_not_stand():
    clock = HandClock()
    motor = MemoryMotor(clock)
    standstill = Standstill(motor, lambda: None, clock)
    assert standstill.holds()
    motor.present = False
    assert not standstill.holds()
