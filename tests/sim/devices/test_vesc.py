"""The emulated VESC: its answers are the golden bytes, its temper is the firmware's."""

import asyncio
import fcntl
import os
import struct
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from tests.drivers.golden import golden, needs_vectors
from tests.runtime.observed import HandClock
from tests.waiting import until
from wallride.drivers.vesc import codec, replies
from wallride.drivers.vesc.codec import Packet, VescDeframer, frame
from wallride.sim.devices.vesc import MotorDemand, VescEmulator
from wallride.sim.devices.vesc_logic import COAST, VescLogic
from wallride.sim.devices.vesc_replies import firmware_reply, imu_reply, selective_reply, values_reply

GOLDEN = {frame["name"]: bytes.fromhex(frame["payload_hex"]) for frame in golden("vesc")["frames"]}
TIOCGEXCL = 0x80045440


@needs_vectors
@pytest.mark.parametrize(
    ("version", "hardware", "name"),
    [
        ((6, 5), "60", "fw_version_6.05"),
        ((5, 2), "410", "fw_version_5.02_short"),
        ((3, 40), "60", "fw_version_3.40"),
        ((2, 18), "60", "fw_version_2.18_bare"),
    ],
)
def test_identities_are_the_golden_bytes(version, hardware, name):
    assert firmware_reply(version, hardware) == GOLDEN[name]


@needs_vectors
@pytest.mark.parametrize(
    ("version", "size_bytes", "name"),
    [
        ((2, 18), 56, "values_fw2.18"),
        ((3, 40), 59, "values_fw3.40"),
        ((5, 2), 73, "values_fw4.02_to_5.02"),
        ((6, 5), 74, "values_fw5.03plus"),
        ((6, 5), 74, "values_reverse_negative_fields"),
        ((6, 5), 74, "values_fault_undervoltage_and_timeout"),
    ],
)
def test_values_are_the_golden_bytes_of_each_firmware(version, size_bytes, name):
    decode: Callable[[bytes], Any] = replies.decode_values_2x if version < (3, 0) else replies.decode_values
    values = decode(GOLDEN[name])
    said = {field: getattr(values, field) for field in values.__slots__ if getattr(values, field) is not None}
    assert values_reply(version, said) == GOLDEN[name]
    assert len(GOLDEN[name]) == size_bytes


@needs_vectors
def test_selective_and_imu_replies_are_the_golden_bytes():
    said = {"erpm": 4614, "voltage_v": 11.8, "tachometer": 123456, "duty": 0.5}
    request = GOLDEN["get_values_selective_rpm_vin_tacho_fault_status"]
    assert selective_reply(request, said) == GOLDEN["values_selective_reply"]
    sent = GOLDEN["imu_acc_gyro"]
    imu = (0.0, 0.0, 0.0, *struct.unpack(">6f", sent[3:27]), *(0.0,) * 7)
    assert imu_reply((6, 5), GOLDEN["get_imu_acc_gyro"], imu, 74) == sent
    assert imu_reply((5, 2), GOLDEN["get_imu_acc_gyro"], imu, 74) == sent[:-1]


# What it does with commands, also those that only other programs send: no wire needed.


def foreign(packet: Packet, number: int) -> bytes:
    return struct.pack(">Bi", packet, number)


def logic(**changes: float) -> VescLogic:
    return VescLogic(0.0, **{"timeout_s": 1.0, "timeout_brake_a": 0.0, "min_erpm": 900.0, **changes})


