"""RPLIDAR bytes: golden frames, any chunking, any damage."""

import random

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from tests.drivers.golden import Counts, golden, needs_vectors, pieces
from wallride.drivers.rplidar import capsules, codec
from wallride.drivers.rplidar.capsule_formats import _scaled
from wallride.drivers.turning.replies import (
    ReplyDeframer,
    SensorCondition,
    SensorInfo,
    decode_condition,
    decode_info,
)
from wallride.drivers.turning.samples import HeadSamples, SampleDecoder, joined
from wallride.sim.devices.rplidar import A1, A1_OLDEST, S2, RplidarDevice, RplidarModel

GOLDEN = golden("rplidar")
FRAMES = {frame["name"]: frame for frame in GOLDEN["frames"]}
STREAMS = {stream["name"]: bytes.fromhex(stream["hex"]) for stream in GOLDEN["streams"]}


def bytes_of(name: str) -> bytes:
    return bytes.fromhex(FRAMES[name]["hex"] + FRAMES[name].get("next_hex", ""))


def decoder(kind: int) -> tuple[SampleDecoder, Counts]:
    counts = Counts()
    return capsules.decoder_for(kind, counts.count) or codec.PlainDecoder(counts.count), counts


def read(kind: int, stream: bytes, *edges: int) -> tuple[HeadSamples, Counts]:
    """Feed a stream cut at `edges`; return the samples and what was counted."""
    one, counts = decoder(kind)
    return joined([one.feed(piece) for piece in pieces(stream, *edges)]), counts


def reply_of(name: str) -> bytes:
    return ReplyDeframer().feed(bytes_of(name))[0].payload


SENT = {
    "cmd_stop": codec.command(codec.STOP),
    "cmd_reset": codec.command(codec.RESET),
    "cmd_scan": codec.command(codec.SCAN),
    "cmd_get_info": codec.command(codec.GET_INFO),
    "cmd_get_health": codec.command(codec.GET_HEALTH),
    "cmd_get_samplerate": codec.command(codec.GET_SAMPLE_TIME),
    "cmd_express_scan_legacy": codec.express_scan(0),
    "cmd_express_scan_mode4": codec.express_scan(4),
    "cmd_motor_pwm_660": codec.set_pwm(660),
    "cmd_motor_pwm_0": codec.set_pwm(0),
    "cmd_motor_rpm_600": codec.set_speed(600),
    "cmd_motor_rpm_0": codec.set_speed(0),
    "cmd_acc_board_flag": codec.command(codec.GET_MOTOR_BOARD, bytes(4)),
    "cmd_conf_typical": codec.ask_configuration(codec.TYPICAL_MODE),
    "cmd_conf_us_per_sample_mode4": codec.ask_configuration(codec.US_PER_SAMPLE, 4),
    "cmd_conf_max_distance_mode4": codec.ask_configuration(codec.MAX_DISTANCE, 4),
    "cmd_conf_ans_type_mode4": codec.ask_configuration(codec.ANSWER, 4),
    "cmd_conf_name_mode4": codec.ask_configuration(codec.MODE_NAME, 4),
}


@needs_vectors
@pytest.mark.parametrize("name", SENT)
def test_commands(name):
    assert SENT[name] == bytes_of(name)


@needs_vectors
@pytest.mark.parametrize("name", ["rep_info_a1m8", "rep_info_s2"])
def test_identity(name):
    fields, info = FRAMES[name]["fields"], decode_info(reply_of(name))
    assert info == SensorInfo(
        fields["model"], (fields["fw_major"], fields["fw_minor"]), fields["hw"], bytes.fromhex(fields["serial"])
    )


@needs_vectors
def test_condition_and_configuration():
    assert decode_condition(reply_of("rep_health_error_0x0004")) == SensorCondition(2, 4)
    assert codec.decode_sample_times_us(reply_of("rep_samplerate")) == (508, 254)
    assert codec.decode_configuration(reply_of("rep_conf_typical"), codec.TYPICAL_MODE) == b"\x03\x00"
    assert codec.decode_configuration(reply_of("rep_conf_typical"), codec.ANSWER) is None
    assert codec.decode_configuration(reply_of("rep_conf_name"), codec.MODE_NAME) == b"Sensitivity\0"


@needs_vectors
def test_every_stream_is_announced_with_its_type():
    for name, kind in (("normal", 0x81), ("express", 0x82), ("hq", 0x83), ("ultra", 0x84), ("dense", 0x85)):
        reply = ReplyDeframer().feed(bytes_of(f"desc_scan_{name}"))[0]
        assert (reply.streams, reply.kind) == (True, kind)


@needs_vectors
@pytest.mark.parametrize("name", [name for name in FRAMES if name.startswith("node_")])
def test_plain_samples(name):
    fields = FRAMES[name]["fields"]
    found, counts = read(codec.PLAIN, bytes_of(name))
    assert found.deg.tolist() == [fields["angle_deg"]]
    assert np.nan_to_num(found.range_m * 1000).tolist() == [fields["distance_mm"]]
    assert not counts


WITH_SAMPLES = [name for name, frame in FRAMES.items() if name.startswith("capsule") and "samples" in frame]


