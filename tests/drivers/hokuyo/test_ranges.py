import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from wallride.drivers.hokuyo.codec import ScipDeframer, checksum
from wallride.drivers.hokuyo.ranges import RangeDecoder
from wallride.drivers.hokuyo.replies import decode_number
from wallride.sim.devices.scip_encode import encode_samples, encode_scan


@given(st.lists(st.integers(0, 262143), min_size=1, max_size=400), st.booleans())
def test_the_fast_path_agrees_with_plain_arithmetic(values: list[int], reverse: bool) -> None:
    decoder = RangeDecoder(len(values), 20, 30000, reverse=reverse)
    ranges_m = decoder.decode(encode_samples(np.array(values), 3))
    expected = [np.float32(mm) / np.float32(1000) if 20 <= mm <= 30000 else np.nan for mm in values]
    np.testing.assert_array_equal(ranges_m, np.array(expected[::-1] if reverse else expected, np.float32))


def test_every_scan_is_a_fresh_read_only_array() -> None:
    decoder = RangeDecoder(3, 20, 30000)
    first = decoder.decode(encode_samples(np.array([1000, 2000, 3000]), 3))
    second = decoder.decode(encode_samples(np.array([19, 30001, 65533]), 3))
    assert first is not None
    assert second is not None
    np.testing.assert_array_equal(first, np.array([1, 2, 3], np.float32))
    assert np.isnan(second).all()
    assert first.dtype == np.float32
    with pytest.raises(ValueError, match="read-only"):
        first[0] = 0


@pytest.mark.parametrize("samples", [b"", b"0?X0W", b"0?X0W47D`000", b"0?X0W47D&", b"0?X0W47D\xff", b"0?X0W47Dp"])
def test_anything_but_three_samples_of_three_digits_is_refused(samples: bytes) -> None:
    assert RangeDecoder(3, 20, 30000).decode(samples) is None


@given(st.integers(1, 300))
def test_every_length_of_scan_comes_through_frame_and_all(beam_count: int) -> None:
    values = np.arange(beam_count) * 97 % 30000
    samples = encode_samples(values, 3)
    [block] = ScipDeframer().feed(encode_scan(b"MD0000108000000", "99", 77, samples))
    assert (decode_number(block.lines[0]), block.lines[1]) == (77, samples)


@given(st.lists(st.integers(1, 64), min_size=1, max_size=8))
def test_lines_of_odd_length_are_joined_too(lengths: list[int]) -> None:
    text = b"0123456789:;<=>?" * 40
    lines, at = [], 0
    for length in lengths:
        lines.append(text[at : at + length])
        at += length
    body = b"\n".join(line + bytes([checksum(line)]) for line in lines)
    [block] = ScipDeframer().feed(b"MD0000000200000\n99b\n01>8G\n" + body + b"\n\n")
    assert block.lines[1] == text[:at]


@pytest.mark.parametrize("reverse", [False, True])
def test_for_ros_a_beam_that_nothing_came_back_from_is_not_one_with_a_fault(reverse: bool) -> None:
    """REP 117: maps are cleared by +inf, so that an error code must never be one."""
    inf, nan = np.inf, np.nan
    values = {0: nan, 1: nan, 19: nan, 20: -inf, 59: -inf, 60: 0.06, 30000: 30.0, 30001: inf, 65533: inf, 65534: nan,
              65535: nan, 262143: nan}  # fmt: skip
    decoder = RangeDecoder(len(values), 60, 30000, reverse=reverse)
    samples = encode_samples(np.array(list(values)), 3)
    expected = np.array(list(values.values()), np.float32)
    expected = expected[::-1] if reverse else expected
    np.testing.assert_array_equal(decoder.returns(samples).marked_m(), expected)
    decoded = decoder.decode(samples)
    assert decoded is not None
    np.testing.assert_array_equal(decoded, np.where(np.isfinite(expected), expected, np.float32(nan)))
