import contextlib
import random
import re
import tracemalloc

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from tests.drivers.golden import Counts, Frame, golden, needs_vectors, pieces
from wallride.drivers.api import ProtocolError
from wallride.drivers.hokuyo.codec import (
    BLOCK_LIMIT_BYTES,
    ReplyBlock,
    ScipDeframer,
    checksum,
    command,
    stream_command,
)
from wallride.drivers.hokuyo.ranges import RangeDecoder
from wallride.drivers.hokuyo.replies import SensorParameters, StreamStatus, decode_number, fields, is_healthy, judge

GOLDEN = golden("scip", frames=57, streams=5)
SENT = [frame for frame in GOLDEN["frames"] if frame["direction"] == "tx"
        and frame["fields"]["cmd"] not in {"GD", "ME", "MS"} and not {"cluster": 0, **frame["fields"]}["cluster"]
        and "string" not in frame["fields"]]  # fmt: skip
"""What a car sends: of scans the plain stream of every step alone."""
RECEIVED = [frame for frame in GOLDEN["frames"] if frame["direction"] == "rx"]
STREAMS = {stream["name"]: bytes.fromhex(stream["hex"]) for stream in GOLDEN["streams"]}

SCAN = b"MD0540054200000\n99b\n01>8G\n0?X0W47D`M\n\n"


def read(stream: bytes, *edges: int, limit_bytes: int = BLOCK_LIMIT_BYTES) -> tuple[list[ReplyBlock], Counts]:
    """Feed a stream cut at `edges`; return the blocks and what was counted."""
    deframer = ScipDeframer((counts := Counts()).count, limit_bytes=limit_bytes)
    return [block for piece in pieces(stream, *edges) for block in deframer.feed(piece)], counts


def encode_command(expected: Frame) -> bytes:
    match expected["cmd"]:
        case "TM":
            return command(f"TM{expected['code']}")
        case "SS":
            return command(f"SS{expected['baud']:06d}")
        case "MD":
            return stream_command(expected["start"], expected["end"])
        case name:
            return command(name)


@needs_vectors
@pytest.mark.parametrize("frame", SENT, ids=lambda frame: frame["name"])
def test_every_golden_command_is_encoded_exactly(frame: Frame) -> None:
    assert encode_command(frame["fields"]).hex() == frame["hex"]


@needs_vectors
@pytest.mark.parametrize("frame", RECEIVED, ids=lambda frame: frame["name"])
def test_every_golden_reply_is_decoded_exactly(frame: Frame) -> None:
    [block], counts = read(bytes.fromhex(frame["hex"]))
    assert not counts
    expected = dict(frame["fields"])
    for note in ("valid_if_dmin_20_dmax_30000", "string", "note", "remaining"):
        expected.pop(note, None)
    if "raw" in expected:
        expected["ranges_mm"] = expected.pop("raw")
    said = describe(block)
    if "count" in expected:  # the vector file abbreviates the full scan
        ranges_mm = said.pop("ranges_mm")
        said |= {"count": len(ranges_mm), "first3": ranges_mm[:3], "last3": ranges_mm[-3:]}
    assert said == expected


def numbers(samples: bytes, chars: int = 3) -> list[int | None]:
    return [decode_number(samples[at : at + chars]) for at in range(0, len(samples), chars)]


def describe(block: ReplyBlock) -> Frame:
    """Return a block in the words of the vector file."""
    said: Frame = {"echo": block.echo.decode(), "status": block.status}
    if block.echo == b"TM1" and block.lines:
        said["timestamp_ms"] = decode_number(block.lines[0])
    elif block.echo == b"%ST":
        said["state"] = int(block.lines[0])
    elif block.echo in {b"PP", b"VV", b"II"}:
        said["params"] = fields(block)
    elif block.lines:
        stamp, samples = block.lines
        said["timestamp_ms"] = decode_number(stamp)
        match block.echo[:2]:
            case b"ND":  # the echoes of a step are joined by "&"
                steps = re.findall(rb"(?:...&)*...", samples)
                said["echoes_mm"] = [[decode_number(echo) for echo in step.split(b"&")] for step in steps]
            case b"ME":
                said["ranges_mm"], said["intensities"] = numbers(samples)[::2], numbers(samples)[1::2]
            case family:
                said["ranges_mm"] = numbers(samples, 2 if family == b"MS" else 3)
    return said


