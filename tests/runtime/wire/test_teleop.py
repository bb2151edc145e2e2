"""The teleop protocol's bytes: golden ones, round trips, and everything that must be refused."""

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from wallride.runtime.wire.teleop import (
    BEAT_BYTES,
    COMMAND_BYTES,
    MAX_SPEED_MPS,
    MAX_STEERING_RAD,
    UNKNOWN_AGE_MS,
    Beat,
    CarCondition,
    Command,
    Input,
    Malformed,
    Press,
    fit_name,
    is_stop,
    read_beat,
    read_command,
)

COMMAND = Command(
    0x1122334455667788, 7, 0xCAFE, 0x0102, Press.MANUAL, Input.KEYBOARD, 250, 1.5, -0.25, "Zoë"
)  # fmt: skip
COMMAND_HEX = "57524331 8877665544332211 07000000 feca0000 02010000 01 01 fa00 0000c03f 000080be 5a6fc3ab" + " 00" * 20
BEAT = Beat(0xCAFE, 0x0102, CarCondition.PERMITTED | CarCondition.REARM, 0x1122334455667788, 7, 30, 2.0, "Zoë")
BEAT_HEX = "57524231 feca0000 02010000 12 8877665544332211 07000000 1e00 00000040 5a6fc3ab" + " 00" * 20

SPEEDS_MPS = st.floats(-50, 50, width=32)
U32 = st.integers(0, 2**32 - 1)
NAMES = st.text(st.characters(categories=["L", "N", "P", "S"]), max_size=6)


def test_golden_bytes():
    assert COMMAND.pack() == bytes.fromhex(COMMAND_HEX)
    assert read_command(bytes.fromhex(COMMAND_HEX)) == COMMAND
    assert BEAT.pack() == bytes.fromhex(BEAT_HEX)
    assert read_beat(bytes.fromhex(BEAT_HEX)) == BEAT
    assert (COMMAND_BYTES, BEAT_BYTES) == (60, 55)


@given(
    st.builds(
        Command,
        session=st.integers(1, 2**64 - 1),
        sequence=U32,
        car_session=U32,
        beat=U32,
        flags=st.integers(0, 127).map(Press),
        input=st.sampled_from(Input),
        input_age_ms=st.integers(0, UNKNOWN_AGE_MS),
        speed_mps=SPEEDS_MPS,
        steering_rad=st.floats(-1.5, 1.5, width=32),
        name=NAMES,
    )
)
def test_every_command_arrives_as_it_was_sent(command):
    assert read_command(command.pack()) == command


@given(
    st.builds(
        Beat,
        car_session=U32,
        beat=U32,
        flags=st.integers(0, 127).map(CarCondition),
        operator_session=st.integers(0, 2**64 - 1),
        acknowledged=U32,
        acknowledged_age_ms=st.integers(0, UNKNOWN_AGE_MS),
        speed_mps=SPEEDS_MPS,
        operator_name=NAMES,
    )
)
def test_every_beat_arrives_as_it_was_sent(beat):
    assert read_beat(beat.pack()) == beat


def test_an_unknown_speed_is_nan():
    assert math.isnan(read_beat(Beat(1, 1, CarCondition(0)).pack()).speed_mps)
    assert math.isnan(read_beat(Beat(1, 1, CarCondition(0), speed_mps=math.inf).pack()).speed_mps)


@pytest.mark.parametrize("value", [math.nan, math.inf, -math.inf])
def test_packing_never_fails_because_an_e_stop_must_get_out(value):
    command = read_command(
        Command(
            2**64 + 1, 2**32 + 1, -1, 2**40, Press.ESTOP, Input.PAD, 10**9, value, value,
            "\x00\x1b[31m\udc80" + "é" * 50,
        ).pack()
    )  # fmt: skip
    assert command.flags is Press.ESTOP
    assert (command.session, command.sequence, command.car_session, command.beat) == (1, 1, 2**32 - 1, 0)
    assert (command.speed_mps, command.steering_rad, command.input_age_ms) == (0.0, 0.0, UNKNOWN_AGE_MS)
    assert command.name == "[31m" + "é" * 10


