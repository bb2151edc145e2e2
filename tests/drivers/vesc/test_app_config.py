"""The VESC's application configuration: fields only where the signature makes their places certain."""

import struct

import pytest

from drivers.vesc.app_config import LAYOUTS, AppConfig, decode_app_config
from sim.devices.vesc_replies import APP_SIGNATURES, AppValues, app_config_reply

FIRMWARE_6_05 = 2099347128
SERVO_AT, APPLICATION_AT = 31, 33


def reply(signature=FIRMWARE_6_05, timeout_ms=150, brake_a=10.0, size=278, **at):
    blob = bytearray(size)
    struct.pack_into(">IBIf", blob, 0, signature, 74, timeout_ms, brake_a)
    for place, value in at.items():
        blob[int(place[1:])] = value
    return b"\x11" + bytes(blob)


def test_the_fields_of_firmware_6_05():
    config = decode_app_config(reply(_31=1, _33=3))
    assert config == AppConfig(timeout_s=0.15, timeout_brake_a=10.0, application=3, servo_output=True)


def test_a_servo_output_that_is_off_is_told_from_one_that_cannot_be_set():
    assert decode_app_config(reply()).servo_output is False
    assert decode_app_config(reply(3264926020)).servo_output is None


@pytest.mark.parametrize("payload", [b"", b"\x11", reply(signature=1), reply()[:30], b"\x10" + reply()[1:]])
def test_what_is_not_known_is_not_read(payload):
    assert decode_app_config(payload) is None


@pytest.mark.parametrize("version", sorted(APP_SIGNATURES))
def test_the_emulated_controller_tells_what_is_read(version):
    values = AppValues(0.2, 7.5, application=4, servo_output=True)
    payload = app_config_reply(version, values)
    config = decode_app_config(payload)
    assert (config.timeout_s, config.timeout_brake_a, config.application) == (0.2, 7.5, 4)
    assert config.servo_output is (True if version >= (5, 3) else None)


def test_a_layout_has_its_fields_behind_the_head():
    assert all(layout.application > 12 and (layout.servo_output or 13) > 12 for layout in LAYOUTS.values())