@pytest.mark.parametrize(
    ("payload", "demand"),
    [
        (codec.set_erpm(4614), MotorDemand("speed", 4614)),
        (codec.set_erpm(-900), MotorDemand("speed", -900)),
        (codec.set_erpm(899), COAST),
        (codec.set_erpm(0), COAST),
        (codec.set_brake_current(10), MotorDemand("brake", 10)),
        (codec.set_brake_current(0.04), COAST),
        (foreign(Packet.SET_HANDBRAKE, 5000), MotorDemand("brake", 5)),
        (foreign(Packet.SET_CURRENT, -5000), MotorDemand("current", -5)),
        (foreign(Packet.SET_CURRENT, 0), COAST),
        (foreign(Packet.SET_CURRENT_REL, 50_000), MotorDemand("current", 30)),
        (foreign(Packet.SET_DUTY, 10_000), MotorDemand("duty", 0.1)),
        (foreign(Packet.SET_POS, 90_000_000), COAST),
    ],
)
def test_commands_become_demands(payload, demand):
    vesc = logic()
    assert vesc.command(payload, 0.1)
    assert vesc.demand(0.2) == demand


@pytest.mark.parametrize(("brake_a", "demand"), [(0.0, COAST), (8.0, MotorDemand("brake", 8.0))])
def test_after_the_timeout_it_brakes_or_coasts_and_the_next_command_ends_that(brake_a, demand):
    vesc = logic(timeout_brake_a=brake_a)
    vesc.command(codec.set_erpm(4614), 0.5)
    assert (vesc.timed_out(1.5), vesc.demand(1.5)) == (False, MotorDemand("speed", 4614))
    assert (vesc.timed_out(1.51), vesc.demand(1.51)) == (True, demand)
    vesc.command(codec.set_erpm(2000), 9.0)
    assert vesc.demand(9.0) == MotorDemand("speed", 2000)


@pytest.mark.parametrize(
    ("payload", "feeds"),
    [
        (codec.plain(Packet.GET_VALUES), False),
        (codec.set_servo(0.5), False),
        (codec.plain(Packet.FW_VERSION), False),
        (codec.plain(Packet.ALIVE), True),
        (codec.set_brake_current(5), True),
        (foreign(Packet.SET_CURRENT, 0), True),
    ],
)
def test_what_feeds_the_timeout(payload, feeds):
    vesc = logic()
    vesc.command(codec.set_erpm(4614), 0.0)
    vesc.command(payload, 0.9)
    assert vesc.timed_out(1.1) is not feeds


def test_a_timeout_of_zero_never_fires():
    assert not logic(timeout_s=0.0).timed_out(1e6)


def test_a_fault_ignores_commands_for_half_a_second_and_then_obeys_the_next_one():
    vesc = logic()
    vesc.command(codec.set_erpm(4614), 0.0)
    vesc.fault(2, 1.0)
    assert not vesc.command(codec.set_erpm(4614), 1.2)
    assert (vesc.fault_code(1.49), vesc.demand(1.49)) == (2, COAST)
    assert (vesc.fault_code(1.5), vesc.demand(1.5)) == (0, COAST)
    assert vesc.command(codec.set_erpm(4614), 1.6)
    assert vesc.demand(1.6) == MotorDemand("speed", 4614)


def test_the_kill_switch_releases_the_motor_while_it_is_on():
    vesc = logic()
    vesc.command(codec.set_erpm(4614), 0.0)
    vesc.killed = True
    assert vesc.demand(0.1) == COAST
    vesc.killed = False
    assert vesc.demand(0.1).kind == "speed"


# The wire.


class Host:
    """A program at the other end of the cable."""

    def __init__(self, path: Path) -> None:
        self.fd = os.open(path, os.O_RDWR | os.O_NOCTTY | os.O_NONBLOCK)
        self.chunks: list[bytes] = []
        self.payloads: list[bytes] = []
        self.deframer = VescDeframer()
        asyncio.get_running_loop().add_reader(self.fd, self._on_readable)

    def _on_readable(self) -> None:
        self.chunks.append(os.read(self.fd, 4096))
        self.payloads += self.deframer.feed(self.chunks[-1])

    def send(self, payload: bytes) -> None:
        os.write(self.fd, frame(payload))

    def close(self) -> None:
        asyncio.get_running_loop().remove_reader(self.fd)
        os.close(self.fd)


@pytest.fixture
def time() -> HandClock:
    return HandClock(0.0)