@needs_vectors
@pytest.mark.parametrize(
    ("name", "echoes", "counted"),
    [
        ("data_line_bad_sum", [], {"checksum": 1}),
        ("status_bad_sum", [], {"checksum": 1}),
        ("stale_scan_before_reply", [b"MD0540054200000", b"QT"], {}),
        ("two_scans", [b"MD0540054200000", b"MD0540054200000"], {}),
        ("crlf_command_accepted_by_sensor", [], {}),
    ],
)
def test_every_golden_stream(name: str, echoes: list[bytes], counted: dict[str, int]) -> None:
    blocks, counts = read(STREAMS[name])
    assert [block.echo for block in blocks] == echoes
    assert dict(counts) == counted


@needs_vectors
def test_after_a_bad_sum_the_next_block_is_in_step() -> None:
    blocks, counts = read(STREAMS["data_line_bad_sum"] + STREAMS["status_bad_sum"] + SCAN)
    assert [describe(block)["ranges_mm"] for block in blocks] == [[1000, 2500, 30000]]
    assert counts == {"checksum": 2}


@pytest.mark.parametrize(("text", "value"), [(b"CB", 1234), (b"1Dh", 5432), (b"m2@0", 16000000), (b"0&0", None)])
def test_the_vendors_examples_of_numbers(text: bytes, value: int | None) -> None:
    assert decode_number(text) == value


@pytest.mark.parametrize(
    ("line", "end"),
    [
        (b"DMIN:20", "4"),
        (b"DMAX:5600", "_"),
        (b"AMIN:44", "7"),
        (b"AMAX:725", "o"),
        (b"AFRT:384", "6"),
        (b"SCAN:600", "e"),
    ],
)
def test_the_vendors_printed_sums_leave_the_semicolon_out(line: bytes, end: str) -> None:
    assert chr(checksum(line)) == end


def test_firmware_that_sums_the_semicolon_is_understood_too() -> None:
    line = b"MODL:UST-10LX;"
    [block], _ = read(b"PP\n00P\n" + line + bytes([checksum(line)]) + b"\n\n")
    assert fields(block) == {"MODL": "UST-10LX"}


def test_a_semicolon_that_is_data_of_a_scan_is_summed() -> None:
    data = b"0?X0W;"
    good = b"MD0540054200000\n99b\n01>8G\n" + data + bytes([checksum(data)]) + b"\n\n"
    wrong = good[:-3] + bytes([checksum(data[:-1])]) + b"\n\n"
    assert [block.lines[1] for block in read(good)[0]] == [data]
    assert read(wrong) == ([], {"checksum": 1})


blocks_of_bytes = st.one_of(
    st.sampled_from([bytes.fromhex(frame["hex"]) for frame in RECEIVED] or [SCAN]),
    st.binary(max_size=60),
    st.sampled_from(
        [b"\n", b"\n\n", b"\n\n\n", b"0", SCAN[:-1], b"x" * 300, b"y" * 299 + b"\n\n", b"y" * 300 + b"\n\n"]
    ),
)


@given(
    parts=st.lists(blocks_of_bytes, max_size=12),
    cuts=st.lists(st.integers(0, 9000)),
    limit=st.sampled_from([300, 8192]),
)
def test_any_chunking_gives_the_same_blocks_and_counts(parts: list[bytes], cuts: list[int], limit: int) -> None:
    stream = b"".join(parts)
    assert read(stream, *cuts, limit_bytes=limit) == read(stream, limit_bytes=limit)


@given(parts=st.lists(blocks_of_bytes, max_size=6))
def test_byte_by_byte_gives_the_same_blocks_and_counts(parts: list[bytes]) -> None:
    stream = b"".join(parts)
    assert read(stream, *range(len(stream)), limit_bytes=300) == read(stream, limit_bytes=300)


def test_a_block_may_be_as_long_as_the_limit_and_no_longer() -> None:
    rows = [b"0" * 64 + b"0\n"] * 4
    raw = b"MD0000010000000\n99b\n01>8G\n" + b"".join(rows)[:-1]
    assert len(read(raw + b"\n\n", limit_bytes=len(raw))[0]) == 1
    assert read(raw + b"\n\n" + SCAN, limit_bytes=len(raw) - 1)[1] == {"oversized": 1}
    assert len(read(raw + b"\n\n" + SCAN, limit_bytes=len(raw) - 1)[0]) == 1


def test_bytes_without_a_blank_line_take_no_more_memory_than_the_limit() -> None:
    deframer = ScipDeframer((counts := Counts()).count)
    tracemalloc.start()
    before_bytes, _ = tracemalloc.get_traced_memory()
    for _ in range(1000):
        assert deframer.feed(b"z" * 1000) == []
    after_bytes, _ = tracemalloc.get_traced_memory()
    tracemalloc.stop()
    assert after_bytes - before_bytes <= BLOCK_LIMIT_BYTES + 10_000
    assert counts == {"oversized": 1}
    assert len(deframer.feed(b"\n\n" + SCAN)) == 1


