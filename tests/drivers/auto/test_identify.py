"""Every kind of lidar is told by its protocol; none, two, and what is no lidar are refused by name."""

import asyncio
import os
from contextlib import suppress

import pytest

from tests.drivers.turning.rig import turning
from wallride.drivers.api import DriverError, LinkLost, ProtocolError
from wallride.drivers.auto.identify import find_lidar
from wallride.drivers.auto.settings import AutoLidarSettings
from wallride.drivers.hokuyo.settings import HokuyoSettings
from wallride.drivers.rplidar.settings import RplidarSettings
from wallride.drivers.ydlidar.settings import YdlidarSettings
from wallride.runtime.ending import end
from wallride.sim.devices import rplidar, ydlidar
from wallride.sim.devices.rplidar import RplidarDevice
from wallride.sim.devices.scip import ScipEmulator
from wallride.sim.devices.scip_port import SerialDoor
from wallride.sim.devices.turning import TurningEmulator
from wallride.sim.devices.vesc import VescEmulator
from wallride.sim.devices.ydlidar import YdlidarDevice

AUTO = AutoLidarSettings()


def clock():
    return asyncio.get_running_loop().time


def look(settings, places):
    return find_lidar(settings, places, clock=clock())


def plugged(device, path):
    """A turning lidar on a serial port that hears one speed of the line only."""
    emulator = TurningEmulator(device, clock=clock())
    emulator.baud = device.model.baud
    return turning(emulator, path)


@pytest.mark.parametrize("model", [rplidar.A1, rplidar.A1_OLDEST, rplidar.A2, rplidar.C1, rplidar.S2])
async def test_an_rplidar_is_found_at_its_speed_and_left_quiet(tmp_path, model):
    async with plugged(RplidarDevice(model), tmp_path / "port") as emulator:
        emulator.device.streaming = True  # left on by a program that was killed
        found = await look(AUTO, [f"serial://{tmp_path / 'port'}"])
        assert isinstance(found.settings, RplidarSettings)
        assert found.settings.address == f"serial://{tmp_path / 'port'}?baud={model.baud}"
        assert found.identity.startswith("RPLIDAR")
        assert not emulator.device.streaming


@pytest.mark.parametrize("model", [ydlidar.X4, ydlidar.G4])
async def test_a_ydlidar_is_found_at_its_speed(tmp_path, model):
    async with plugged(YdlidarDevice(model), tmp_path / "port") as emulator:
        found = await look(AUTO, [f"serial://{tmp_path / 'port'}"])
        assert found.settings == YdlidarSettings(address=f"serial://{tmp_path / 'port'}?baud={model.baud}")
        assert model.name in found.identity
        assert not emulator.device.streaming


async def test_a_ydlidar_that_never_answers_is_told_by_its_packets(tmp_path):
    async with plugged(YdlidarDevice(ydlidar.X2), tmp_path / "port"):
        found = await look(AUTO, [f"serial://{tmp_path / 'port'}"])
        assert found.settings == YdlidarSettings(address=f"serial://{tmp_path / 'port'}?baud=115200", model="x2")


@pytest.mark.parametrize("way", ["tcp", "serial"])
async def test_a_hokuyo_is_found_on_both_kinds_of_port(tmp_path, way):
    emulator = ScipEmulator(clock=clock())
    if way == "tcp":
        place = f"tcp://127.0.0.1:{await emulator.start_tcp()}"
    else:
        emulator.start_serial(tmp_path / "port")
        place = f"serial://{tmp_path / 'port'}?baud=115200"
    try:
        found = await look(AUTO, [place])
        assert found.settings == HokuyoSettings(address=place)
        assert found.identity.startswith("UST-10LX")
        assert not emulator.streaming
    finally:
        emulator.close()