@needs_vectors
@pytest.mark.parametrize("name", WITH_SAMPLES)
@pytest.mark.parametrize("chunk", [1, 5, 84, 1000])
def test_capsules(name, chunk):
    frame, stream = FRAMES[name], bytes_of(name)
    found, counts = read(frame["fields"]["answer"], stream, *range(0, len(stream), chunk))
    deg = np.array([one["angle_deg"] for one in frame["samples"]])
    mm = [one["dist_mm"] for one in frame["samples"]]
    assert np.abs((found.deg - deg + 180) % 360 - 180).max() <= 1 / 64  # the vendor rounds to 1/64 degree
    np.testing.assert_allclose(np.nan_to_num(found.range_m) * 1000, mm, atol=1e-6)
    assert not counts


@needs_vectors
def test_a_packet_with_angles_of_its_own():
    found, counts = read(capsules.HQ, bytes_of("capsule_hq"))
    assert found.count == 96
    first = FRAMES["capsule_hq"]["fields"]["first_nodes"]
    assert (found.range_m[:3] * 4000).round(6).tolist() == [node["dist_q2"] for node in first]
    assert found.deg[:3].tolist() == [node["angle_z_q14"] * 90 / 16384 for node in first]
    assert not counts


@needs_vectors
def test_the_scale_of_an_ultra_capsule():
    table = GOLDEN["varbitscale"]
    mm, power = _scaled(np.array([row["scaled"] for row in table]))
    assert mm.tolist() == [row["decoded_mm"] for row in table]
    assert power.tolist() == [row["level"] for row in table]


@needs_vectors
def test_a_damaged_capsule_and_its_neighbours_give_nothing():
    good, bad = bytes_of("capsule_express"), STREAMS["express_bad_checksum"]
    found, counts = read(capsules.EXPRESS, good[:84] + bad + good)
    assert found.count == 32  # of the last pair only
    assert counts["checksum"] >= 1
    assert found.lost >= 64


@needs_vectors
def test_the_first_capsule_after_a_start_has_no_predecessor():
    begun = bytes_of("capsule_express_new_scan_flag")
    found, _ = read(capsules.EXPRESS, bytes_of("capsule_express")[:84] + begun)
    assert not found.count


def stream_of(model: RplidarModel, turns: int = 2) -> bytes:
    """Return the bytes of an emulated sensor, distances by direction."""
    device = RplidarDevice(model)
    device.feed(codec.command(codec.SCAN) if model is A1_OLDEST else codec.express_scan(model.mode))
    count = round(turns / model.turns_hz / model.sample_s)
    deg = np.asarray(np.arange(count) * 360.0 * model.turns_hz * model.sample_s % 360.0, np.float64)
    return b"".join(device.frames(deg, (1000 + 5 * deg).astype(np.int64)))


KINDS = [(A1_OLDEST, codec.PLAIN), (A1, capsules.EXPRESS), (S2, capsules.DENSE)]


@pytest.mark.parametrize(("model", "kind"), KINDS)
@given(st.lists(st.integers(1, 4000), max_size=6))
@settings(max_examples=25)
def test_any_chunking_gives_the_same(model, kind, edges):
    stream = stream_of(model)
    whole, parts = read(kind, stream)[0], read(kind, stream, *edges)[0]
    np.testing.assert_array_equal(whole.deg, parts.deg)
    np.testing.assert_array_equal(whole.range_m, parts.range_m)


@pytest.mark.parametrize(("model", "kind"), KINDS)
def test_a_lost_capsule_stretches_nothing(model, kind):
    stream, size = stream_of(model, 4), {codec.PLAIN: 5}.get(kind, 84)
    at = len(stream) // size // 2 * size
    found, counts = read(kind, stream[:at] + stream[at + size :])
    assert np.abs(found.range_m - (1.0 + found.deg * 0.005)).max() < 0.02
    assert counts["stretched"] == (kind != codec.PLAIN)


@pytest.mark.parametrize(("model", "kind"), KINDS)
def test_a_motor_that_changes_its_speed_is_followed(model, kind):
    one, _ = decoder(kind)
    device = RplidarDevice(model)
    device.feed(codec.command(codec.SCAN) if model is A1_OLDEST else codec.express_scan(model.mode))
    found = 0
    for share in (1.0, 2.0):
        deg = np.asarray(np.arange(6000) * 360.0 * model.turns_hz * model.sample_s * share % 360.0, np.float64)
        found += one.feed(b"".join(device.frames(deg, np.full(6000, 1500, np.int64)))).count
    assert found > 0.9 * 12000


MUTATED_BYTES = 40_000
"""For each kind of stream; a million and more in `make fuzz`."""


@pytest.mark.parametrize("kind", [codec.PLAIN, *capsules.FORMATS, capsules.HQ])
def test_mutated_bytes_raise_nothing_and_fill_no_memory(kind):
    rng = random.Random(kind)
    base = stream_of(A1, 3)[:9000] + bytes.fromhex("a5" + "00" * 780)
    one, _ = decoder(kind)
    for _ in range(MUTATED_BYTES // 2000):
        at = rng.randrange(len(base) - 2000)
        part = bytearray(base[at : at + 2000])
        for _ in range(rng.randrange(60)):
            part[rng.randrange(len(part))] = rng.randrange(256)
        found = one.feed(bytes(part))
        assert np.all((found.deg >= 0) & (found.deg < 360))
        assert not np.any(found.range_m <= 0)


@given(st.binary(max_size=600))
def test_any_bytes_raise_nothing(noise):
    for kind in (codec.PLAIN, *capsules.FORMATS, capsules.HQ):
        read(kind, noise, len(noise) // 2)
    for decode in (decode_info, decode_condition, codec.decode_sample_times_us):
        decode(noise)
