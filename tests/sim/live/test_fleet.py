"""Every car of a fleet has the emulated devices that its settings name, and its figures where another one fails."""

import asyncio
import json
from contextlib import AsyncExitStack

import pytest

from wallride import cli
from wallride.runtime.settings.tree import Settings
from wallride.sim.devices.esc import EmulatedEsc
from wallride.sim.devices.maestro import MaestroEmulator
from wallride.sim.devices.vesc import VescEmulator
from wallride.sim.live.fleet import build_fleet
from wallride.sim.live.session import SessionError, SimulatorSession
from wallride.sim.scenario.conditions import Conditions
from wallride.sim.world.worlds import load_world


@pytest.mark.parametrize(
    ("driver", "device"), [("vesc", VescEmulator), ("maestro", MaestroEmulator), ("pca9685", EmulatedEsc)]
)
async def test_each_has_the_motor_controller_of_the_settings(driver, device, tmp_path):
    settings = Settings.model_validate({"motor": {"driver": driver}})
    cars = build_fleet(load_world("straight"), 2, Conditions(), settings, 0, put_back=False)
    assert len(cars) == 2
    async with AsyncExitStack() as stack:
        for car in cars:
            (folder := tmp_path / car.name).mkdir()
            motor, address = await car.session._motor(stack, folder)
            assert isinstance(motor, device)
            assert str(folder) in address


@pytest.mark.parametrize("drove_s", [0.0, 2.5])
def test_a_fleet_of_which_one_runtime_dies_leaves_the_figures_of_all(monkeypatch, capsys, tmp_path, drove_s):
    async def run(self, start, *_):
        self.record.time_s = drove_s
        self.record.note(self._scene.sample(drove_s, self._vehicle))
        if "car.name=car2" in start.assignments:
            raise ExceptionGroup("tasks", [SessionError("the runtime ended by itself")])
        await asyncio.Event().wait()

    monkeypatch.setattr(SimulatorSession, "run", run)
    file = tmp_path / "told.json"
    assert cli.main(["sim", "straight", "--cars", "2", "--headless", "--json", str(file)]) == 1
    table, said = capsys.readouterr()
    assert said.endswith("wallride: car2: the runtime ended by itself\n")
    assert ("2 cars in straight" in table) is file.exists() is (drove_s > 0)
    if drove_s:
        told = json.loads(file.read_text())
        assert told["failed"] == "car2: the runtime ended by itself"
        assert list(told["cars"]) == ["car1", "car2"]