@pytest.fixture
async def vesc(tmp_path, time):
    vesc = VescEmulator(tmp_path / "vesc", clock=time)
    vesc.start()
    yield vesc
    vesc.close()


@pytest.fixture
async def host(vesc):
    host = Host(vesc.link)
    yield host
    host.close()


async def ask(host: Host, request: bytes) -> bytes:
    count = len(host.payloads)
    host.send(request)
    await until(lambda: len(host.payloads) > count)
    return host.payloads[-1]


async def test_the_tachometer_wraps_and_a_reboot_restarts_it(vesc, host):
    vesc.report(tachometer=2**31 + 5)
    values = replies.decode_values(await ask(host, codec.plain(Packet.GET_VALUES)))
    assert values is not None
    assert values.tachometer == -(2**31) + 5
    vesc.reboot()
    vesc.report(tachometer=2**31 + 8)
    values = replies.decode_values(await ask(host, codec.plain(Packet.GET_VALUES)))
    assert values is not None
    assert (values.tachometer, values.tachometer_abs) == (3, 3)


async def test_the_servo_keeps_its_position_through_everything_but_a_reboot(vesc, host, time):
    host.send(codec.set_servo(0.7))
    await until(lambda: vesc.servo == 0.7)
    time.now_s = 100.0
    vesc.inject_fault(2)
    vesc.replug()
    assert vesc.servo == 0.7
    vesc.reboot()
    assert vesc.servo == 0.5


async def test_obeyed_commands_are_told_and_all_payloads_remembered(tmp_path, time):
    told: list[tuple[float, MotorDemand]] = []
    vesc = VescEmulator(
        tmp_path / "vesc", clock=time, on_command=lambda now_s, demand: told.append((now_s, demand)), remember=3
    )
    vesc.start()
    host = Host(vesc.link)
    time.now_s = 3.0
    for payload in (codec.set_servo(0.1), codec.set_erpm(2000), codec.set_servo(0.2), codec.set_brake_current(7)):
        host.send(payload)
    await until(lambda: len(told) == 2)
    assert told == [(3.0, MotorDemand("speed", 2000)), (3.0, MotorDemand("brake", 7))]
    last = [codec.set_erpm(2000), codec.set_servo(0.2), codec.set_brake_current(7)]
    assert [payload for _, payload in vesc.wire] == last
    assert vesc.demand(3.1) == MotorDemand("brake", 7)
    host.close()
    vesc.close()


async def test_it_answers_host_after_host_and_drops_their_lock(vesc):
    for _ in range(3):
        host = Host(vesc.link)
        fcntl.ioctl(host.fd, 0x540C)  # TIOCEXCL, as the driver does
        await ask(host, codec.plain(Packet.FW_VERSION))
        assert struct.unpack("i", fcntl.ioctl(host.fd, TIOCGEXCL, bytes(4))) == (0,)
        host.close()


async def test_a_pulled_cable_fails_the_host_and_a_replug_has_the_same_name(vesc):
    host = os.open(vesc.link, os.O_RDWR | os.O_NOCTTY)
    vesc.unplug()
    vesc.unplug()
    assert not vesc.link.is_symlink()
    with pytest.raises(OSError, match="Input/output error"):
        os.write(host, frame(codec.plain(Packet.GET_VALUES)))
    vesc.replug()
    os.close(host)
    again = Host(vesc.link)
    assert (await ask(again, codec.plain(Packet.GET_VALUES)))[0] == Packet.GET_VALUES
    again.close()


async def test_a_deaf_controller_takes_what_was_sent_once_it_hears_again(vesc, host):
    vesc.deaf = True
    host.send(codec.plain(Packet.GET_VALUES))
    await asyncio.sleep(0.05)
    assert len(vesc.wire) == 0
    vesc.deaf = False
    await until(lambda: len(vesc.wire) == 1)


def test_closing_what_was_never_started_is_harmless(tmp_path):
    VescEmulator(tmp_path / "vesc").close()
