"""Bytes of a lidar are taken apart alike."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from tests.runtime.kernel.sameness import PYTHON, assert_same
from wallride.drivers.hokuyo.codec import checksum


@given(data=st.binary(max_size=300), flipped=st.integers(0, 10**6))
def test_any_bytes_are_joined_alike(compiled, data, flipped):
    lines = [bytes(0x30 + byte % 64 for byte in data[i : i + 64]) for i in range(0, len(data), 64)]
    regular = b"\n".join(line + bytes([checksum(line)]) for line in lines)
    broken = bytearray(regular)
    if broken:
        broken[flipped % len(broken)] ^= 1 + flipped % 255
    for sent in (data, regular, bytes(broken)):
        assert compiled["join_rows"](sent) == PYTHON["join_rows"](sent)


@given(data=st.binary(max_size=300), flipped=st.integers(0, 10**6), head=st.sampled_from([0, 1, 2, 40, 41]))
def test_any_block_is_taken_apart_alike(compiled, data, flipped, head):
    lines = [bytes(0x30 + byte % 64 for byte in data[i : i + 64]) for i in range(0, len(data), 64)]
    summed = [line + bytes([checksum(line)]) for line in (b"99", b"0abc", *lines)]
    regular = b"\n".join([b"MD0000108000000".ljust(head, b"x")[:head], *summed])
    broken = bytearray(regular)
    if broken:
        broken[flipped % len(broken)] ^= 1 + flipped % 255
    for sent in (data, regular, bytes(broken), b"\n" + regular, regular[: flipped % 60]):
        assert compiled["split_scan"](sent) == PYTHON["split_scan"](sent)
    if lines and head in {1, 2, 40}:
        assert compiled["split_scan"](regular)[1:] == (b"99", b"0abc", b"".join(lines))


@given(samples=st.binary(max_size=60), beams=st.integers(0, 20), reverse=st.booleans())
def test_any_samples_are_decoded_alike(compiled, samples, beams, reverse):
    digits = bytes(0x30 + byte % 64 for byte in samples)
    for sent in (samples, digits, digits[: 3 * beams]):
        answers = [of["decode_samples"](sent, beams, 20, 30000, int(reverse)) for of in (PYTHON, compiled)]
        assert_same("decode_samples", *answers)
        assert answers[1] is None or not answers[1].flags.writeable


METRES = st.one_of(
    st.floats(-1.0, 40.0, width=32), st.sampled_from([0.0, -0.0, 0.0625, 0.125, 12.0, np.inf, -np.inf, np.nan])
)


@given(sent=st.lists(METRES, min_size=1, max_size=20), begin=st.integers(0, 9), reverse=st.booleans())
@pytest.mark.parametrize("near_m", [0.0, 0.0625, 0.125])
def test_any_ranges_of_a_message_are_read_alike(compiled, near_m, sent, begin, reverse):
    payload = bytes(begin) + np.array(sent, "<f4").tobytes()
    answers = [of["usable_ranges"](payload, begin, len(sent), near_m, 12.0, int(reverse)) for of in (PYTHON, compiled)]
    assert_same("usable_ranges", *answers)
    assert not answers[1].flags.writeable


@pytest.mark.parametrize(("begin", "beams"), [(0, 4), (1, 3), (13, 0), (-1, 2), (2**62, 1), (0, 2**62)])
def test_ranges_beyond_the_message_are_refused(compiled, begin, beams):
    with pytest.raises(ValueError, match="usable_ranges: no"):
        compiled["usable_ranges"](bytes(12), begin, beams, 0.1, 12.0, 0)
