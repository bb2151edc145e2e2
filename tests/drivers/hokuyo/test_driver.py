"""The driver against the emulated sensor, real bytes over TCP and a pseudo-terminal in one event loop."""

import asyncio
import time
from collections.abc import AsyncIterator, Awaitable, Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
import pytest
from pydantic import ValidationError

from drivers.address import SerialAddress, TcpAddress
from drivers.api import Clock, Health, LinkState, Scan
from drivers.hokuyo import driver
from drivers.hokuyo.conversation import Conversation
from drivers.hokuyo.driver import Hokuyo
from drivers.hokuyo.settings import HokuyoSettings
from drivers.link import ByteLink, open_link
from sim.devices.scip import ScipEmulator
from sim.devices.scip_encode import URG_04LX, UST_10LX, UTM_30LX
from tests.promises import promise

LIMIT_S = 8.0
Ranges = npt.NDArray[np.int_]


class Rig:
    """A sensor that turns, and a driver that listens; `scans` collects what came out."""

    def __init__(self, emulator: ScipEmulator, address: str, **settings: Any) -> None:
        self.emulator = emulator
        self.driver = Hokuyo(HokuyoSettings(address=address, **settings))
        self.scans: list[Scan] = []
        self.stamp_ms = 16_777_100
        self.task = asyncio.create_task(self.driver.run(self.scans.append))

    @property
    def health(self) -> Health:
        return self.driver.health

    def link(self) -> LinkState:
        return self.driver.health.link

    @property
    def counts(self) -> dict[str, int]:
        return self.driver.health.counts

    async def until(self, condition: Callable[[], bool], *, turning: bool = False) -> None:
        """Wait for a condition, publishing scans at 200 Hz meanwhile if the sensor is `turning`."""
        async with asyncio.timeout(LIMIT_S):
            while not condition():
                if self.task.done():
                    self.task.result()
                if turning:
                    self.turn()
                await asyncio.sleep(0.005)

    def turn(self, ranges_mm: Ranges | None = None) -> float | None:
        """Publish one revolution 5 ms after the last; the stamp follows our clock, as a sensor's does."""
        self.stamp_ms = 16_777_100 + round(time.monotonic() * 1000)
        count = self.emulator.sensor.model.beam_count
        return self.emulator.publish(np.full(count, 1234) if ranges_mm is None else ranges_mm, self.stamp_ms)

    async def scan(self, ranges_mm: Ranges | None = None) -> Scan:
        """Publish one revolution and return the scan that comes out of it."""
        before = len(self.scans)
        await asyncio.sleep(0.002)
        assert self.turn(ranges_mm) is not None
        await self.until(lambda: len(self.scans) > before)
        return self.scans[-1]

    async def ready(self) -> None:
        await self.until(lambda: self.emulator.streaming)

    async def lost_and_found(self) -> None:
        """Wait until scans have stopped, and come again by themselves."""
        await self.until(lambda: self.emulator.streaming)
        before = len(self.scans)
        await self.until(lambda: len(self.scans) >= before + 3 and self.health.link is LinkState.READY, turning=True)


MakeRig = Callable[..., Awaitable[Rig]]


async def stop(rig: Rig) -> None:
    rig.task.cancel()
    await asyncio.gather(rig.task, return_exceptions=True)


@pytest.fixture(params=["tcp", "serial"])
async def rig(request: pytest.FixtureRequest, tmp_path: Path) -> AsyncIterator[Rig]:
    emulator = ScipEmulator()
    if request.param == "tcp":
        address = f"tcp://127.0.0.1:{await emulator.start_tcp()}"
    else:
        emulator.start_serial(tmp_path / "lidar")
        address = f"serial://{tmp_path / 'lidar'}"
    rig = Rig(emulator, address, silent_after_s=0.3)
    yield rig
    await stop(rig)
    emulator.close()


