"""Frames and requests: golden bytes, any chunking, any noise."""

import math
import random

import pytest
from hypothesis import given
from hypothesis import strategies as st

from tests.drivers.golden import golden, pieces
from wallride.drivers.vesc import codec
from wallride.drivers.vesc.codec import Packet, VescDeframer, frame

GOLDEN = golden("vesc", frames=47, streams=10)
REQUESTS = {
    "get_fw_version": codec.plain(Packet.FW_VERSION),
    "get_values": codec.plain(Packet.GET_VALUES),
    "set_current_brake_10A": codec.set_brake_current(10.0),
    "set_rpm_+4614": codec.set_erpm(4614),
    "set_rpm_-2307": codec.set_erpm(-2307.0),
    "set_rpm_0": codec.set_erpm(0),
    "set_rpm_23250": codec.set_erpm(23250),
    "set_servo_0.5304": codec.set_servo(0.5304),
    "set_servo_0.15": codec.set_servo(0.15),
    "set_servo_0.85": codec.set_servo(0.85),
    "alive": codec.plain(Packet.ALIVE),
    "get_imu_all": codec.get_imu(),
    "get_imu_acc_gyro": codec.get_imu(504),
}


@pytest.mark.parametrize("vector", [v for v in GOLDEN["frames"] if v["name"] in REQUESTS], ids=lambda v: v["name"])
def test_every_request_that_a_car_sends_is_the_golden_bytes(vector):
    assert REQUESTS[vector["name"]].hex() == vector["payload_hex"]
    assert frame(REQUESTS[vector["name"]]).hex() == vector["hex"]


@pytest.mark.parametrize("vector", GOLDEN["frames"], ids=lambda v: v["name"])
def test_every_golden_frame_is_found_and_made(vector):
    deframer = VescDeframer()
    assert [payload.hex() for payload in deframer.feed(bytes.fromhex(vector["hex"]))] == [vector["payload_hex"]]
    assert deframer.skipped_bytes == 0
    assert frame(bytes.fromhex(vector["payload_hex"])).hex() == vector["hex"]


@pytest.mark.parametrize("vector", GOLDEN["streams"], ids=lambda v: v["name"])
def test_every_golden_stream_yields_what_it_should(vector):
    deframer = VescDeframer()
    chunks = vector.get("chunks") or [vector["hex"]]
    found = [payload for chunk in chunks for payload in deframer.feed(bytes.fromhex(chunk))]
    found += deframer.give_up()
    assert [payload.hex() for payload in found] == vector["expect"]
    length = sum(len(bytes.fromhex(chunk)) for chunk in chunks)
    assert deframer.skipped_bytes == length - sum(len(frame(payload)) for payload in found)


# Frames known by heart, so that this file means something without the shared reference.
@pytest.mark.parametrize(
    ("payload", "frame_hex"),
    [
        (codec.plain(Packet.GET_VALUES), "020104408403"),
        (codec.set_erpm(4614), "02050800001206 07fa03"),
        (codec.set_brake_current(10), "0205070000 2710ea9403"),
        (codec.set_servo(0.53), "02030c0212217003"),
    ],
)
def test_frames_known_by_heart(payload, frame_hex):
    assert frame(payload) == bytes.fromhex(frame_hex)


PAYLOADS = st.lists(
    st.one_of(
        st.binary(min_size=1, max_size=40),
        st.lists(st.sampled_from([2, 3]), min_size=1, max_size=40).map(bytes),
        st.integers(250, 512).map(lambda size: (bytes(range(256)) * 2)[:size]),
    ),
    max_size=8,
)


@given(payloads=PAYLOADS, cuts=st.lists(st.integers(0, 4000)))
def test_any_chunking_gives_the_same_payloads(payloads, cuts):
    stream = b"".join(map(frame, payloads))
    deframer = VescDeframer()
    assert [payload for piece in pieces(stream, *cuts) for payload in deframer.feed(piece)] == payloads
    assert (deframer.skipped_bytes, deframer.bad_checksums) == (0, 0)


@given(noise=st.binary(max_size=60), payloads=st.lists(st.binary(min_size=1, max_size=20), min_size=1, max_size=4))
def test_noise_before_frames_never_hides_them_for_good(noise, payloads):
    deframer = VescDeframer()
    found = deframer.feed(noise + b"".join(map(frame, payloads)))
    found += deframer.give_up()
    assert found[-len(payloads) :] == payloads


@pytest.mark.parametrize("false_start", ["03 02 01", "03 00 fe", "02 00", "04 00 00 05"])
def test_a_size_that_no_frame_has_is_not_waited_for(false_start):
    assert VescDeframer().feed(bytes.fromhex(false_start) + frame(b"\x04")) == [b"\x04"]


@given(payload=st.binary(min_size=1, max_size=80), data=st.data())
def test_a_flipped_bit_loses_that_frame_only(payload, data):
    good = frame(b"\x04good")
    bad = bytearray(frame(payload))
    bit = data.draw(st.integers(8 * 2, 8 * len(bad) - 1))
    bad[bit // 8] ^= 1 << bit % 8
    deframer = VescDeframer()
    found = deframer.feed(bytes(bad) + good) + deframer.give_up()
    assert payload not in found
    assert found[-1:] == [b"\x04good"]


def test_a_million_random_and_mutated_bytes_never_raise_and_are_all_accounted_for():
    rng = random.Random(1)
    deframer = VescDeframer()
    fed = found = 0
    frames = [frame(codec.set_erpm(4614)), frame(bytes(74)), frame(bytes(300))]
    while fed < 1_000_000:
        chunk = bytearray(rng.randbytes(rng.randrange(200)) + rng.choice(frames) + rng.choice(frames))
        for _ in range(rng.randrange(3)):
            chunk[rng.randrange(len(chunk))] = rng.choice((0, 2, 3, 255))
        fed += len(chunk)
        found += sum(len(frame(payload)) for payload in deframer.feed(bytes(chunk)))
    found += sum(len(frame(payload)) for payload in deframer.give_up())
    assert deframer.skipped_bytes + found == fed
    assert found > fed / 3  # most frames survive their neighbourhood


def test_a_checksum_error_is_counted():
    deframer = VescDeframer()
    assert deframer.feed(bytes.fromhex("0205080000120606fa03")) + deframer.give_up() == []
    assert (deframer.bad_checksums, deframer.skipped_bytes) == (1, 10)


@pytest.mark.parametrize("size", [0, 513])
def test_payloads_that_a_vesc_would_refuse_are_refused(size):
    with pytest.raises(ValueError, match="1 to 512"):
        frame(bytes(size))


@pytest.mark.parametrize("encode", [codec.set_brake_current, codec.set_erpm, codec.set_servo])
@pytest.mark.parametrize("value", [math.nan, math.inf, -math.inf, 1e12, -1e12])
def test_what_is_no_number_or_does_not_fit_is_a_value_error(encode, value):
    with pytest.raises(ValueError, match="cannot carry"):
        encode(value)


@pytest.mark.parametrize(("position", "raw"), [(0.57, 570), (0.29, 290), (0.1505, 150), (0.5306, 531)])
def test_scaling_rounds_and_does_not_truncate(position, raw):
    assert codec.set_servo(position) == bytes((12, raw >> 8, raw & 255))
