"""The drivers of turning lidars against emulated sensors: up, through losses and faults, and down again."""

import asyncio
from collections.abc import Callable
from functools import partial

import numpy as np
import pytest

from tests.drivers.turning.rig import Rig, room_m
from wallride.drivers.api import LinkState, Scan
from wallride.drivers.turning.driver import FIRST_SCAN_TIMEOUT_S
from wallride.drivers.turning.grid import Motion
from wallride.sim.devices import rplidar, ydlidar
from wallride.sim.devices.rplidar import RplidarDevice
from wallride.sim.devices.turning import TurningEmulator
from wallride.sim.devices.ydlidar import YdlidarDevice

SENSORS: dict[str, Callable[[], RplidarDevice | YdlidarDevice]] = {
    **{
        name: partial(RplidarDevice, getattr(rplidar, name.upper().replace(" ", "_")))
        for name in ("a1", "a1 old", "a1 oldest", "a2", "a3", "c1", "s1", "s2", "s3")
    },
    **{
        name: partial(YdlidarDevice, getattr(ydlidar, name.upper().replace("-", "_")))
        for name in ("x4", "x2", "x4-pro", "g4", "g6", "tg")
    },
}
TWO = ["a1", "x4"]


def sensor(name: str) -> TurningEmulator:
    return emulated(SENSORS[name]())


def emulated(device: RplidarDevice | YdlidarDevice) -> TurningEmulator:
    return TurningEmulator(device, clock=asyncio.get_running_loop().time)


def bearings_rad(scan: Scan) -> np.ndarray:
    return scan.angle_min_rad + scan.angle_step_rad * np.arange(scan.ranges_m.size)


