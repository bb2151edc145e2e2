"""The driver against the emulated sensor: scans, checksums, clocks; over TCP and a pseudo-terminal in one loop."""

import asyncio
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from pydantic import ValidationError

from tests.drivers.hokuyo.rig import MakeRig, Rig, sensor
from wallride.drivers.address import TcpAddress
from wallride.drivers.api import LinkState
from wallride.drivers.hokuyo.conversation import Conversation
from wallride.drivers.hokuyo.settings import HokuyoSettings
from wallride.drivers.link import open_link
from wallride.sim.devices.scip_encode import UST_10LX


async def test_it_starts_says_what_it_is_and_delivers_exact_ranges(rig: Rig) -> None:
    await rig.ready()
    assert rig.link() is LinkState.STARTING
    ranges_mm = np.arange(1081) * 61
    ranges_mm[:4] = (0, 19, 20, 30000)
    ranges_mm[4:6] = (30001, 65533)
    scan = await rig.scan(ranges_mm)
    valid = (ranges_mm >= 20) & (ranges_mm <= 30000)
    np.testing.assert_array_equal(np.isnan(scan.ranges_m), ~valid)
    np.testing.assert_array_equal(scan.ranges_m[valid], (ranges_mm[valid] / 1000).astype(np.float32))
    assert np.rad2deg([scan.angle_min_rad, scan.angle_step_rad]) == pytest.approx([-135, 0.25])
    assert (scan.range_min_m, scan.range_max_m, scan.sequence) == (0.02, 30.0, 0)
    assert not scan.ranges_m.flags.writeable
    assert rig.link() is LinkState.READY
    assert rig.health.message == "UST-10LX, 1081 beams, 40 Hz"
    assert rig.health.identity == "UST-10LX, firmware 1.1.8, serial H0000010"


async def test_scans_come_in_order_each_once_across_the_wrap_of_the_sensors_clock(rig: Rig) -> None:
    await rig.ready()
    for number in range(20):
        scan = await rig.scan(np.full(1081, 1000 + number))
        assert (scan.sequence, round(float(scan.ranges_m[0]) * 1000)) == (number, 1000 + number)
        assert 0 <= scan.received_s - scan.stamp_s < 0.1
    assert not rig.counts


async def test_a_bad_checksum_costs_one_scan_and_the_stream_goes_on(rig: Rig) -> None:
    await rig.ready()
    rig.emulator.bad_checksum_every = 5
    await rig.until(lambda: rig.emulator.counts["published"] >= 40, turning=True)
    await rig.until(lambda: len(rig.scans) == 32)
    assert rig.counts == {"checksum": 8}
    assert [scan.sequence for scan in rig.scans] == [number for number in range(40) if number % 5 != 4]


async def test_garbage_between_scans_is_counted_and_survived(rig: Rig) -> None:
    await rig.ready()
    rig.emulator.garbage_every = 4
    await rig.until(lambda: len(rig.scans) >= 30, turning=True)
    assert set(rig.counts) <= {"checksum", "malformed", "stray reply"}
    assert sum(rig.counts.values()) >= 9  # before the 30th good scan of 40, or 39 where the last is one of them
    assert not [scan for scan in rig.scans if set(scan.ranges_m) != {np.float32(1.234)}]


async def test_after_a_stall_only_the_fresh_scans_of_the_burst_are_used(rig: Rig) -> None:
    await rig.ready()
    await rig.scan()
    rig.emulator.stall()
    published, until_s = 0, rig.clock() + 0.2  # by the clock: at 0.3 s the driver would give the stream up
    while rig.clock() < until_s:
        rig.turn()
        published += 1
        await asyncio.sleep(0.005)
    rig.emulator.release()
    await rig.until(lambda: len(rig.scans) + rig.counts.get("stale", 0) == published + 1)
    fresh = rig.scans[1:]
    assert rig.counts["stale"] > published / 4
    assert fresh
    assert all(scan.received_s - scan.stamp_s <= 0.1 for scan in fresh)
    assert fresh[-1].sequence == published


async def test_cancelling_turns_the_laser_off(rig: Rig) -> None:
    await rig.ready()
    await rig.scan()
    assert rig.emulator.sensor.laser_on
    await rig.stop()
    assert rig.task.cancelled()
    assert not rig.emulator.sensor.laser_on


