"""From the wire to text: right, short, and never more than one line of complaint."""

import json
import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from tests.runtime.ros.samples import SAMPLES
from wallride.clients.decoding import UnreadableError, as_json, as_text, decode
from wallride.runtime.ros import messages
from wallride.runtime.ros.definitions import TYPES
from wallride.runtime.wire import topics
from wallride.runtime.wire.teleop import Beat, CarCondition


@pytest.mark.parametrize("topic", TYPES)
def test_every_topic_can_be_read_and_told(topic):
    message = decode(topic, SAMPLES[topic])
    assert json.loads(as_json(message)).keys() == message.keys()
    assert all(line.strip() for line in as_text(message).splitlines())


def test_constants_of_a_type_are_not_told():
    assert "POWER_SUPPLY" not in as_text(decode(topics.BATTERY, SAMPLES[topics.BATTERY]))


def test_long_arrays_are_shortened_unless_asked_for():
    scan = decode(topics.SCAN, SAMPLES[topics.SCAN])
    assert "... 1081 values]" in as_text(scan)
    assert as_text(scan, whole=True).count(",") > 1000


def test_json_has_null_where_a_number_is_missing():
    message = decode(topics.MOTOR, SAMPLES[topics.MOTOR])
    assert math.isnan(message["velocity"][1])
    assert json.loads(as_json(message))["velocity"][1] is None


def test_a_float32_is_told_as_it_was_meant():
    assert decode(topics.OUTPUT, messages.ackermann(0, 0.1, -0.3))["drive"]["speed"] == 0.1
    assert decode(topics.STATUS, b'{"nested":{"a":[0.10000000149011612]}}') == {"nested": {"a": [0.1]}}


def test_a_heartbeat_is_read_too():
    beat = Beat(7, 8, CarCondition.PERMITTED, operator_name="anna")
    assert decode(topics.BEAT, beat.pack())["operator_name"] == "anna"


@given(st.sampled_from([*TYPES, topics.STATUS, topics.BEAT]), st.binary(max_size=80))
def test_nonsense_is_one_line(topic, payload):
    complaint = ""
    try:
        decode(topic, payload)
    except UnreadableError as error:
        complaint = str(error)
    assert "\n" not in complaint


@given(st.sampled_from(sorted(TYPES)), st.data())
def test_a_cut_message_is_refused(topic, data):
    payload = SAMPLES[topic]
    with pytest.raises(UnreadableError, match=topic):
        decode(topic, payload[: data.draw(st.integers(0, len(payload) - 1))])
