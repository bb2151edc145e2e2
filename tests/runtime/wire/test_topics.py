"""Messages in JSON."""

import math

import pytest

from wallride.runtime.wire import topics


def test_a_number_that_is_not_finite_becomes_null():
    assert topics.decode(topics.encode({"a": math.nan, "b": math.inf, "c": 1.5})) == {"a": None, "b": None, "c": 1.5}


@pytest.mark.parametrize(
    ("payload", "error"), [(b"[1]", TypeError), (b"{", ValueError), (b"\xff", ValueError), (b"[" * 60_000, ValueError)]
)
def test_what_is_no_object_is_an_error(payload, error):
    with pytest.raises(error):
        topics.decode(payload)


@pytest.mark.parametrize(
    ("name", "means"),
    [
        ("wallride/car1/alive", True),
        ("wallride/car1/**", False),
        ("wallride/car1/*", False),
        ("wallride/**", False),
        ("wallride/*/alive", False),
        ("wallride/Car1/alive", False),
        ("wallride/car1\x1b[2J/alive", False),
        ("wallride/car1/ali\u202eve", False),
        ("wallride/car1/more/alive", False),
        ("wallride", False),
    ],
)
def test_a_name_with_wildcards_or_of_no_car_means_no_topic(name, means):
    assert topics.fits(name, topics.key("*", topics.ALIVE)) is means
    assert topics.fits("wallride/car1/refused/*", topics.key("*", f"{topics.REFUSED}/**")) is False