async def test_cancelling_while_the_sensor_does_not_answer_takes_no_time(rig: Rig) -> None:
    await rig.ready()
    await rig.scan()
    rig.emulator.silence = True
    begun_s = rig.clock()
    await rig.stop()
    assert rig.clock() - begun_s < 0.5


async def test_a_sensor_that_hangs_upside_down_has_left_on_the_left(tcp: MakeRig) -> None:
    model = replace(UST_10LX, first_step=100)
    emulator = sensor(model)
    rig = await tcp(emulator, mounted_upside_down=True)
    await rig.ready()
    scan = await rig.scan(np.arange(981) + 1000)
    angles_rad = scan.angle_min_rad + scan.angle_step_rad * np.arange(981)
    assert np.rad2deg(angles_rad[[0, -1]]) == pytest.approx([-135, 110])
    assert round(float(scan.ranges_m[np.argmin(np.abs(angles_rad))]) * 1000) == 1000 + 540 - 100
    assert round(float(scan.ranges_m[-1]) * 1000) == 1000


async def test_a_turned_sensor_gives_bearings_of_the_car(tcp: MakeRig) -> None:
    rig = await tcp(sensor(), yaw_rad=0.1)
    await rig.ready()
    scan = await rig.scan()
    assert scan.angle_min_rad == pytest.approx(np.deg2rad(-135) + 0.1)


async def test_a_clock_that_jumps_in_a_running_stream_is_believed_in_the_end(tcp: MakeRig) -> None:
    rig = await tcp(sensor(), silent_after_s=5.0)
    await rig.ready()
    await rig.scan()

    def jumped() -> bool:
        rig.emulator.publish(np.full(1081, 2000), round(rig.clock() * 1000) + 5_000_000)
        return rig.counts.get("clock_reset", 0) == 1

    await rig.until(jumped)
    assert rig.counts["foreign"] > 20
    await rig.until(lambda: len(rig.scans) > 1)
    assert "restart" not in rig.counts


async def test_a_sensor_that_restarted_its_clock_is_believed_at_once_after_a_reconnect(tcp: MakeRig) -> None:
    rig = await tcp(sensor())
    await rig.ready()
    await rig.scan()
    rig.emulator.disconnect()
    await rig.until(lambda: rig.counts.get("reconnect", 0) == 1)
    await rig.ready()
    begun_s = rig.clock()
    for _ in range(3):
        rig.emulator.publish(np.full(1081, 2000), 17 + round((rig.clock() - begun_s) * 1000))
        await asyncio.sleep(0.025)
    await rig.until(lambda: len(rig.scans) == 2)
    assert rig.counts == {"reconnect": 1, "settling": 2}


async def test_a_stream_that_stays_late_is_restarted(tcp: MakeRig) -> None:
    rig = await tcp(sensor())
    await rig.ready()
    await rig.scan()

    def turned_late() -> bool:
        rig.emulator.publish(np.full(1081, 2000), rig.stamp_ms + round(rig.clock() * 1000) - begun_ms - 200)
        return rig.counts.get("restart", 0) == 1

    begun_ms = round(rig.clock() * 1000)
    await rig.until(lambda: rig.clock() * 1000 - begun_ms > 205)
    await rig.until(turned_late)
    assert rig.counts["stale"] > 10
    await rig.lost_and_found()


async def test_an_answer_is_found_among_the_scans_of_a_running_stream() -> None:
    emulator = sensor()
    link = await open_link(TcpAddress("127.0.0.1", await emulator.start_tcp()), asyncio.get_running_loop().time)
    counted: list[str] = []
    talk = Conversation(link, counted.append)
    await talk.ask(b"MD0000108000000\n")
    for stamp_ms in range(5):
        emulator.publish(np.full(1081, 1234), stamp_ms)
    reply = await talk.ask(b"VV\n")
    assert (reply.echo, len(reply.lines), counted) == (b"VV", 5, [])
    link.close()
    emulator.close()


@pytest.mark.parametrize(
    "wrong",
    [
        {"address": "192.168.0.10"},
        {"address": "tcp://192.168.0.10"},
        {"stale_after_s": 0},
        {"silent_after_s": 0.1},
        {"unknown": 1},
    ],
)
def test_settings_that_make_no_sense_are_refused(wrong: dict[str, Any]) -> None:
    with pytest.raises(ValidationError):
        HokuyoSettings(**wrong)