@pytest.fixture
async def tcp() -> AsyncIterator[MakeRig]:
    """A rig maker over TCP, for emulators that are prepared first."""
    rigs: list[Rig] = []

    async def make(emulator: ScipEmulator, **settings: Any) -> Rig:
        address = f"tcp://127.0.0.1:{await emulator.start_tcp()}"
        rigs.append(Rig(emulator, address, **{"silent_after_s": 0.3, **settings}))
        return rigs[-1]

    yield make
    for rig in rigs:
        await stop(rig)
        rig.emulator.close()


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


async def test_bytes_that_dribble_make_the_same_scans(rig: Rig) -> None:
    await rig.ready()
    rig.emulator.dribble_s = 0.015
    for number in range(5):
        rig.turn(np.arange(1081) + 100 + number)
        async with asyncio.timeout(LIMIT_S):
            while len(rig.scans) == number:
                await asyncio.sleep(0.001)
        np.testing.assert_array_equal(np.round(rig.scans[-1].ranges_m * 1000), np.arange(1081) + 100 + number)
    assert not rig.counts


async def test_after_a_stall_only_the_fresh_scans_of_the_burst_are_used(rig: Rig) -> None:
    await rig.ready()
    await rig.scan()
    rig.emulator.stall()
    published, until_s = 0, time.monotonic() + 0.2  # by the clock: at 0.3 s the driver would give the stream up
    while time.monotonic() < until_s:
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


async def test_silence_is_noticed_and_the_stream_restarted(rig: Rig) -> None:
    await rig.ready()
    await rig.scan()
    await rig.until(lambda: rig.link() is LinkState.FAULTY)
    assert "no scan for" in rig.health.message
    await rig.until(lambda: rig.counts.get("restart", 0) >= 1)
    await rig.lost_and_found()


async def test_a_sensor_that_does_not_answer_is_reconnected_for_as_long_as_it_takes(rig: Rig) -> None:
    await rig.ready()
    await rig.scan()
    rig.emulator.silence = True
    await rig.until(lambda: rig.counts.get("reconnect", 0) >= 2)
    assert rig.link() is LinkState.ABSENT
    assert "no answer to QT" in rig.health.message
    rig.emulator.silence = False
    await rig.lost_and_found()


async def test_cancelling_turns_the_laser_off(rig: Rig) -> None:
    await rig.ready()
    await rig.scan()
    assert rig.emulator.sensor.laser_on
    await stop(rig)
    assert rig.task.cancelled()
    assert not rig.emulator.sensor.laser_on


async def test_cancelling_while_the_sensor_does_not_answer_takes_no_time(rig: Rig) -> None:
    await rig.ready()
    await rig.scan()
    rig.emulator.silence = True
    begun_s = time.monotonic()
    await stop(rig)
    promise("cancelling", time.monotonic() - begun_s, 0.5)


async def test_an_error_in_the_callback_comes_out_of_run(tcp: MakeRig) -> None:
    rig = await tcp(ScipEmulator())
    await rig.ready()
    await stop(rig)

    def explode(_scan: Scan) -> None:
        raise RuntimeError("a bug")

    rig.task = asyncio.create_task(rig.driver.run(explode))
    with pytest.raises(RuntimeError, match="a bug"):
        await rig.until(lambda: False, turning=True)


async def test_every_dropped_connection_is_opened_again_at_once(tcp: MakeRig, monkeypatch: pytest.MonkeyPatch) -> None:
    """After a second attempt without a scan between it would wait longer than the test's patience."""
    monkeypatch.setattr(driver, "RETRY_DELAYS_S", (0.05, 10 * LIMIT_S))
    rig = await tcp(ScipEmulator())
    await rig.ready()
    await rig.scan()
    for losses in range(1, 4):
        rig.emulator.disconnect()
        await rig.until(lambda losses=losses: rig.counts.get("reconnect", 0) == losses)
        await rig.lost_and_found()
        watched = len(rig.scans) + 40  # two looks at the stream, which come ten times a second
        await rig.until(lambda watched=watched: len(rig.scans) >= watched, turning=True)
        assert rig.counts["reconnect"] == losses


