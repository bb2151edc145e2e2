"""The driver against the emulated controller, over a real pseudo-terminal in the same event loop."""

import asyncio
import math

import pytest
from hypothesis import HealthCheck, given
from hypothesis import settings as hypothesis_settings
from hypothesis import strategies as st

from tests import wire_time
from tests.drivers.vesc.rig import BRAKE, PATIENCE_S, controller, ready, running, seen, sent, vesc_at
from tests.waiting import until
from wallride.drivers.api import Drive, LinkState, Motor
from wallride.drivers.vesc import codec, driver
from wallride.drivers.vesc.codec import MOTOR_PACKETS, Packet
from wallride.drivers.vesc.driver import Vesc
from wallride.drivers.vesc.inertia import Inertia
from wallride.drivers.vesc.settings import VescSettings


async def test_whoever_wants_to_know_is_told_how_long_each_reply_took(emulator):
    took_s: list[float] = []
    settings = VescSettings(address=f"serial://{emulator.link}", lost_after_s=2.0)
    vesc = Vesc(settings, clock=asyncio.get_running_loop().time, replied=took_s.append)
    async with running(vesc):
        await until(lambda: len(took_s) >= 3)
        assert all(0.0 <= reply_s < PATIENCE_S for reply_s in took_s)
        assert seen(vesc).stamp_s > 0.0, "by then the state is the new one"


async def test_it_is_a_motor(emulator):
    vesc: Motor = vesc_at(emulator.link)
    assert (vesc.health.link, vesc.state) == (LinkState.ABSENT, None)
    assert vesc.send(Drive(1.0, 0.0)) is False
    vesc.clear_fault()
    assert vesc.health.link is LinkState.ABSENT, "this promises nothing"


@pytest.mark.parametrize(
    ("version", "identity"),
    [
        ((2, 18), "VESC, firmware 2.18"),
        ((3, 40), "VESC 60, firmware 3.40"),
        ((5, 2), "VESC 60, firmware 5.02"),
        ((6, 5), "VESC 60, firmware 6.05"),
        ((7, 0), "VESC 60, firmware 7.00"),
    ],
)
async def test_every_firmware_is_identified_and_understood(emulator, version, identity):
    emulator.firmware = version
    emulator.report(erpm=4614, tachometer=100, voltage_v=11.1, motor_current_a=3.5, input_current_a=1.25)
    async with ready(emulator) as vesc:
        assert vesc.health.identity == vesc.health.message == identity
        state = seen(vesc)
        assert (state.speed_mps, state.voltage_v, state.temperature_c) == (1.0, 11.1, 31.5)
        assert (state.motor_current_a, state.input_current_a) == (3.5, 1.25)
        assert (state.distance_m, state.fault, state.killed) == (0.0, "", False)


async def test_a_talker_that_is_no_vesc_is_refused_and_named_so(emulator, monkeypatch):
    monkeypatch.setattr(driver, "IDENTIFY_TIMEOUT_S", 0.4)
    emulator.garbage = True
    vesc = vesc_at(emulator.link)
    async with running(vesc):
        await until(lambda: "not like a VESC" in vesc.health.message)
        assert vesc.health.link is LinkState.ABSENT
    assert emulator.motor_wire() == []


async def test_a_silent_port_is_named_so_and_tried_again(emulator, monkeypatch):
    monkeypatch.setattr(driver, "IDENTIFY_TIMEOUT_S", 0.3)
    emulator.silent = True
    vesc = vesc_at(emulator.link)
    async with running(vesc):
        await until(lambda: "no answer to FW_VERSION" in vesc.health.message)
        emulator.silent = False
        await until(lambda: vesc.health.link is LinkState.READY)


async def test_a_battery_manager_on_the_port_is_refused(emulator):
    emulator.hardware_kind = 1
    vesc = vesc_at(emulator.link)
    async with running(vesc):
        await until(lambda: "is a battery manager" in vesc.health.message)
    assert emulator.motor_wire() == []


async def test_the_state_tells_the_steering_that_was_possible(emulator):
    async with ready(emulator) as vesc:
        vesc.send(Drive(0.0, 0.12))
        await until(lambda: seen(vesc).steering_rad == 0.12)
        vesc.send(Drive(0.0, 2.0))
        await until(lambda: seen(vesc).steering_rad == pytest.approx(0.3135, abs=1e-4))