async def test_what_the_settings_say_counts_for_the_lidar_that_is_found(tmp_path):
    said = AutoLidarSettings(yaw_rad=3.1, mounted_upside_down=True)
    async with plugged(RplidarDevice(), tmp_path / "port"):
        found = await look(said, [f"serial://{tmp_path / 'port'}"])
    assert (found.settings.yaw_rad, found.settings.mounted_upside_down) == (3.1, True)
    assert found.settings.degraded_after_s == RplidarSettings().degraded_after_s


async def test_a_setting_that_the_lidar_cannot_have_is_refused():
    emulator = ScipEmulator(clock=clock())
    try:
        with pytest.raises(ProtocolError, match=r"UST-10LX.*lidar\.yaw_rad = 3\.1"):
            await look(AutoLidarSettings(yaw_rad=3.1), [f"tcp://127.0.0.1:{await emulator.start_tcp()}"])
    finally:
        emulator.close()


async def test_two_lidars_are_refused_and_both_named(tmp_path):
    async with plugged(RplidarDevice(), tmp_path / "one"), plugged(YdlidarDevice(), tmp_path / "two"):
        with pytest.raises(DriverError, match=r"two lidars answer: RPLIDAR.*one.*YDLIDAR.*two.*lidar\.address"):
            await look(AUTO, [f"serial://{tmp_path / name}" for name in ("one", "two")])


async def test_a_broken_lidar_beside_a_good_one_is_not_passed_over(tmp_path):
    device = RplidarDevice()
    device.fault = device.stays_broken = True
    async with plugged(device, tmp_path / "one"), plugged(YdlidarDevice(), tmp_path / "two"):
        with pytest.raises(DriverError, match="two lidars answer"):
            await look(AUTO, [f"serial://{tmp_path / name}" for name in ("one", "two")])


async def test_a_broken_lidar_is_named(tmp_path):
    device = RplidarDevice()
    device.fault = device.stays_broken = True
    async with plugged(device, tmp_path / "port"):
        with pytest.raises(ProtocolError, match="fault that a reset does not clear"):
            await look(AUTO, [f"serial://{tmp_path / 'port'}"])


async def test_silence_and_an_absent_port_are_no_lidar(tmp_path):
    async with plugged(RplidarDevice(), tmp_path / "port") as emulator:
        emulator.silence = True
        with pytest.raises(LinkLost, match=r"no lidar found: .*port: nothing came.*gone.*no such device"):
            await look(AUTO, [f"serial://{tmp_path / name}" for name in ("port", "gone")])


BABBLE = {
    "gps": (b"$GPGGA,123519,4807.038,N,01131.000,E,1,08*47\r\n", "other bytes came"),
    "zero": (bytes(24), "only zero bytes"),
    "reply": (b"\xa5\x5a\x14\x00\x00\x00", "a reply to something else"),
    "noise": (bytes(range(1, 90)), "other bytes came"),
}


async def test_what_sends_something_else_is_no_lidar(tmp_path):
    async def babble(name, line):
        door = SerialDoor(tmp_path / name)
        port = door.plug()
        try:
            while True:
                door.allow_reopening()
                with suppress(BlockingIOError):
                    os.write(port, line)
                await asyncio.sleep(0.01)
        finally:
            door.unplug()

    running = [asyncio.create_task(babble(name, line)) for name, (line, _) in BABBLE.items()]
    await asyncio.sleep(0)
    try:
        with pytest.raises(LinkLost, match="no lidar found") as refused:
            await look(AUTO, [f"serial://{tmp_path / name}" for name in BABBLE])
    finally:
        await end(*running)
    told = str(refused.value).split("; ")
    for (name, (_, words)), one in zip(BABBLE.items(), told, strict=True):
        assert f"/{name}: {words}" in one


async def test_a_motor_controller_is_no_lidar(tmp_path):
    device = VescEmulator(tmp_path / "port", clock=clock())
    device.start()
    try:
        with pytest.raises(LinkLost, match="no lidar found"):
            await look(AUTO, [f"serial://{tmp_path / 'port'}"])
        assert not device.wire
    finally:
        device.close()
