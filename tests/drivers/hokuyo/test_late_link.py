"""Sensors behind a link that is late, and sensors that do not tell their time, or other things that are for comfort."""

import asyncio

import pytest

from tests.drivers.hokuyo.rig import MakeRig, Rig, sensor
from wallride.drivers.api import LinkState
from wallride.sim.devices.scip_encode import UST_10LX

TIMELESS = "; it does not tell its time (TM): its scans count as "


async def turn_for(rig: Rig, seconds: float) -> None:
    until_s = rig.clock() + seconds
    while rig.clock() < until_s:
        rig.turn()
        await asyncio.sleep(0.02)


@pytest.mark.parametrize("refused", [set(), {"TM0"}])
async def test_a_link_that_is_late_from_the_first_byte_delivers_no_scan_and_says_so(
    tcp: MakeRig, refused: set[str]
) -> None:
    emulator = sensor()
    emulator.late_s, emulator.sensor.refused = 0.2, frozenset(refused)
    rig = await tcp(emulator, silent_after_s=0.5)
    await rig.ready()
    await turn_for(rig, 0.7)
    assert rig.counts["stale"] > 5
    assert "its scans come 0." in rig.health.message
    assert rig.link() is LinkState.FAULTY
    assert not rig.scans


async def test_a_link_that_is_a_little_late_delivers_scans_as_old_as_they_are(tcp: MakeRig) -> None:
    emulator = sensor()
    emulator.late_s = 0.07
    rig = await tcp(emulator, stale_after_s=0.5)
    await rig.ready()
    await turn_for(rig, 0.5)
    ages_s = [scan.received_s - scan.stamp_s for scan in rig.scans]
    assert min(ages_s) > 0.06
    assert "; its scans come 0." in rig.health.message


async def test_the_sensors_time_is_read_before_it_measures_and_left_again(rig: Rig) -> None:
    await rig.ready()
    assert not rig.emulator.sensor.in_time_sync
    await rig.scan()
    await asyncio.sleep(0.12)
    assert rig.health.message == UST_10LX_SUMMARY


UST_10LX_SUMMARY = f"{UST_10LX.model}, 1081 beams, 40 Hz"


@pytest.mark.parametrize(
    ("attribute", "commands"),
    [
        ("refused", {"TM0"}),
        ("refused", {"TM1"}),
        ("refused", {"TM0", "TM1", "TM2"}),
        ("unanswered", {"TM0"}),
        ("unanswered", {"TM1"}),
        ("unanswered", {"TM0", "TM1", "TM2"}),
        ("damaged", {"TM0"}),
        ("damaged", {"TM1"}),
        ("damaged", {"TM2"}),
    ],
)
async def test_a_sensor_that_does_not_tell_its_time_is_driven_by_all_the_same(
    tcp: MakeRig, attribute: str, commands: set[str]
) -> None:
    emulator = sensor()
    setattr(emulator.sensor, attribute, frozenset(commands))
    rig = await tcp(emulator)
    await rig.ready()
    scan = await rig.scan()
    assert scan.received_s - scan.stamp_s < 0.05
    await rig.until(lambda: rig.health.message.startswith(UST_10LX_SUMMARY + TIMELESS), turning=True)
    assert "reconnect" not in rig.counts


async def test_a_sensor_that_did_not_tell_its_time_once_is_not_asked_again(tcp: MakeRig) -> None:
    emulator = sensor()
    emulator.sensor.unanswered = frozenset({"TM0"})
    rig = await tcp(emulator)
    await rig.ready()
    emulator.sensor.unanswered = frozenset()
    emulator.disconnect()
    await rig.lost_and_found()
    await rig.until(lambda: TIMELESS in rig.health.message, turning=True)


async def test_a_sensor_that_stamps_with_another_clock_than_it_tells_is_driven_by_all_the_same(tcp: MakeRig) -> None:
    rig = await tcp(sensor())
    await rig.ready()
    await rig.scan()
    rig.emulator.disconnect()
    await rig.until(lambda: rig.counts.get("reconnect", 0) == 1)
    await rig.ready()
    rig.emulator.sensor.jump(402_695)
    before = len(rig.scans)
    await rig.until(lambda: len(rig.scans) > before, turning=True)
    await rig.until(lambda: TIMELESS in rig.health.message, turning=True)
