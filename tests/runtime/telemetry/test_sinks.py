"""What goes to zenoh: only what somebody hears, and no more often than asked."""

import pytest

from wallride.runtime.ros.definitions import TYPES
from wallride.runtime.settings.telemetry import RatesHz
from wallride.runtime.telemetry.sinks import ZenohSink


class Ear:
    """Hears what is put, and wants the topics of this name; "" is every one."""

    def __init__(self, topic=""):
        self.heard, self.topic = [], topic
        self.deaf = False

    def put(self, key, payload, *, encoding):
        self.heard.append((key, payload, encoding))

    def wanted(self, key, *, encoding):
        return not self.deaf and key.endswith(self.topic)


def offered(rate_hz, every_s, seconds, jitter_s=0.0):
    """Return how many of the offered messages a topic's rate lets through."""
    ear = Ear()
    sink = ZenohSink(ear, "car1", RatesHz(scan=rate_hz))
    count = round(seconds / every_s)
    for i in range(count):
        if sink.claim("scan", 100 + i * every_s + (jitter_s if i % 2 else -jitter_s)):
            sink.take("scan", TYPES["scan"], 0.0, b"")
    return len(ear.heard)


@pytest.mark.parametrize("jitter_s", [0.0, 0.003])
@pytest.mark.parametrize("rate_hz", [5.0, 10.0, 15.0, 20.0])
def test_a_rate_is_kept_on_the_mean_although_scans_are_late_and_early(rate_hz, jitter_s):
    assert offered(rate_hz, 0.025, 10, jitter_s) == pytest.approx(rate_hz * 10, abs=1)


def test_everything_goes_when_the_rate_is_above_the_news_and_nothing_at_zero():
    assert offered(200.0, 0.025, 10) == 400
    assert offered(0.0, 0.025, 10) == 0


def test_after_a_silence_there_is_no_burst():
    sink = ZenohSink(Ear(), "car1", RatesHz(scan=10))
    assert sink.claim("scan", 100.0)
    assert sum(sink.claim("scan", 160 + i * 0.01) for i in range(20)) <= 4


def test_a_change_does_not_wait_for_its_turn_but_an_unheard_one_is_not_sent():
    ear = Ear()
    sink = ZenohSink(ear, "car1", RatesHz(decision=1.0))
    assert sink.claim("decision", 100.0)
    assert not sink.claim("decision", 100.0)
    assert sink.claim("decision", 100.0, urgent=True)
    ear.deaf = True
    assert not sink.claim("decision", 100.3, urgent=True)
    ear.deaf = False
    assert not sink.claim("decision", 100.3, urgent=True), "asked now and then"
    assert sink.claim("decision", 100.6, urgent=True)
    sink.limit(RatesHz(decision=0))
    assert not sink.claim("decision", 100.6, urgent=True)


def test_what_was_news_earlier_and_is_offered_together_is_told_apart_by_its_time():
    sink = ZenohSink(Ear(), "car1", RatesHz(output=200))
    assert all(sink.claim("output", 100 + i * 0.025) for i in range(4))
    assert not sink.claim("output", 100 + 3 * 0.025 + 0.001)


def test_a_sample_goes_under_the_cars_key_with_its_schema():
    ear = Ear()
    ZenohSink(ear, "car7", RatesHz()).take("odom", TYPES["odom"], 0.0, b"x")
    assert ear.heard == [("wallride/car7/odom", b"x", "application/cdr;nav_msgs/msg/Odometry")]
