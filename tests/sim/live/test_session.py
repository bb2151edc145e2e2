"""What the session of `wallride sim` fits to the emulated car, and what it keeps of a drive that went wrong."""

import json
import time
from contextlib import AsyncExitStack
from typing import Any

import pytest

from wallride import cli
from wallride.drivers.vesc import codec
from wallride.drivers.vesc.settings import VescSettings
from wallride.sim.car.plant import Plant
from wallride.sim.car.vehicle import Vehicle
from wallride.sim.live.session import SessionError, SimulatorSession
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


DIED = "the runtime ended by itself (exit code 1); it said:\nmy_lidar.py:30: the process ends"


@pytest.mark.parametrize("drove_s", [0.0, 2.5])
def test_a_drive_whose_runtime_dies_leaves_its_summary(monkeypatch, capsys, tmp_path, drove_s):
    async def run(self, *_):
        self.record.time_s = drove_s
        self._scene._crashed_s = drove_s
        self.record.note(self._scene.sample(drove_s, self._vehicle))
        raise ExceptionGroup("tasks", [SessionError(DIED)])

    monkeypatch.setattr(SimulatorSession, "run", run)
    file = tmp_path / "told.json"
    assert cli.main(["sim", "corridor", "--headless", "--json", str(file)]) == 1
    table, said = capsys.readouterr()
    assert said.endswith(f"wallride: {DIED}\n")
    assert ("The car touched something" in table) is file.exists() is (drove_s > 0)
    if drove_s:
        told = json.loads(file.read_text())
        assert told["collided"]
        assert told["failed"] == DIED