def test_packing_limits_what_is_far_too_much():
    command = read_command(Command(1, 1, 1, 1, Press.MANUAL, Input.PAD, -5, 1e300, -9.0).pack())
    assert command.speed_mps == MAX_SPEED_MPS
    assert command.steering_rad == pytest.approx(-MAX_STEERING_RAD)
    assert command.input_age_ms == 0


def test_names_are_cut_between_characters():
    assert fit_name("x" * 23 + "ë") == b"x" * 23 + b"\0"
    assert len(fit_name("日本語" * 9)) == 24
    assert fit_name("日本語" * 9).decode() == "日本語日本語日本"


def with_bytes(payload, at, raw):
    return payload[:at] + raw + payload[at + len(raw) :]


SPOILT = {
    "another version": (0, b"WRC2"),
    "session 0": (4, bytes(8)),
    "an unknown flag": (24, b"\x81"),
    "an unknown input": (25, b"\x04"),
    "speed nan": (28, b"\x00\x00\xc0\x7f"),
    "speed inf": (28, b"\x00\x00\x80\x7f"),
    "speed -inf": (28, b"\x00\x00\x80\xff"),
    "speed 51": (28, b"\x00\x00\x4c\x42"),
    "steering nan": (32, b"\x00\x00\xc0\xff"),
    "steering 2": (32, b"\x00\x00\x00\x40"),
    "name not utf-8": (36, b"\xff\xfe"),
    "name cut inside a character": (36, b"x" * 23 + b"\xc3"),
    "name with a newline": (36, b"a\nb"),
    "name with an escape": (36, b"\x1b[2J"),
    "name with a hole": (36, b"a\0b"),
    "name that turns the writing direction": (36, "a\u202eb".encode()),
    "name that is no print": (36, b"\x7f"),
}
"""Where a command is spoilt, and the bytes there."""
BROKEN_COMMANDS = {
    "empty": b"",
    "one byte short": bytes.fromhex(COMMAND_HEX)[:-1],
    "one byte long": bytes.fromhex(COMMAND_HEX) + b"\0",
    "a beat, filled up": bytes.fromhex(BEAT_HEX).ljust(60, b"\0"),
    **{name: with_bytes(bytes.fromhex(COMMAND_HEX), *spoilt) for name, spoilt in SPOILT.items()},
}


@pytest.mark.parametrize("payload", BROKEN_COMMANDS.values(), ids=BROKEN_COMMANDS)
def test_broken_commands_are_refused_in_our_own_words(payload):
    with pytest.raises(Malformed) as refused:
        read_command(payload)
    assert str(refused.value).isprintable()
    assert len(str(refused.value)) < 80
    assert not refused.value.stop


@pytest.mark.parametrize(
    "payload",
    [
        b"", bytes.fromhex(BEAT_HEX)[:-1],
        *(with_bytes(bytes.fromhex(BEAT_HEX), at, raw)
          for at, raw in ((3, b"2"), (12, b"\x80"), (27, b"\x00\x00\x80\x7f"), (31, b"\xff"))),
    ],
)  # fmt: skip
def test_broken_beats_are_refused(payload):
    with pytest.raises(Malformed):
        read_beat(payload)


@pytest.mark.parametrize("flags", [4, 3, 7, 127, 255])
def test_a_broken_command_can_still_ask_to_stop(flags):
    payload = bytearray(BROKEN_COMMANDS["speed nan"])
    payload[24] = flags
    with pytest.raises(Malformed) as refused:
        read_command(bytes(payload))
    assert refused.value.stop


@pytest.mark.parametrize("flags", range(128))
def test_a_stop_is_the_button_or_both_deadmen(flags):
    assert is_stop(flags) == bool(flags & 4 or (flags & 1 and flags & 2))
