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


async def at_speed(grip_mu):
    """Return a car's twin, motor, the car, its drive's task and what ends it, after 1.5 s in a corridor."""
    loop, stop = asyncio.get_running_loop(), asyncio.Event()
    twin = TwinWorld(load_world("corridor"), loop.time, vehicle=VehicleSettings(grip_mu=grip_mu))
    motor = WorldMotor(twin, loop.time)
    settings = load_settings(None, SETTINGS)
    car = Car(settings, WorldLidar(twin, loop.time), motor, MemoryBus(loop.time, listened_to=False), loop.time)
    driving = loop.create_task(car.drive(stop))
    await asyncio.sleep(1.5)
    return twin, motor, car, driving, stop


async def locked_at_speed():
    """Return (true speed, wheels' speed, whether it counts as standing) from an e-stop on a slippery floor on."""
    twin, motor, car, driving, stop = await at_speed(0.25)
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


async def end_at_speed(grip_mu, lost_s=None):
    """Return (true speed, commands after it was asked to end) when a drive has ended from 2.35 m/s."""
    loop = asyncio.get_running_loop()
    twin, motor, _, driving, stop = await at_speed(grip_mu)
    assert twin.vehicle.speed_mps > 2.0
    if lost_s is not None:
        motor.pull()
        loop.call_later(lost_s, motor.plug)
    stop.set()
    asked_s = loop.time()
    await driving
    twin.advance()
    return twin.vehicle.speed_mps, [drive for when_s, drive in motor.wire if when_s >= asked_s]


@pytest.mark.parametrize("grip_mu", [0.8, 0.3])
def test_a_drive_does_not_end_while_the_car_slides_on_locked_wheels(grip_mu):
    speed_mps, _ = run_virtual(end_at_speed(grip_mu))
    assert abs(speed_mps) < STANDS_BELOW_MPS


def test_a_motor_that_is_lost_while_the_drive_ends_is_braked_when_it_is_back():
    _, commands = run_virtual(end_at_speed(0.8, lost_s=0.2))
    assert len(commands) > 5, "the last one is the driver's own"
    assert not [drive for drive in commands if drive.speed_mps]