@needs_vectors
def test_a_million_mutated_bytes_never_give_a_distance_that_the_sums_do_not_cover() -> None:
    generator = random.Random(3)
    clean = b"".join(bytes.fromhex(frame["hex"]) for frame in RECEIVED)
    deframer = ScipDeframer((counts := Counts()).count)
    fed, good = 0, 0
    while fed < 1_000_000:
        stream = bytearray(clean)
        for _ in range(8):
            stream[generator.randrange(len(stream))] = generator.randrange(256)
        if generator.random() < 0.3:
            del stream[generator.randrange(len(stream)) :]
        for block in deframer.feed(bytes(stream)):
            if len(block.lines) == 2:
                decoder = RangeDecoder(max(1, len(block.lines[1]) // 3), 20, 30000)
                ranges_m = decoder.decode(block.lines[1])
                if ranges_m is not None:
                    good += 1
                    assert np.all(np.isnan(ranges_m) | ((ranges_m >= np.float32(0.02)) & (ranges_m <= 30.0)))
            if block.echo == b"PP":
                with contextlib.suppress(ProtocolError):  # the only way in which it may refuse
                    SensorParameters.from_fields(fields(block))
        fed += len(stream)
    assert counts["checksum"] > 500
    assert good > 1000


def test_the_stream_that_drives_is_every_step_without_end() -> None:
    assert stream_command(0, 1080) == b"MD0000108000000\n"


PP = dict.fromkeys(("DMIN", "AMIN"), "0") | {
    "DMAX": "30000",
    "ARES": "1440",
    "AMAX": "1080",
    "AFRT": "540",
    "SCAN": "2400",
}


def test_parameters_give_the_geometry_of_a_ust() -> None:
    parameters = SensorParameters.from_fields(PP | {"MODL": "UST-10LX(Hokuyo)"})
    assert (parameters.model, parameters.beam_count, parameters.rate_hz) == ("UST-10LX", 1081, 40.0)
    assert np.rad2deg([parameters.angle_rad(0), parameters.angle_rad(1080)]) == pytest.approx([-135, 135])


@pytest.mark.parametrize(
    ("change", "complaint"),
    [
        ({"ARES": None}, "lacks ARES"),
        ({"ARES": "0"}, "ARES"),
        ({"AMAX": "99999999999999999999"}, "AMAX"),
        ({"AMAX": "1440"}, "field"),
        ({"AMIN": "1080"}, "field"),
        ({"DMIN": "30000"}, "DMIN"),
        ({"SCAN": "²"}, "SCAN"),
        ({"DMAX": "-5"}, "DMAX"),
    ],
)
def test_parameters_that_make_no_sense_are_named(change: dict[str, str | None], complaint: str) -> None:
    values = {key: text for key, text in (PP | change).items() if text is not None}
    with pytest.raises(ProtocolError, match=complaint):
        SensorParameters.from_fields(values)


@pytest.mark.parametrize(
    ("status", "meaning"),
    [
        ("00", StreamStatus.ACCEPTED),
        ("99", StreamStatus.SCAN),
        ("98", StreamStatus.RESUMED),
        ("0M", StreamStatus.UNSTABLE),
        ("21", StreamStatus.UNSTABLE),
        ("49", StreamStatus.UNSTABLE),
        ("50", StreamStatus.ABNORMAL),
        ("97", StreamStatus.ABNORMAL),
        ("0L", StreamStatus.ABNORMAL),
        ("20", StreamStatus.REFUSED),
        ("04", StreamStatus.REFUSED),
        ("0E", StreamStatus.REFUSED),
        ("10", StreamStatus.REFUSED),
        ("E", StreamStatus.REFUSED),
    ],
)
def test_status_codes(status: str, meaning: StreamStatus) -> None:
    assert judge(status) is meaning


@pytest.mark.parametrize(
    ("text", "healthy"),
    [
        ("Sensor works well.", True),
        ("Stable 000 no error.", True),
        ("sensor is working normally", True),
        ("Trouble!! Error No. =[12]", False),
    ],
)
def test_the_three_ways_to_say_fine(text: str, healthy: bool) -> None:
    assert is_healthy(text) is healthy


def test_a_block_is_a_value() -> None:
    assert read(SCAN)[0] == [ReplyBlock(b"MD0540054200000", "99", (b"01>8", b"0?X0W47D`"))]
