"""The VESC's application configuration: read only where the signature makes its places certain, and changes of it."""

import struct

import pytest

from wallride.drivers.vesc.app_config import (
    LAYOUTS,
    AppConfig,
    change_app_config,
    decode_app_config,
    layout_of,
    unlike_places,
)
from wallride.sim.devices.vesc_replies import APP_SIGNATURES, EmulatedAppConfig

FIRMWARE_6_05 = 2099347128
SERVO_AT, APPLICATION_AT = 31, 33


def reply(signature=FIRMWARE_6_05, timeout_ms=150, brake_a=10.0, size=278, **at):
    blob = bytearray(size)
    struct.pack_into(">IBIf", blob, 0, signature, 74, timeout_ms, brake_a)
    for place, value in at.items():
        blob[int(place[1:])] = value
    return bytes(blob)


def test_the_fields_of_firmware_6_05():
    config = decode_app_config(reply(_31=1, _33=3))
    assert config == AppConfig(timeout_s=0.15, timeout_brake_a=10.0, application=3, servo_output=True)


def test_a_servo_output_that_is_off_is_told_from_one_that_cannot_be_set():
    assert decode_app_config(reply()).servo_output is False
    assert decode_app_config(reply(3264926020)).servo_output is None


@pytest.mark.parametrize("payload", [b"", reply()[:4], reply(signature=1), reply()[:30]])
def test_what_is_not_known_is_not_read(payload):
    assert decode_app_config(payload) is None


@pytest.mark.parametrize("version", sorted(APP_SIGNATURES))
def test_the_emulated_controller_tells_what_is_read_and_takes_what_is_written(version):
    emulated = EmulatedAppConfig(0.2, 7.5)
    emulated.application = 4
    before = emulated.told(version)[1:]
    config = decode_app_config(before)
    assert (config.timeout_s, config.timeout_brake_a, config.application) == (0.2, 7.5, 4)
    servo = False if version >= (5, 3) else None
    assert config.servo_output is (True if version >= (5, 3) else None)
    new = change_app_config(before, timeout_s=0.15, timeout_brake_a=10.0, servo_output=servo)
    assert emulated.take(version, b"\x10" + new) == b"\x10"
    after = emulated.told(version)[1:]
    assert decode_app_config(after) == AppConfig(0.15, 10.0, 4, servo)
    assert unlike_places(new, after) == []


def test_a_change_touches_its_own_bytes_alone():
    before = bytes(range(256)) + bytes(22)
    before = FIRMWARE_6_05.to_bytes(4, "big") + before[4:]
    after = change_app_config(before, timeout_s=0.1, timeout_brake_a=8.0, servo_output=True)
    changed = {place for place in range(278) if before[place] != after[place]}
    assert changed == {*range(5, 13), SERVO_AT}
    assert after[5:13] == bytes.fromhex("00000064 41000000")
    assert change_app_config(before, timeout_s=0.1, timeout_brake_a=8.0, servo_output=None)[SERVO_AT] == SERVO_AT


@pytest.mark.parametrize("configuration", [reply(size=277), reply(size=279), reply(signature=1), b""])
def test_a_layout_that_is_not_known_to_the_last_byte_is_not_changed(configuration):
    assert layout_of(configuration) is None
    with pytest.raises(ValueError, match="cannot be changed"):
        change_app_config(configuration, timeout_s=0.1, timeout_brake_a=8.0, servo_output=None)


def test_a_servo_output_that_the_firmware_has_not_is_not_set():
    with pytest.raises(ValueError, match="cannot be changed"):
        change_app_config(reply(3264926020, size=418), timeout_s=0.1, timeout_brake_a=8.0, servo_output=True)


@pytest.mark.parametrize(
    ("written", "found", "forgiven"),
    [
        (570, 569, True),
        (-570, -569, True),
        (512, 511, True),  # both bytes differ
        (570, 571, False),
        (570, 568, False),
        (-570, -571, False),
        (0, -1, False),
    ],
)
def test_the_rounding_of_the_firmware_is_forgiven_where_it_rounds(written, found, forgiven):
    rounded_at = LAYOUTS[FIRMWARE_6_05].rounded[1]
    for at, is_there in ((rounded_at, True), (40, False)):
        one, other = bytearray(reply()), bytearray(reply())
        struct.pack_into(">h", one, at, written)
        struct.pack_into(">h", other, at, found)
        assert (unlike_places(bytes(one), bytes(other)) == []) is (forgiven and is_there)


def test_another_length_is_unlike():
    assert unlike_places(reply(), reply(size=277))


@pytest.mark.parametrize("layout", LAYOUTS.values(), ids=lambda layout: layout.firmware)
def test_a_layout_fits_into_a_request_and_its_places_into_it(layout):
    assert 1 + layout.size_bytes <= 512
    places = [*layout.rounded, *(at + 1 for at in layout.rounded)]
    assert len(set(places)) == 2 * len(layout.rounded), "no two overlap"
    assert max(places, default=0) < layout.size_bytes
    assert not {layout.application, layout.servo_output} & set(places)


def test_a_layout_has_its_fields_behind_the_head():
    assert all(layout.application > 12 and (layout.servo_output or 13) > 12 for layout in LAYOUTS.values())
