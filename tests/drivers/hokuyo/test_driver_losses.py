"""A lidar that falls silent, is unplugged or refuses is found again, by the driver alone."""

from collections.abc import Awaitable
from dataclasses import replace

import numpy as np
import pytest

from tests.drivers.hokuyo.rig import LIMIT_S, MakeRig, Rig, sensor
from wallride.drivers import lidar
from wallride.drivers.address import SerialAddress
from wallride.drivers.api import Clock, LinkState
from wallride.drivers.link import ByteLink, open_link
from wallride.sim.devices.scip_encode import URG_04LX, UTM_30LX


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


async def test_every_dropped_connection_is_opened_again_at_once(tcp: MakeRig, monkeypatch: pytest.MonkeyPatch) -> None:
    """After a second attempt without a scan between it would wait longer than the test's patience."""
    monkeypatch.setattr(lidar, "RETRY_DELAYS_S", (0.05, 10 * LIMIT_S))
    rig = await tcp(sensor())
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
    emulator = sensor()
    rig = await tcp(emulator)
    await rig.ready()
    emulator.refuse()
    emulator.disconnect()
    await rig.until(lambda: rig.counts.get("reconnect", 0) >= 2)
    assert rig.link() is LinkState.ABSENT
    assert "refused" in rig.health.message
    emulator.listen_again()
    await rig.lost_and_found()


async def test_an_unplugged_cable_comes_back_under_the_same_name(serial: MakeRig) -> None:
    emulator = sensor(URG_04LX)
    rig = await serial(emulator, "?baud=115200")
    await rig.ready()
    assert np.rad2deg((await rig.scan()).angle_min_rad) == pytest.approx((44 - 384) * 360 / 1024)
    assert rig.health.message == "URG-04LX, 682 beams, 10 Hz"
    emulator.unplug()
    await rig.until(lambda: rig.counts.get("reconnect", 0) >= 1)
    assert rig.link() is LinkState.ABSENT
    emulator.replug()
    await rig.lost_and_found()


async def test_the_speed_of_a_serial_sensor_is_found(serial: MakeRig, monkeypatch: pytest.MonkeyPatch) -> None:
    emulator = sensor(URG_04LX)
    emulator.baud = 19200
    rig = await serial(emulator)
    await rig.until(lambda: emulator.streaming)
    assert (await rig.scan()).ranges_m.shape == (682,)
    emulator.unplug()
    await rig.until(lambda: rig.counts.get("reconnect", 0) >= 1)
    tried: list[int] = []

    def opened(address: SerialAddress, clock: Clock, *, dtr: bool) -> Awaitable[ByteLink]:
        tried.append(address.baud)
        return open_link(address, clock, dtr=dtr)

    monkeypatch.setattr(lidar, "open_link", opened)
    emulator.replug()
    await rig.lost_and_found()
    assert set(tried) == {19200}, "the speed that was found is tried first, and is enough"


async def test_the_parameters_are_read_again_after_a_reconnect(tcp: MakeRig) -> None:
    emulator = sensor()
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


async def test_without_the_sensors_time_only_the_third_fresh_scan_of_a_restarted_stream_is_driven_by(rig: Rig) -> None:
    rig.emulator.sensor.refused = frozenset({"TM0"})
    await rig.ready()
    await rig.scan()
    await rig.until(lambda: rig.counts.get("restart", 0) >= 1 or rig.counts.get("reconnect", 0) >= 1)
    await rig.until(lambda: rig.link() is LinkState.STARTING)
    await rig.until(lambda: len(rig.scans) >= 2, turning=True)
    before, after = rig.scans[:2]
    assert after.sequence >= before.sequence + 3
    assert rig.counts["settling"] >= 2
    assert rig.link() is LinkState.READY


async def test_a_sensor_left_streaming_by_a_killed_program_is_taken_over(serial: MakeRig) -> None:
    emulator = sensor()
    emulator.sensor.answer(b"MD0000108000000")
    rig = await serial(emulator)
    await rig.until(lambda: len(rig.scans) > 3, turning=True)
    assert "reconnect" not in rig.counts


@pytest.mark.parametrize("attribute", ["scip1", "in_time_sync"])
async def test_a_sensor_in_the_wrong_mode_is_brought_back(tcp: MakeRig, attribute: str) -> None:
    emulator = sensor(URG_04LX)
    rig = await tcp(emulator)
    await rig.until(lambda: emulator.connected)
    setattr(emulator.sensor, attribute, True)
    await rig.ready()
    await rig.scan()
    assert getattr(emulator.sensor, attribute) is False
    assert "reconnect" not in rig.counts
