"""Messages in JSON."""

import math

import pytest

from wallride.runtime.wire import topics


def test_a_number_that_is_not_finite_becomes_null():
    assert topics.decode(topics.encode({"a": math.nan, "b": math.inf, "c": 1.5})) == {"a": None, "b": None, "c": 1.5}


@pytest.mark.parametrize(
    ("payload", "error"),
    [(b"[1]", TypeError), (b"{", ValueError), (b"\xff", ValueError), (b"[" * 60_000, ValueError)],
)
def test_what_is_no_object_is_an_error(payload, error):
    with pytest.raises(error):
        topics.decode(payload)
