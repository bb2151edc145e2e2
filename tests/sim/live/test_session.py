"""What the session of `wallride sim` fits to the emulated car, and what it keeps of a drive that went wrong."""

import time
from contextlib import AsyncExitStack
from typing import Any

import pytest

from wallride.drivers.vesc import codec
from wallride.drivers.vesc.settings import VescSettings
from wallride.sim.car.plant import Plant
from wallride.sim.car.vehicle import Vehicle
from wallride.sim.live.session import SimulatorSession
from wallride.sim.world.pose import Pose


async def test_the_emulated_vesc_stops_a_car_whose_computer_hangs(tmp_path):
    wiring, vehicle = VescSettings(), Vehicle()
    scene: Any = None
    vehicle.place(Pose(0.0, 0.0, 0.0), speed_mps=1.0)
    session = SimulatorSession(scene, vehicle, wiring)
    async with AsyncExitStack() as stack:
        vesc: Any
        vesc, _ = await session._motor(stack, tmp_path)
        now_s = time.monotonic()
        vesc._on_payload(codec.set_erpm(round(wiring.speed_to_erpm_gain)))
        Plant(vehicle, vesc, wiring, now_s).advance(now_s + 3.0)
    assert vehicle.speed_mps == pytest.approx(0.0, abs=1e-3)
    assert 0.15 < vehicle.x_m < 0.5, "the last command for 0.15 s, then 10 A"
