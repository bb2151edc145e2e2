"""Beats and serial numbers, around the wrap above all."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from wallride.runtime.teleop.sessions import REMEMBERED_BEATS, Beats, newer

U32 = st.integers(0, 2**32 - 1)


@given(U32, st.integers(1, 2**31 - 1))
def test_a_number_ahead_is_newer_whatever_the_wrap(number, ahead):
    later = (number + ahead) % 2**32
    assert newer(later, number)
    assert not newer(number, later)


@given(U32)
def test_a_number_is_not_newer_than_itself_nor_than_the_far_side(number):
    assert not newer(number, number)
    assert not newer((number + 2**31) % 2**32, number)


@pytest.mark.parametrize("first", [0, 41, 2**32 - 300, 2**32 - 1])
def test_every_remembered_beat_has_its_time_and_no_other(first):
    now = [0.0]
    beats = Beats(lambda: now[0], first)
    assert beats.sent_at_s(first) is None
    for i in range(REMEMBERED_BEATS + 100):
        now[0] = float(i)
        assert beats.count_sent() == (first + 1 + i) % 2**32
    last = REMEMBERED_BEATS + 99
    for i in range(last + 1):
        expected = float(i) if i > last - REMEMBERED_BEATS else None
        assert beats.sent_at_s((first + 1 + i) % 2**32) == expected
    assert beats.sent_at_s((beats.number + 1) % 2**32) is None