async def test_the_kill_switch_shows(emulator):
    async with ready(emulator) as vesc:
        emulator.kill_switch = True
        await until(lambda: seen(vesc).killed)


async def test_an_empty_battery_is_told_but_does_not_stop_the_car(emulator, monkeypatch):
    monkeypatch.setattr("wallride.drivers.vesc.condition.LOW_VOLTAGE_S", 0.05)
    async with ready(emulator) as vesc:
        emulator.report(voltage_v=0.4)
        await until(lambda: vesc.health.link is LinkState.FAULTY)
        assert vesc.health.trouble == "no battery: 0.4 V (plug it in, release its switch)"
        assert vesc.health.message.endswith(vesc.health.trouble)
        assert (await sent(vesc, emulator, Drive(1.0, 0.0)))[0] == codec.set_erpm(4614)


SPEEDS = st.sampled_from([0.0, 0.1, -0.1, 0.5, -0.5, 2.0, -2.0, math.nan])


@hypothesis_settings(
    max_examples=15, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture, HealthCheck.too_slow]
)
@given(speeds=st.lists(SPEEDS, max_size=12), erpm=st.sampled_from([0, 9000, -9000]))
def test_the_driver_never_writes_a_motor_command_that_was_not_sent(tmp_path, speeds, erpm):
    async def story() -> list[bytes]:
        emulator = controller(tmp_path)
        emulator.start()
        emulator.report(erpm=erpm)
        async with ready(emulator) as vesc:
            assert all(vesc.send(Drive(speed_mps, 0.0)) for speed_mps in speeds)
            stamp_s = seen(vesc).stamp_s
            await until(lambda: seen(vesc).stamp_s > stamp_s + 0.05)  # polls, but no repetition
        await until(lambda: len(emulator.motor_wire()) > len(speeds))
        emulator.close()
        assert codec.plain(Packet.ALIVE) not in [payload for _, payload in emulator.wire]
        return emulator.motor_wire()

    wire = wire_time.run(story())
    assert wire[-1] == BRAKE
    assert len(wire) == len(speeds) + 1
    for payload, speed_mps in zip(wire, speeds, strict=False):
        assert payload[0] in MOTOR_PACKETS
        held = abs(speed_mps) >= 0.2 and speed_mps * erpm >= 0
        assert payload == (codec.set_erpm(round(4614 * speed_mps)) if held else BRAKE)


async def test_inertial_measurements_come_in_si_units_and_are_not_asked_for_by_nobody(emulator):
    emulator.imu = (0.0, 0.0, 0.0, 0.0, 0.5, 1.0, 0.0, 0.0, 90.0, *(0.0,) * 7)
    async with ready(emulator) as vesc:
        await asyncio.sleep(0.1)
        assert not [payload for _, payload in emulator.wire if payload[0] == Packet.GET_IMU_DATA]
        heard = []
        vesc.inertia.on_measurement = lambda *measurement: heard.append(measurement)
        await until(lambda: len(heard) > 2)
    stamp_s, rate_radps, acceleration_mps2 = heard[-1]
    assert heard[0][0] < stamp_s
    assert rate_radps == pytest.approx((0.0, 0.0, math.pi / 2))
    assert acceleration_mps2 == pytest.approx((0.0, 4.903325, 9.80665))


@pytest.mark.parametrize("wanted", [True, False])
def test_a_vesc_without_an_imu_is_not_asked_for_ever(wanted):
    inertia = Inertia(wanted=wanted)
    inertia.on_measurement = lambda *_: pytest.fail("there is none")
    assert bool(inertia.question()) == wanted
    zeros = bytes((Packet.GET_IMU_DATA, 0x01, 0xF8)) + bytes(24)
    assert not inertia.take(zeros[:-1], 5.0)
    assert inertia.take(zeros, 5.0)
    assert inertia.take(zeros, 5.99)
    assert bool(inertia.question()) == wanted
    assert inertia.take(zeros, 6.0)
    assert inertia.question() == b""
