"""What a page may say: closed and bounded."""

import contextlib
import json

import pytest
from hypothesis import given
from hypothesis import strategies as st

from wallride.clients.monitor.messages import LONGEST, Ask, BadMessageError, InputState, StopMessage, read
from wallride.clients.teleop.inputs import Control

HANDS = {"t": "hands", "car_session": 7, "beat": 9, "held": ["manual"], "speed": 1, "steering": -0.5}


def test_hands_are_read():
    hands = read(json.dumps(HANDS))
    assert isinstance(hands, InputState)
    assert hands.controls == {Control.MANUAL}
    assert (hands.beat, hands.speed, hands.steering, hands.share, hands.pad) == (9, 1.0, -0.5, 1.0, False)
    assert read('{"t":"stop"}') == StopMessage(t="stop")


@pytest.mark.parametrize(
    "change",
    [
        {"speed": 1.01}, {"speed": float("nan")}, {"steering": float("inf")}, {"beat": -1}, {"beat": 2**32},
        {"held": ["fly"]}, {"held": ["manual"] * 6}, {"share": 2}, {"more": 1}, {"t": "fly"}, {"age_ms": -1},
    ],
)  # fmt: skip
def test_impossible_hands_are_no_hands(change):
    with pytest.raises(BadMessageError):
        read(json.dumps(HANDS | change))


@pytest.mark.parametrize("what", ["operator/command", "param/../operator/command", "**", "alive"])
def test_only_known_questions_are_passed_on(what):
    assert isinstance(read(json.dumps({"t": "ask", "id": 1, "what": "param/get"})), Ask)
    with pytest.raises(BadMessageError):
        read(json.dumps({"t": "ask", "id": 1, "what": what}))


def test_what_is_too_long_is_not_looked_at():
    with pytest.raises(BadMessageError, match="too long"):
        read(json.dumps({"t": "ask", "id": 1, "what": "param/set", "question": {"a": "x" * LONGEST}}))


@given(st.text(max_size=300) | st.recursive(st.none() | st.floats() | st.text(), st.lists).map(json.dumps))
def test_nothing_else_is_raised_whatever_comes(text):
    with contextlib.suppress(BadMessageError):
        read(text)
