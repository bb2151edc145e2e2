"""Sensors that no car can be driven by, and sensors in trouble."""

import asyncio
from dataclasses import replace
from typing import Any

import pytest

from tests.drivers.hokuyo.rig import MakeRig, sensor
from wallride.drivers.api import LinkState
from wallride.sim.devices.scip_encode import UST_10LX


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"first_step": 190}, "sees from -88 to 135 degrees, and a car needs -90 to 90"),
        ({"last_step": 890}, "sees from -135 to 88 degrees"),
        ({"steps_per_turn": 348, "first_step": 10, "last_step": 250, "front_step": 130}, "has a beam every 1 degrees"),
        ({"steps_per_turn": 240, "first_step": 0, "last_step": 180, "front_step": 90}, "has a beam every 1.5 degrees"),
        ({"range_min_mm": 500}, "sees nothing nearer than 0.5 m, and a car needs 0.3 m or less"),
        ({"speed_rpm": 299}, "turns at 5 Hz, and a car needs 5 Hz or more"),
    ],
)
async def test_a_sensor_that_no_car_can_be_driven_by_is_refused_with_the_reason(
    tcp: MakeRig, changes: dict[str, Any], words: str
) -> None:
    rig = await tcp(sensor(replace(UST_10LX, **changes)))
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
        {"range_min_mm": 300},
        {"speed_rpm": 300},
    ],
)
async def test_a_sensor_that_is_just_good_enough_is_taken(tcp: MakeRig, changes: dict[str, Any]) -> None:
    rig = await tcp(sensor(replace(UST_10LX, **changes)))
    await rig.until(lambda: rig.link() is LinkState.READY, turning=True)


async def test_an_unstable_sensor_keeps_its_stream_and_says_so(tcp: MakeRig) -> None:
    rig = await tcp(sensor())
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
    rig = await tcp(sensor())
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
    emulator = sensor()
    emulator.sensor.fault = "50"
    emulator.sensor.cured_by = frozenset({"RB"})
    rig = await tcp(emulator)
    await rig.until(lambda: emulator.counts["reboot"] == 1)
    await rig.lost_and_found()
    assert rig.counts["reboot"] == 1


async def test_a_sensor_that_nothing_cures_is_rebooted_once_in_20_s_and_a_human_is_called(tcp: MakeRig) -> None:
    emulator = sensor()
    emulator.sensor.fault = "50"
    emulator.sensor.cured_by = frozenset()
    rig = await tcp(emulator)
    await rig.until(lambda: rig.counts.get("reconnect", 0) >= 3)
    assert emulator.counts["reboot"] == 1
    assert rig.link() in {LinkState.FAULTY, LinkState.STARTING}
    await rig.until(lambda: "did not help: power-cycle it" in rig.health.message)


async def test_what_a_sensor_says_against_itself_is_passed_on(tcp: MakeRig) -> None:
    emulator = sensor()
    emulator.sensor.state_text = "Trouble!! Error No. =[12]"
    rig = await tcp(emulator)
    await rig.ready()
    await rig.scan()
    assert "Trouble!! Error No. =[12]" in rig.health.message


@pytest.mark.parametrize("attribute", ["unanswered", "damaged", "refused"])
@pytest.mark.parametrize(("line", "words"), [("II", "state (II)"), ("VV", "version (VV)")])
async def test_a_sensor_that_does_not_tell_what_is_for_people_is_driven_by_and_said(
    tcp: MakeRig, attribute: str, line: str, words: str
) -> None:
    emulator = sensor()
    setattr(emulator.sensor, attribute, frozenset({line}))
    rig = await tcp(emulator)
    await rig.until(lambda: emulator.streaming)
    await rig.scan()
    assert rig.health.message == f"UST-10LX, 1081 beams, 40 Hz; it does not tell its {words}"
    assert "reconnect" not in rig.counts