def assert_true(scan: Scan) -> None:
    """A scan shows the room: right at 95 % of the beams, the others at the edge between its walls."""
    off_m = np.abs(scan.ranges_m - room_m(bearings_rad(scan)))
    assert np.nanquantile(off_m, 0.95) < 0.03
    assert np.isnan(scan.ranges_m).mean() < 0.02
    assert bearings_rad(scan)[scan.ranges_m.size // 2] == pytest.approx(0.0, abs=1e-9)


@pytest.mark.parametrize("name", SENSORS)
async def test_every_sensor_is_found_at_its_speed_and_shows_the_room(plugged, name):
    device = SENSORS[name]()
    emulator = emulated(device)
    emulator.baud = device.model.baud
    rig = await plugged(emulator)
    scans = await rig.more_scans(6)
    for scan in scans:
        assert_true(scan)
        assert 0 <= scan.received_s - scan.stamp_s < 0.1
    assert rig.link() is LinkState.READY
    gaps_s = np.diff([scan.stamp_s for scan in scans])
    assert np.median(gaps_s) == pytest.approx(1 / emulator.device.turns_hz, rel=0.05)
    assert [scan.sequence for scan in scans] == list(range(scans[0].sequence, scans[0].sequence + 6))
    assert "Hz" in rig.health.message or "beams" not in rig.health.message
    assert "LIDAR" in rig.health.identity


@pytest.mark.parametrize("name", TWO)
async def test_a_bridge_serves_as_well(bridged, name):
    rig = await bridged(sensor(name))
    assert_true((await rig.more_scans())[-1])


@pytest.mark.parametrize("name", TWO)
async def test_a_sensor_that_still_streams_from_a_killed_process_is_used(plugged, name):
    emulator = sensor(name)
    rig = await plugged(emulator)
    emulator.device.feed(b"\xa5\x20" if name == "a1" else b"\xa5\x60")
    assert emulator.device.streaming
    assert_true((await rig.more_scans())[-1])


@pytest.mark.parametrize("name", TWO)
async def test_a_sensor_whose_samples_begin_long_after_the_announcement_is_used(plugged, name):
    emulator = sensor(name)
    emulator.starts_after_s = 1.5
    rig = await plugged(emulator)
    await rig.until(lambda: emulator.streaming)
    announced_s = rig.clock()
    scan = (await rig.more_scans())[0]
    assert 1.5 < scan.received_s - announced_s < 2.5
    assert 0 <= scan.received_s - scan.stamp_s < 0.1
    assert_true(scan)
    assert rig.link() is LinkState.READY
    assert not {"stale", "restart", "reconnect"} & set(rig.counts)


@pytest.mark.parametrize("name", TWO)
async def test_a_head_that_still_spins_up_is_not_faulty_and_one_that_slows_down_later_is(plugged, name):
    device = SENSORS[name]()
    usual_hz, said = device.turns_hz, set[str]()
    rig = await plugged(emulated(device))

    async def turn_at(share: float, duration_s: float) -> None:
        device.turns_hz = share * usual_hz
        for _ in range(round(20 * duration_s)):
            await rig.run_for(0.05)
            said.add(rig.health.message)

    device.turns_hz = 0.6 * usual_hz
    await rig.more_scans(1)
    for share in (0.6, 0.8, 1.0):
        await turn_at(share, 1.0)
    await turn_at(1.0, FIRST_SCAN_TIMEOUT_S)
    assert not [text for text in said if "its head turns at" in text]
    assert f", {usual_hz:.0f} Hz, " in rig.health.message
    await turn_at(0.6, 1.0)
    assert f", {usual_hz:.0f} Hz, " in rig.health.message
    assert f"its head turns at {0.6 * usual_hz:.1f} Hz" in rig.health.message


@pytest.mark.parametrize("name", TWO)
async def test_a_head_that_stands_gives_no_scans(plugged, name):
    rig = await plugged(sensor(name))
    await rig.more_scans()
    rig.emulator.blocked = True
    await rig.until(lambda: rig.link() is LinkState.FAULTY)
    before = len(rig.scans)
    await rig.until(lambda: rig.link() is LinkState.ABSENT or "turn" in rig.health.message)
    assert len(rig.scans) == before
    rig.emulator.blocked = False
    await rig.more_scans()


@pytest.mark.parametrize("name", TWO)
async def test_damage_on_the_line_loses_samples_and_nothing_else(plugged, name):
    emulator = sensor(name)
    emulator.bad_checksum_every, emulator.garbage_every = 23, 37
    rig = await plugged(emulator)
    for scan in await rig.more_scans(8):
        off_m = np.abs(scan.ranges_m - room_m(bearings_rad(scan)))
        assert np.nanquantile(off_m, 0.9) < 0.03
        assert np.isnan(scan.ranges_m).mean() < 0.3
    assert rig.counts["checksum"] > 0


@pytest.mark.parametrize("name", TWO)
async def test_a_link_that_becomes_late_gives_no_scans(plugged, name):
    rig = await plugged(sensor(name), stale_after_s=0.1, silent_after_s=5.0)
    await rig.more_scans()
    rig.emulator.late_s = 0.4
    await rig.run_for(0.8)
    before = len(rig.scans)
    await rig.run_for(0.5)
    assert len(rig.scans) == before
    assert rig.counts["stale"] > 0


@pytest.mark.parametrize("name", TWO)
async def test_a_link_that_became_late_is_late_after_a_restart_too(plugged, name):
    rig = await plugged(sensor(name), stale_after_s=0.1)
    await rig.more_scans()
    rig.emulator.late_s = 0.25
    await rig.until(lambda: rig.counts.get("restart", 0) > 0)
    before = len(rig.scans)
    await rig.run_for(3.0)
    assert len(rig.scans) == before


@pytest.mark.parametrize("name", TWO)
async def test_a_fault_is_reset_once_and_then_named(plugged, name):
    emulator = sensor(name)
    emulator.device.fault = True  # type: ignore[attr-defined] # both devices have it
    rig = await plugged(emulator)
    await rig.more_scans()
    assert rig.counts["reset"] == 1
    assert any(what.startswith("error 0x") for what in rig.counts)


async def test_a_fault_that_stays_is_said(plugged):
    device = RplidarDevice()
    device.fault = device.stays_broken = True
    rig = await plugged(emulated(device))
    await rig.until(lambda: rig.link() is LinkState.FAULTY)
    assert "reset does not clear" in rig.health.message


@pytest.mark.parametrize("name", TWO)
async def test_a_sensor_that_refuses_to_measure_is_said(plugged, name):
    emulator = sensor(name)
    emulator.device.refuses = True  # type: ignore[attr-defined] # both devices have it
    rig = await plugged(emulator)
    await rig.until(lambda: "does not start measuring" in rig.health.message)
    emulator.device.refuses = False  # type: ignore[attr-defined] # both devices have it
    await rig.more_scans()


async def test_the_other_maker_on_the_port_is_named(plugged, tmp_path):
    other = emulated(YdlidarDevice(ydlidar.X2))
    other.start_serial(tmp_path / "other")
    rig = Rig(emulated(RplidarDevice()), f"serial://{tmp_path / 'other'}")
    rig.emulator = other
    await rig.until(lambda: "YDLIDAR" in rig.health.message)
    assert rig.link() is LinkState.ABSENT
    await rig.stop()
    other.close()


async def test_conditions_that_are_not_told_do_not_keep_it_from_measuring(plugged):
    device = YdlidarDevice()
    device.unanswered = frozenset({0x91, 0x92})
    rig = await plugged(emulated(device))
    await rig.more_scans()
    assert rig.counts["no condition told"] == 1


@pytest.mark.parametrize("name", TWO)
async def test_a_stored_turn_gives_no_scans_to_a_car_that_moves(plugged, name):
    rig = await plugged(sensor(name), motion=lambda: Motion(1.0, 0.0, 0.0))
    await rig.more_scans()
    rig.emulator.frozen = True
    await rig.until(lambda: "repeats one turn" in rig.health.message)
    before = len(rig.scans)
    await rig.run_for(1.5)
    assert len(rig.scans) == before
    rig.emulator.frozen = False
    await rig.more_scans()
    assert rig.link() is LinkState.READY


@pytest.mark.parametrize("name", TWO)
async def test_a_covered_sensor_sees_nothing(plugged, name):
    rig = await plugged(sensor(name))
    await rig.more_scans()
    rig.emulator.covered_mm = 40
    await rig.more_scans(2)
    assert np.isnan((await rig.more_scans(1))[0].ranges_m).all()


async def test_a_sensor_that_says_it_is_another_model_than_the_named_one_is_refused(plugged):
    rig = await plugged(sensor("g6"), model="tg")
    await rig.until(lambda: "a YDLIDAR G6, and lidar.model names a TG" in rig.health.message)
    assert not rig.scans
