"""Curves in the terminal: which number is meant, what is drawn, and what is said when there is none."""

import math

import pytest

from tests.clients.speaking_car import options, speaking_car
from wallride.clients import plot
from wallride.clients.connection import ConnectionProblemError
from wallride.clients.plot import Curve, curve_of, drawing, number_at
from wallride.runtime.ros.messages import ackermann, float32
from wallride.runtime.wire import topics

STATUS = topics.encode({"scan_to_motor_ms": {"p99": 2.5}, "speed_mps": None, "state": "driving"})


@pytest.mark.parametrize(
    ("text", "car", "topic", "path"),
    [
        ("distance_error", None, "distance_error", "data"),
        ("motor", None, "motor", "velocity.0"),
        ("status:battery.voltage_v", None, "status", "battery.voltage_v"),
        ("wallride/car7/odom", "car7", "odom", "twist.twist.linear.x"),
    ],
)
def test_what_a_person_writes_names_a_number(text, car, topic, path):
    found_car, curve = curve_of(text, None)
    assert (found_car, curve.topic, curve.path) == (car, topic, path)


@pytest.mark.parametrize(("text", "words"), [("scan", "name a field"), ("sped", "is not a topic")])
def test_what_has_no_number_is_refused_with_the_remedy(text, words):
    with pytest.raises(ConnectionProblemError, match=words):
        curve_of(text, None)


def test_a_path_leads_through_names_and_places():
    message = {"a": {"b": [1, 2.5, True]}, "none": None}
    assert number_at(message, "a.b.1") == 2.5
    assert number_at(message, "a.b.2") == 1.0
    assert math.isnan(number_at(message, "none"))


@pytest.mark.parametrize(
    ("path", "words"),
    [
        ("a.c", "there is b"),
        ("a.b.3", "there is a number from 0"),
        ("a.b", "is no number"),
        ("z", "there is a, none"),
    ],
)
def test_a_path_that_leads_nowhere_says_what_is_there(path, words):
    with pytest.raises(LookupError) as refused:
        number_at({"a": {"b": [1, 2]}, "none": None}, path)
    assert words in refused.value.args[0]


def test_messages_become_points_and_trouble_is_shown():
    error, status, bad = (
        Curve("distance_error", "data"),
        Curve("status", "scan_to_motor_ms.p99"),
        Curve("status", "state"),
    )
    error.hear(float32(-0.25), 10.0)
    status.hear(STATUS, 10.0)
    bad.hear(STATUS, 10.0)
    error.hear(b"\x00", 11.0)
    bad.hear(b'{"state": 1%s}' % (b"0" * 400), 11.0)
    assert "too large" in bad.title(12.0)
    bad.hear(STATUS, 12.0)
    assert list(error.points) == [(10.0, -0.25)]
    assert "distance_error" in error.title(12.0)
    assert status.title(12.0) == "status:scan_to_motor_ms.p99  2.5"
    assert status.title(15.0) == "status:scan_to_motor_ms.p99  2.5  (silent for 5 s)"
    assert "is no number" in bad.title(12.0)


def test_curves_are_drawn_one_below_the_other():
    curves = [Curve("distance_error", "data"), Curve("output", "drive.speed")]
    for at in range(100):
        curves[0].hear(float32(math.sin(at / 10)), at / 10)
        curves[1].hear(ackermann(0, 1.5, 0.0), at / 10)
    text = drawing(curves, 10.0, 10.0, (80, 30))
    assert text.count("\n") >= 20
    assert text.index("distance_error:data") < text.index("output:drive.speed  1.5")
    assert sum("⠀" < character <= "⣿" for character in text) > 100
    blank = drawing([Curve("odom", "twist.twist.linear.x")], 10.0, 10.0, (80, 10))
    assert "nothing heard yet" in blank
    assert not any("⠀" < character <= "⣿" for character in blank)


def test_what_is_older_is_not_drawn():
    curve = Curve("distance_error", "data")
    curve.hear(float32(1.0), 0.0)
    assert not any("⠀" < character <= "⣿" for character in drawing([curve], 100.0, 20.0, (80, 10)))


async def test_it_draws_a_car_on_the_air():
    async with speaking_car() as car:
        parsed, said = options(car, "plot", "distance_error", "--seconds", "1", "--once")
        assert await plot.run(parsed) == 0
    assert "distance_error:data  0.125" in said[0]
    assert "\x1b" not in said[0], "standard output of a test is no terminal"
