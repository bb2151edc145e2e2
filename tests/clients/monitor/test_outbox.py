"""Newest only, one bundle on its way: a late page neither delays nor drowns."""

import math
import struct

from hypothesis import given
from hypothesis import strategies as st

from wallride.clients.monitor.outbox import GIVE_UP_S, LAZY_S, TOPICS, Outbox, pack
from wallride.runtime.wire import topics


def unpack(bundle):
    """Return the number and what is in it: {topic: (payload, age_ms)}."""
    (number,) = struct.unpack_from("<I", bundle)
    at, found = 4, {}
    while at < len(bundle):
        topic, zero, age_ms, length = struct.unpack_from("<BBHI", bundle, at)
        assert zero == 0
        found[TOPICS[topic]] = (bundle[at + 8 : at + 8 + length], age_ms)
        at += 8 + length + -length % 4
    assert at == len(bundle)
    return number, found


def test_a_scan_goes_at_once_and_takes_the_others_along():
    outbox = Outbox()
    assert outbox.due_in_s(0.0) == math.inf
    outbox.put(topics.ODOM, b"odom!", 0.9)
    outbox.put(topics.SCAN, b"scan", 1.0)
    assert outbox.due_in_s(1.0) == 0
    number, found = unpack(outbox.take(1.1))
    assert number == 1
    assert found == {topics.ODOM: (b"odom!", 200), topics.SCAN: (b"scan", 100)}


def test_while_one_is_on_its_way_only_the_newest_waits():
    outbox = Outbox()
    outbox.put(topics.SCAN, b"1", 0.0)
    outbox.take(0.0)
    for i in range(2, 50):
        outbox.put(topics.SCAN, bytes([i]), i / 40)
        assert outbox.due_in_s(i / 40) > 0
    assert outbox.replaced == 47
    outbox.acknowledge(0)
    assert outbox.due_in_s(1.3) > 0, "that was not the bundle on its way"
    outbox.acknowledge(1)
    assert outbox.due_in_s(1.3) == 0
    assert unpack(outbox.take(1.3))[1][topics.SCAN][0] == bytes([49])


def test_what_does_not_hurry_waits_for_company():
    outbox = Outbox()
    outbox.put(topics.SCAN, b"1", 1.0)
    outbox.take(1.0)
    outbox.acknowledge(1)
    outbox.put(topics.ODOM, b"2", 1.01)
    assert math.isclose(outbox.due_in_s(1.01), LAZY_S - 0.01)
    assert outbox.due_in_s(1.0 + LAZY_S) == 0


def test_a_lost_acknowledgement_does_not_silence_the_page_for_ever():
    outbox = Outbox()
    outbox.put(topics.SCAN, b"1", 1.0)
    outbox.take(1.0)
    outbox.put(topics.SCAN, b"2", 1.1)
    assert outbox.due_in_s(1.0 + GIVE_UP_S) == 0


def test_another_car_takes_nothing_of_the_last_one_along():
    outbox = Outbox()
    outbox.put(topics.SCAN, b"1", 1.0)
    outbox.clear()
    assert outbox.due_in_s(2.0) == math.inf


@given(st.dictionaries(st.sampled_from(TOPICS), st.binary(max_size=50)), st.floats(0, 1e6))
def test_every_bundle_can_be_taken_apart(payloads, age_s):
    number, found = unpack(pack(7, {topic: (payload, 0.0) for topic, payload in payloads.items()}, age_s))
    assert number == 7
    assert {topic: payload for topic, (payload, _) in found.items()} == payloads
    assert all(age_ms == min(round(age_s * 1000), 65535) for _, age_ms in found.values())
