"""Replies: golden bytes of every firmware generation, truncation, noise."""

import math
from dataclasses import asdict
from typing import Any

import pytest

from tests.drivers.golden import Frame, golden
from wallride.drivers.vesc import replies
from wallride.drivers.vesc.faults import fault_text

GOLDEN = [frame for frame in golden("vesc")["frames"] if frame["direction"] == "rx"]
NAMES = {
    "temp_fet": "mosfet_temperature_c", "temp_motor": "motor_temperature_c", "current_motor": "motor_current_a",
    "current_in": "input_current_a", "id": "direct_current_a", "iq": "quadrature_current_a", "v_in": "voltage_v",
    "ah": "drawn_ah", "ah_charged": "charged_ah", "wh": "drawn_wh", "wh_charged": "charged_wh", "tacho": "tachometer",
    "tacho_abs": "tachometer_abs", "fault": "fault_code", "pid_pos": "position_deg",
    "temp_mos": "mosfet_temperatures_c", "vd": "direct_voltage_v", "vq": "quadrature_voltage_v",
    "temp_pcb": "board_temperature_c", "hw_name": "hardware", "hw_type": "hardware_kind",
    "custom_cfg_num": "custom_configs", "qmlui_hw": "qml_hardware", "qmlui_app": "qml_application",
    "fw_name": "name", "hw_crc": "hardware_crc",
}  # fmt: skip


def received(packet: int, count: int) -> list[Frame]:
    """The golden replies with this id, which are so many or more."""
    found = [frame for frame in GOLDEN if frame["id"] == packet]
    assert len(found) >= count or not GOLDEN
    return found


def expected(vector: Frame) -> dict[str, Any]:
    fields = {NAMES.get(name, name): value for name, value in vector["fields"].items() if name not in {"cmd", "mask"}}
    return {name: tuple(value) if isinstance(value, list) else value for name, value in fields.items()}


@pytest.mark.parametrize("vector", received(0, 4), ids=lambda v: v["name"])
def test_firmware(vector):
    firmware = replies.decode_firmware(bytes.fromhex(vector["payload_hex"]))
    assert firmware is not None
    told = expected(vector)
    names = ("major", "minor", "hardware", "hardware_kind")
    uuid = bytes.fromhex(told.get("uuid", ""))
    unsaid = {"hardware": "", "hardware_kind": None, "uuid": uuid}
    assert asdict(firmware) == unsaid | {name: told[name] for name in names if name in told}


@pytest.mark.parametrize("vector", received(4, 7), ids=lambda v: v["name"])
def test_values(vector):
    decode = replies.decode_values_2x if vector.get("firmware") == "2.18" else replies.decode_values
    values = decode(bytes.fromhex(vector["payload_hex"]))
    assert values is not None
    told = expected(vector)
    assert {name: asdict(values)[name] for name in told} == told


@pytest.mark.parametrize("vector", received(65, 2), ids=lambda v: v["name"])
def test_imu_in_si_units(vector):
    imu = replies.decode_imu(bytes.fromhex(vector["payload_hex"]))
    assert imu is not None
    told = vector["fields"]
    # Two golden numbers are one unit in the last place away from their own bytes.
    assert imu.acceleration_mps2 == pytest.approx(tuple(g * 9.80665 for g in told["acc"]), rel=1e-7)
    assert imu.rate_radps == tuple(math.radians(value) for value in told["gyro"])


# By heart: section 2 of the protocol notes has this reply of a 6.x firmware.
BY_HEART = bytes.fromhex(
    "04013b0118000004d200000141fffffff4000004ce00d7000012060076000004d20000000c000038e70000007b"
    "0001e2400001e45f00102ec2e04a013a013c013bffffff850000092900"
)


@pytest.mark.parametrize("size", range(len(BY_HEART) + 3))
def test_values_of_any_length_are_what_is_there_or_nothing(size):
    payload = (BY_HEART + b"new")[:size]
    values = replies.decode_values(payload)
    assert (values is None) == (size < 54)
    if values is not None:
        assert (values.erpm, values.voltage_v, values.tachometer, values.fault_code) == (4614, 11.8, 123456, 0)
        assert (values.controller_id == 74) == (size >= 59)
        assert (values.status == 0) == (size >= 74)


def test_the_hottest_mosfet_of_an_old_firmware_is_its_temperature():
    payload = bytes([4]) + b"".join(value.to_bytes(2, "big") for value in (315, 316, 314, 0, 0, 0, 300)) + bytes(41)
    values = replies.decode_values_2x(payload)
    assert values is not None
    assert (values.mosfet_temperature_c, values.board_temperature_c) == (31.6, 30.0)
    assert math.isnan(values.motor_temperature_c)
    assert replies.decode_values_2x(payload[:-1]) is None


def test_every_fault_has_words_and_none_has_none():
    assert fault_text(0) == ""
    texts = [fault_text(code) for code in range(1, 34)]
    assert len(set(texts)) == 33
    assert all(": " in text for text in texts)
    assert fault_text(2) == "under voltage: charge or change the battery"
    assert "fault 200" in fault_text(200)
