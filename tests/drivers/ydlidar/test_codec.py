"""YDLIDAR bytes: golden frames, any chunking, any damage."""

import random

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from tests.drivers.golden import Counts, golden, needs_vectors, pieces
from wallride.drivers.turning.replies import ReplyDeframer, decode_info
from wallride.drivers.turning.samples import HeadSamples, joined
from wallride.drivers.ydlidar import codec
from wallride.drivers.ydlidar.models import MODELS, Model
from wallride.sim.devices.ydlidar import X4, YdlidarDevice

GOLDEN = golden("ydlidar")
FRAMES = {frame["name"]: frame for frame in GOLDEN["frames"]}
STREAMS = {stream["name"]: bytes.fromhex(stream["hex"]) for stream in GOLDEN["streams"]}
PACKETS = [name for name, frame in FRAMES.items() if "samples" in frame["fields"]]
BRIGHT = Model("bright", 115200, 1e-4, (0.1, 10.0), triangulates=False, intensity=True)


def decoder(model: Model = MODELS["x4"]) -> tuple[codec.PacketDecoder, Counts]:
    return codec.PacketDecoder(model, (counts := Counts()).count), counts


def read(stream: bytes, *edges: int, model: Model = MODELS["x4"]) -> tuple[HeadSamples, Counts]:
    one, counts = decoder(model)
    return joined([one.feed(piece) for piece in pieces(stream, *edges)]), counts


@needs_vectors
@pytest.mark.parametrize("name", [name for name, frame in FRAMES.items() if frame["direction"] == "tx"])
def test_commands(name):
    assert codec.command(FRAMES[name]["fields"]["cmd"]) == bytes.fromhex(FRAMES[name]["hex"])


@needs_vectors
@pytest.mark.parametrize("name", ["rep_device_info", "rep_device_info_field_capture"])
def test_identity(name):
    fields = FRAMES[name]["fields"]
    info = decode_info(ReplyDeframer().feed(bytes.fromhex(FRAMES[name]["hex"]))[0].payload)
    assert info is not None
    assert (info.model, info.firmware, info.hardware) == (
        fields["model"], (fields["fw_major"], fields["fw_minor"]), fields["hw"],
    )  # fmt: skip
    assert "serial_digits" not in fields or info.serial == bytes(map(int, fields["serial_digits"]))


@needs_vectors
@pytest.mark.parametrize("name", PACKETS)
@pytest.mark.parametrize("chunk", [1, 7, 1000])
def test_packets(name, chunk):
    fields, raw = FRAMES[name]["fields"], bytes.fromhex(FRAMES[name]["hex"])
    one, counts = decoder()
    found = [packet for at in range(0, len(raw), chunk) for packet in one.packets_in(raw[at : at + chunk])]
    assert len(found) == 1
    packet, samples = found[0], found[0].samples
    assert packet.starts == bool(fields["zero"])
    assert packet.turns_hz == fields["freq_field"] / 10
    deg = np.array([one["angle_deg"] for one in fields["samples"]])
    assert np.abs((samples.deg - deg + 180) % 360 - 180).max() < 1e-6
    mm = [one["dist_mm"] for one in fields["samples"]]
    np.testing.assert_allclose(np.nan_to_num(samples.range_m) * 1000, mm, atol=1e-6)
    assert not counts


@needs_vectors
@pytest.mark.parametrize(
    ("name", "packets"),
    [
        ("bad_checksum_then_good", [(False, 8)]),
        ("noise_then_packet", [(False, 8)]),
        ("scan_header_then_two_packets", [(True, 1), (False, 8)]),
        ("timestamp_packet_skipped", [(False, 8)]),
        ("check_bit_missing", []),
        ("masked_ct_checksum_is_wrong", [(True, 1)]),
    ],
)
def test_streams(name, packets):
    found = decoder()[0].packets_in(STREAMS[name])
    assert [(packet.starts, packet.samples.count) for packet in found] == packets


def stream_of(turns: int = 2) -> bytes:
    device = YdlidarDevice(X4)
    device.feed(codec.command(codec.SCAN))
    count = round(turns / X4.turns_hz / X4.sample_s)
    deg = np.asarray(np.arange(count) * 360.0 * X4.turns_hz * X4.sample_s % 360.0, np.float64)
    return b"".join(device.frames(deg, (1000 + 5 * deg).astype(np.int64)))


@given(st.lists(st.integers(1, 3000), max_size=6))
@settings(max_examples=40)
def test_any_chunking_gives_the_same(edges):
    stream = stream_of()
    whole, parts = read(stream)[0], read(stream, *edges)[0]
    np.testing.assert_array_equal(whole.deg, parts.deg)
    np.testing.assert_array_equal(whole.range_m, parts.range_m)


def test_the_sample_of_a_start_packet_is_none():
    found, _ = read(stream_of(3))
    assert not np.isnan(found.range_m).any()


def test_intensities_are_left_out_and_part_of_the_sum():
    words = [0x55AA, 2 << 8, 90 * 128 | 1, 91 * 128 | 1]
    samples = [(200, 4000), (7, 4004)]
    total = 0
    for word in (*words, *(word for pair in samples for word in pair)):
        total ^= word
    raw = b"".join(word.to_bytes(2, "little") for word in (*words, total))
    raw += b"".join(bytes([bright]) + word.to_bytes(2, "little") for bright, word in samples)
    found, counts = read(raw, model=BRIGHT)
    assert found.range_m.tolist() == [1.0, 1.001]
    assert found.deg.tolist() == [90.0, 91.0]
    assert not counts


def test_bytes_lost_with_a_packet_are_counted_as_samples():
    stream = stream_of(2)
    found, counts = read(stream[:700] + stream[730:])
    assert counts["checksum"] >= 1
    assert 40 <= found.lost <= 80  # the 30 bytes were in two packets of 40


@pytest.mark.parametrize("model", [MODELS["x4"], MODELS["g6"], BRIGHT])
def test_mutated_bytes_raise_nothing(model):
    rng, base = random.Random(3), stream_of(4)
    one, _ = decoder(model)
    for _ in range(60):
        at = rng.randrange(len(base) - 1000)
        part = bytearray(base[at : at + 1000])
        for _ in range(rng.randrange(40)):
            part[rng.randrange(len(part))] = rng.randrange(256)
        found = one.feed(bytes(part))
        assert np.all((found.deg >= 0) & (found.deg < 360))
