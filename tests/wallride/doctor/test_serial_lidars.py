"""Problems planted in emulated RPLIDAR and YDLIDAR lidars: the doctor finds each, and names the remedy."""

import asyncio
from pathlib import Path
from typing import Any

import pytest

from tests.drivers.turning.rig import turning
from tests.wallride.doctor.fakes import changed, healthy, link, settings
from wallride.doctor.examine import examine
from wallride.doctor.findings import Finding, Level
from wallride.doctor.lidar import LidarReport, judge_lidar, look_at_lidar, remedy_of
from wallride.doctor.ports import check_ports
from wallride.drivers.api import Health, LinkState
from wallride.drivers.rplidar.settings import RplidarSettings
from wallride.drivers.turning.conversation import describe
from wallride.drivers.ydlidar.settings import YdlidarSettings
from wallride.runtime.settings.devices import AnyLidarSettings
from wallride.runtime.settings.tree import Settings
from wallride.sim.devices.rplidar import RplidarDevice
from wallride.sim.devices.turning import TurningEmulator
from wallride.sim.devices.ydlidar import X2, YdlidarDevice


def emulated(device: RplidarDevice | YdlidarDevice) -> TurningEmulator:
    return TurningEmulator(device, clock=asyncio.get_running_loop().time)


async def found(emulator: TurningEmulator, chosen: AnyLidarSettings, path: Path) -> dict[str, Finding]:
    """Return the doctor's findings on an emulated lidar by their subjects."""
    async with turning(emulator, path):
        return {finding.subject: finding for finding in judge_lidar(await look_at_lidar(chosen))}


def rplidar(path: Path, **values: Any) -> RplidarSettings:
    return RplidarSettings(address=f"serial://{path}", **values)


@pytest.mark.parametrize("maker", ["rplidar", "ydlidar"])
async def test_a_healthy_lidar_is_ok(tmp_path, maker):
    path = tmp_path / "lidar"
    device = RplidarDevice() if maker == "rplidar" else YdlidarDevice()
    chosen = rplidar(path) if maker == "rplidar" else YdlidarSettings(address=f"serial://{path}")
    told = await found(emulated(device), chosen, path)
    assert {one.level for one in told.values()} == {Level.OK}
    assert "LIDAR" in told["lidar"].words
    assert not device.streaming


def silent() -> TurningEmulator:
    emulator = emulated(RplidarDevice())
    emulator.silence = True
    return emulator


def refusing() -> TurningEmulator:
    device = RplidarDevice()
    device.refuses = True
    return emulated(device)


@pytest.mark.parametrize(
    ("plugged_in", "remedy"),
    [
        (lambda: emulated(YdlidarDevice(X2)), 'lidar.driver = "ydlidar"'),
        (refusing, "hub with a supply"),
        (silent, "5 V"),
    ],
    ids=["a ydlidar", "a motor that takes too much", "silence"],
)
async def test_what_is_wrong_at_the_port_of_an_rplidar_has_its_remedy(tmp_path, plugged_in, remedy):
    told = await found(plugged_in(), rplidar(tmp_path / "lidar"), tmp_path / "lidar")
    assert told["lidar"].level is Level.FAIL
    assert remedy in told["lidar"].remedy


async def test_an_error_that_was_reset_is_told(tmp_path):
    device = RplidarDevice()
    device.fault = True
    told = await found(emulated(device), rplidar(tmp_path / "lidar"), tmp_path / "lidar")
    assert "0x0004" in told["lidar condition"].words


@pytest.mark.parametrize(
    "heard",
    [b"", bytes(40), b"\xaa\x55\x00\x08ab\xaa\x55", b"\xa5\x5a\x14", b"99b\n\n", b"\x01\x02", bytes(range(1, 90))],
)
def test_every_sign_of_another_device_has_a_remedy_of_its_own(heard):
    assert remedy_of(describe(heard)) != remedy_of("what no driver says")


def at_raw(one: Any) -> None:
    link(one.root, "dev/ttyUSB0", "/dev/null")


@pytest.mark.parametrize(("plant", "level"), [(None, Level.FAIL), (at_raw, Level.WARN)])
def test_an_adapter_is_named_by_its_id(tmp_path, plant, level):
    computer = changed(healthy(tmp_path / "root"))
    if plant is not None:
        plant(computer)
    chosen = settings("lidar.driver=rplidar", "lidar.address=serial:///dev/ttyUSB0")
    told = {finding.subject: finding for finding in check_ports(computer, chosen)}["lidar port"]
    assert told.level is level
    assert "/dev/serial/by-id" in told.remedy


async def test_a_port_that_is_not_there_is_told_where_the_lidar_alone_is_looked_at(tmp_path):
    """Else the doctor would find nothing, and call that well."""
    chosen = settings("lidar.driver=rplidar", "lidar.address=serial:///dev/not-there")
    for groups in (("lidar",), ("ports", "lidar")):
        told = [one async for one in examine(healthy(tmp_path / "_".join(groups)), chosen, groups)]
        assert [one.level for one in told if one.subject == "lidar port"] == [Level.FAIL]


async def test_what_auto_finds_is_named_and_looked_at(tmp_path):
    device, path = emulated(RplidarDevice()), tmp_path / "lidar"
    chosen = settings("lidar.driver=auto", f"lidar.address=serial://{path}")
    told = await looked_at(device, path, tmp_path, chosen)
    assert {one.level for one in told.values()} == {Level.OK}
    assert f"rplidar at serial://{path}?baud=115200" in told["lidar kind"].words
    assert "RPLIDAR" in told["lidar"].words


async def test_what_auto_cannot_find_is_told_with_its_remedy(tmp_path):
    device, path = silent(), tmp_path / "lidar"
    chosen = settings("lidar.driver=auto", f"lidar.address=serial://{path}")
    told = await looked_at(device, path, tmp_path, chosen)
    assert told["lidar"].level is Level.FAIL
    assert "plug it in" in told["lidar"].remedy


async def looked_at(emulator: TurningEmulator, path: Path, root: Path, chosen: Settings) -> dict[str, Finding]:
    """Return the findings of `wallride doctor --only lidar` by their subjects."""
    computer = healthy(root / "computer")
    link(computer.root, str(path).lstrip("/"), "/dev/zero")
    async with turning(emulator, path):
        return {one.subject: one async for one in examine(computer, chosen, ("lidar",))}


def test_a_lidar_that_fails_after_a_few_scans_is_a_failure():
    report = LidarReport(Health(LinkState.STARTING, "no whole turn for 0.5 s"))
    report.scans = [None] * 3  # type: ignore[list-item] # only their number counts
    (found,) = judge_lidar(report)
    assert (found.level, found.words) == (Level.FAIL, "no whole turn for 0.5 s")