async def test_a_refused_connection_is_tried_until_it_succeeds(tcp: MakeRig) -> None:
    emulator = ScipEmulator()
    rig = await tcp(emulator)
    await rig.ready()
    emulator.refuse()
    emulator.disconnect()
    await rig.until(lambda: rig.counts.get("reconnect", 0) >= 2)
    assert rig.link() is LinkState.ABSENT
    assert "refused" in rig.health.message
    emulator.listen_again()
    await rig.lost_and_found()


async def test_an_unplugged_cable_comes_back_under_the_same_name(tmp_path: Path) -> None:
    emulator = ScipEmulator(URG_04LX)
    emulator.start_serial(tmp_path / "lidar")
    rig = Rig(emulator, f"serial://{tmp_path / 'lidar'}?baud=115200")
    await rig.ready()
    assert np.rad2deg((await rig.scan()).angle_min_rad) == pytest.approx((44 - 384) * 360 / 1024)
    assert rig.health.message == "URG-04LX, 682 beams, 10 Hz"
    emulator.unplug()
    await rig.until(lambda: rig.counts.get("reconnect", 0) >= 1)
    assert rig.link() is LinkState.ABSENT
    emulator.replug()
    await rig.lost_and_found()
    await stop(rig)
    emulator.close()


async def test_the_speed_of_a_serial_sensor_is_found(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    emulator = ScipEmulator(URG_04LX)
    emulator.baud = 19200
    emulator.start_serial(tmp_path / "lidar")
    rig = Rig(emulator, f"serial://{tmp_path / 'lidar'}")
    await rig.until(lambda: emulator.streaming)
    assert (await rig.scan()).ranges_m.shape == (682,)
    emulator.unplug()
    await rig.until(lambda: rig.counts.get("reconnect", 0) >= 1)
    tried: list[int] = []

    def opened(address: SerialAddress, clock: Clock) -> Awaitable[ByteLink]:
        tried.append(address.baud)
        return open_link(address, clock)

    monkeypatch.setattr(driver, "open_link", opened)
    emulator.replug()
    await rig.lost_and_found()
    assert set(tried) == {19200}, "the speed that was found is tried first, and is enough"
    await stop(rig)
    emulator.close()


async def test_the_parameters_are_read_again_after_a_reconnect(tcp: MakeRig) -> None:
    emulator = ScipEmulator()
    rig = await tcp(emulator)
    await rig.ready()
    assert (await rig.scan()).range_max_m == 30.0
    emulator.disconnect()
    emulator.sensor.model = replace(UTM_30LX, first_step=0, last_step=719, front_step=360)
    await rig.lost_and_found()
    assert rig.scans[-1].range_max_m == 60.0
    assert rig.scans[-1].ranges_m.shape == (720,)
    assert rig.counts["another sensor"] == 1
    assert rig.health.message == "UTM-30LX, 720 beams, 40 Hz"


async def test_of_a_restarted_stream_only_the_third_fresh_scan_is_driven_by(rig: Rig) -> None:
    await rig.ready()
    await rig.scan()
    await rig.until(lambda: rig.counts.get("restart", 0) >= 1 or rig.counts.get("reconnect", 0) >= 1)
    await rig.until(lambda: rig.link() is LinkState.STARTING)
    await rig.until(lambda: len(rig.scans) >= 2, turning=True)
    before, after = rig.scans[:2]
    assert after.sequence >= before.sequence + 3
    assert rig.counts["settling"] >= 2
    assert rig.link() is LinkState.READY


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"first_step": 190}, "sees from -88 to 135 degrees, and a car needs -90 to 90"),
        ({"last_step": 890}, "sees from -135 to 88 degrees"),
        ({"steps_per_turn": 348, "first_step": 10, "last_step": 250, "front_step": 130}, "has a beam every 1 degrees"),
        ({"steps_per_turn": 240, "first_step": 0, "last_step": 180, "front_step": 90}, "has a beam every 1.5 degrees"),
        ({"speed_rpm": 299}, "turns at 5 Hz, and a car needs 5 Hz or more"),
    ],
)
async def test_a_sensor_that_no_car_can_be_driven_by_is_refused_with_the_reason(
    tcp: MakeRig, changes: dict[str, Any], words: str
) -> None:
    rig = await tcp(ScipEmulator(replace(UST_10LX, **changes)))
    await rig.until(lambda: rig.link() is LinkState.FAULTY)
    assert words in rig.health.message
    assert not rig.emulator.streaming
    rig.emulator.sensor.model = UST_10LX
    await rig.until(lambda: rig.link() is LinkState.READY, turning=True)


