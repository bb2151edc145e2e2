"""Every car of a fleet has the emulated devices that its settings name."""

from contextlib import AsyncExitStack

import pytest

from wallride.runtime.settings.tree import Settings
from wallride.sim.devices.esc import EmulatedEsc
from wallride.sim.devices.maestro import MaestroEmulator
from wallride.sim.devices.vesc import VescEmulator
from wallride.sim.live.fleet import build_fleet
from wallride.sim.scenario.conditions import Conditions
from wallride.sim.world.worlds import load_world


@pytest.mark.parametrize(
    ("driver", "device"), [("vesc", VescEmulator), ("maestro", MaestroEmulator), ("pca9685", EmulatedEsc)]
)
async def test_each_has_the_motor_controller_of_the_settings(driver, device, tmp_path):
    settings = Settings.model_validate({"motor": {"driver": driver}})
    cars = build_fleet(load_world("loop"), 2, Conditions(), settings, 0, put_back=False)
    assert len(cars) == 2
    async with AsyncExitStack() as stack:
        for car in cars:
            (folder := tmp_path / car.name).mkdir()
            motor, address = await car.session._motor(stack, folder)
            assert isinstance(motor, device)
            assert str(folder) in address
