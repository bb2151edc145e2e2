"""What `wallride doctor` says of boards that make servo pulses."""

import asyncio

import pytest

from wallride.doctor.examine import _motor
from wallride.doctor.findings import Level
from wallride.doctor.motor import judge_motor, look_at_motor
from wallride.drivers.maestro.settings import MaestroSettings
from wallride.drivers.pca9685.settings import Pca9685Settings
from wallride.runtime.control.battery import BatterySettings
from wallride.runtime.settings.tree import Settings
from wallride.sim.devices.esc import EmulatedEsc
from wallride.sim.devices.maestro import MaestroEmulator


async def looked_at(tmp_path, prepare=lambda _board: None, **board):
    emulator = MaestroEmulator(EmulatedEsc(), clock=asyncio.get_running_loop().time, **board)
    emulator.start_serial(tmp_path / "maestro")
    prepare(emulator)
    try:
        settings = MaestroSettings(address=f"serial://{tmp_path / 'maestro'}", arming_s=0.2)
        found = judge_motor(await look_at_motor(settings), BatterySettings())
        return {one.subject: one for one in found}
    finally:
        emulator.close()


async def test_a_maestro_with_its_timeout_is_ok(tmp_path):
    told = await looked_at(tmp_path)
    assert {one.level for one in told.values()} == {Level.OK}
    assert "Maestro" in told["motor"].words


async def test_a_board_without_a_timeout_is_warned_of(tmp_path):
    told = await looked_at(tmp_path, timeout_s=0.0)
    assert told["motor timeout"].level is Level.WARN
    assert "no command timeout" in told["motor timeout"].words
    assert "serial timeout" in told["motor timeout"].remedy


def hold(board):
    board.held_us = 1234.0


def silence(board):
    board.silence = True


@pytest.mark.parametrize(("prepare", "remedy"), [(hold, "without limits of speed"), (silence, "USB Dual Port")])
async def test_what_is_wrong_with_a_maestro_has_its_remedy(tmp_path, prepare, remedy):
    told = await looked_at(tmp_path, prepare)
    assert told["motor"].level is Level.FAIL
    assert remedy in told["motor"].remedy


async def test_a_missing_bus_has_its_remedy():
    told = judge_motor(await look_at_motor(Pca9685Settings(bus=250)), BatterySettings())
    await asyncio.sleep(0)
    assert "enable I2C" in told[0].remedy


async def test_pulses_that_nobody_measured_and_wheels_up_lead_to_the_calibration(tmp_path):
    emulator = MaestroEmulator(EmulatedEsc(), clock=asyncio.get_running_loop().time)
    emulator.start_serial(tmp_path / "maestro")
    address = f"serial://{tmp_path / 'maestro'}"
    settings = Settings.model_validate({"motor": {"driver": "maestro", "address": address}})
    try:
        told = {one.subject: one async for one in _motor(settings, lambda _question: True)}
    finally:
        emulator.close()
    assert [told[name].level for name in ("pulses", "wheels up")] == [Level.WARN, Level.WARN]
    assert "wallride calibrate" in told["pulses"].remedy
    assert "wallride calibrate" in told["wheels up"].remedy