@pytest.mark.parametrize(
    "changes",
    [
        {"first_step": 180, "last_step": 899},
        {"steps_per_turn": 360, "first_step": 0, "last_step": 240, "front_step": 120},
        {"speed_rpm": 300},
    ],
)
async def test_a_sensor_that_is_just_good_enough_is_taken(tcp: MakeRig, changes: dict[str, Any]) -> None:
    rig = await tcp(ScipEmulator(replace(UST_10LX, **changes)))
    await rig.until(lambda: rig.link() is LinkState.READY, turning=True)


async def test_a_sensor_left_streaming_by_a_killed_program_is_taken_over(tmp_path: Path) -> None:
    emulator = ScipEmulator()
    emulator.start_serial(tmp_path / "lidar")
    emulator.sensor.answer(b"MD0000108000000")
    rig = Rig(emulator, f"serial://{tmp_path / 'lidar'}")
    await rig.until(lambda: len(rig.scans) > 3, turning=True)
    assert "reconnect" not in rig.counts
    await stop(rig)
    emulator.close()


@pytest.mark.parametrize("attribute", ["scip1", "in_time_sync"])
async def test_a_sensor_in_the_wrong_mode_is_brought_back(tcp: MakeRig, attribute: str) -> None:
    emulator = ScipEmulator(URG_04LX)
    rig = await tcp(emulator)
    await rig.until(lambda: emulator.connected)
    setattr(emulator.sensor, attribute, True)
    await rig.ready()
    await rig.scan()
    assert getattr(emulator.sensor, attribute) is False
    assert "reconnect" not in rig.counts


async def test_an_unstable_sensor_keeps_its_stream_and_says_so(tcp: MakeRig) -> None:
    rig = await tcp(ScipEmulator())
    await rig.ready()
    await rig.scan()
    for _ in range(100):
        assert rig.emulator.publish_status("0M") is not None
        await asyncio.sleep(0.01)
    assert rig.link() is LinkState.FAULTY
    assert "checks itself" in rig.health.message
    assert set(rig.counts) == {"unstable"}
    rig.emulator.publish_status("98")
    assert (await rig.scan()).sequence == rig.counts["unstable"] + 1
    assert rig.link() is LinkState.READY


async def test_a_sensor_in_trouble_is_reset(tcp: MakeRig) -> None:
    rig = await tcp(ScipEmulator())
    await rig.ready()
    await rig.scan()
    rig.emulator.sensor.fault = "0L"
    rig.emulator.publish_status("0L")
    await rig.until(lambda: rig.link() is LinkState.FAULTY)
    assert "status 0L" in rig.health.message
    await rig.until(lambda: rig.counts.get("restart", 0) == 1)
    await rig.lost_and_found()
    assert rig.emulator.counts["reboot"] == 0


async def test_a_sensor_that_a_reset_does_not_cure_is_rebooted_once(tcp: MakeRig) -> None:
    emulator = ScipEmulator()
    emulator.sensor.fault = "50"
    emulator.sensor.cured_by = frozenset({"RB"})
    rig = await tcp(emulator)
    await rig.until(lambda: emulator.counts["reboot"] == 1)
    await rig.lost_and_found()
    assert rig.counts["reboot"] == 1


async def test_a_sensor_that_nothing_cures_is_rebooted_once_in_20_s_and_a_human_is_called(tcp: MakeRig) -> None:
    emulator = ScipEmulator()
    emulator.sensor.fault = "50"
    emulator.sensor.cured_by = frozenset()
    rig = await tcp(emulator)
    await rig.until(lambda: rig.counts.get("reconnect", 0) >= 3)
    assert emulator.counts["reboot"] == 1
    assert rig.link() in {LinkState.FAULTY, LinkState.STARTING}
    await rig.until(lambda: "did not help: power-cycle it" in rig.health.message)


async def test_what_a_sensor_says_against_itself_is_passed_on(tcp: MakeRig) -> None:
    emulator = ScipEmulator()
    emulator.sensor.state_text = "Trouble!! Error No. =[12]"
    rig = await tcp(emulator)
    await rig.ready()
    await rig.scan()
    assert "Trouble!! Error No. =[12]" in rig.health.message


async def test_a_sensor_that_hangs_upside_down_has_left_on_the_left(tcp: MakeRig) -> None:
    model = replace(UST_10LX, first_step=100)
    emulator = ScipEmulator(model)
    rig = await tcp(emulator, mounted_upside_down=True)
    await rig.ready()
    scan = await rig.scan(np.arange(981) + 1000)
    angles_rad = scan.angle_min_rad + scan.angle_step_rad * np.arange(981)
    assert np.rad2deg(angles_rad[[0, -1]]) == pytest.approx([-135, 110])
    assert round(float(scan.ranges_m[np.argmin(np.abs(angles_rad))]) * 1000) == 1000 + 540 - 100
    assert round(float(scan.ranges_m[-1]) * 1000) == 1000


async def test_a_clock_that_jumps_in_a_running_stream_is_believed_in_the_end(tcp: MakeRig) -> None:
    rig = await tcp(ScipEmulator(), silent_after_s=5.0)
    await rig.ready()
    await rig.scan()

    def jumped() -> bool:
        rig.emulator.publish(np.full(1081, 2000), round(time.monotonic() * 1000) + 5_000_000)
        return rig.counts.get("clock_reset", 0) == 1

    await rig.until(jumped)
    assert rig.counts["foreign"] > 20
    await rig.until(lambda: len(rig.scans) > 1)
    assert "restart" not in rig.counts


async def test_a_sensor_that_restarted_its_clock_is_believed_at_once_after_a_reconnect(tcp: MakeRig) -> None:
    rig = await tcp(ScipEmulator())
    await rig.ready()
    await rig.scan()
    rig.emulator.disconnect()
    await rig.until(lambda: rig.counts.get("reconnect", 0) == 1)
    await rig.ready()
    begun_s = time.monotonic()
    for _ in range(3):
        rig.emulator.publish(np.full(1081, 2000), 17 + round((time.monotonic() - begun_s) * 1000))
        await asyncio.sleep(0.025)
    await rig.until(lambda: len(rig.scans) == 2)
    assert rig.counts == {"reconnect": 1, "settling": 2}


async def test_a_stream_that_stays_late_is_restarted(tcp: MakeRig) -> None:
    rig = await tcp(ScipEmulator())
    await rig.ready()
    await rig.scan()

    def turned_late() -> bool:
        rig.emulator.publish(np.full(1081, 2000), rig.stamp_ms + round(time.monotonic() * 1000) - begun_ms - 200)
        return rig.counts.get("restart", 0) == 1

    begun_ms = round(time.monotonic() * 1000)
    await rig.until(lambda: time.monotonic() * 1000 - begun_ms > 205)
    await rig.until(turned_late)
    assert rig.counts["stale"] > 10
    await rig.lost_and_found()


async def test_an_answer_is_found_among_the_scans_of_a_running_stream() -> None:
    emulator = ScipEmulator()
    link = await open_link(TcpAddress("127.0.0.1", await emulator.start_tcp()), time.monotonic)
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
