"""What goes to ROS 2: announced once the session is open, only with a subscriber, each sample with its attachment."""

import pytest

from wallride.runtime.realtime.wall_clock import WallClock
from wallride.runtime.ros.definitions import TYPES
from wallride.runtime.ros.graph import PUBLISHED, SCAN_BY_BEAM, TF_ODOM, TF_STATIC, access
from wallride.runtime.ros.messages import Frame
from wallride.runtime.settings.telemetry import RatesHz
from wallride.runtime.telemetry.ros2_sink import Ros2Sink
from wallride.runtime.wire import topics
from wallride.runtime.wire.rmw_zenoh import Distro, RosGraph, gid, read_attachment
from wallride.sim.virtual.devices import MemoryBus

GRAPH = RosGraph(3, Distro.JAZZY, "wallride_car1")
LASER = Frame("base_link", "laser", 0.27, 0.0, 0.0)
START_NS = 1_790_000_000_000_000_000
WALL_CLOCK = WallClock(lambda: 5.0, lambda: START_NS + 5_000_000_000)


class RosBus(MemoryBus):
    """A session that is opened by hand. wishes: the keys with a subscriber."""

    session_id = "abc1"

    def __init__(self):
        super().__init__(lambda: 0.0)
        self.announced, self.sent, self.latched, self.wishes, self.declared = [], [], [], set(), []

    def put_attached(self, key, payload, *, encoding, attachment):
        self.sent.append((key, payload, encoding, attachment))

    def put_latched(self, key, payload, *, encoding, attachment):
        self.latched.append((key, payload, encoding, attachment))

    def wanted(self, key, *, encoding="", urgent=False):
        return key in self.wishes

    def announce(self, key):
        self.announced.append(key)

    def when_open(self, declare):
        self.declared.append(declare)

    def open(self):
        for declare in self.declared:
            declare()


def joined(**rates):
    bus = RosBus()
    sink = Ros2Sink(bus, GRAPH, RatesHz(**rates), LASER, wall_clock=WALL_CLOCK)
    bus.open()
    return bus, sink


def key_of(topic):
    return GRAPH.data_key(PUBLISHED[topic])


def test_the_node_and_all_publishers_are_announced_once_the_session_is_open():
    bus = RosBus()
    Ros2Sink(bus, GRAPH, RatesHz(), LASER, wall_clock=WALL_CLOCK)
    assert bus.announced == []
    bus.open()
    node, *endpoints = bus.announced
    assert node == "@ros2_lv/3/abc1/0/0/NN/%/%/wallride_car1"
    assert [token.split("/")[9] for token in endpoints] == [
        *(f"%{topic.name}" for topic in PUBLISHED.values()), "%tf_static",
    ]  # fmt: skip
    assert len({token.split("/")[4] for token in endpoints}) == len(endpoints), "each has a number of its own"


def test_what_has_no_subscriber_is_not_claimed_and_so_not_written():
    bus, sink = joined()
    assert not any(sink.claim(topic, 1.0) for topic in PUBLISHED.keys() - topics.LASTING)
    bus.wishes.add(key_of(SCAN_BY_BEAM))
    assert [topic for topic in PUBLISHED.keys() - topics.LASTING if sink.claim(topic, 2.0)] == [SCAN_BY_BEAM]


def test_native_topics_that_ros_2_does_not_have_are_never_claimed():
    bus, sink = joined()
    bus.wishes |= {key_of(topic) for topic in PUBLISHED}
    assert not any(sink.claim(topic, 1.0) for topic in (topics.STATUS, topics.DECISION, topics.BEAT, topics.TF))


def test_each_sample_has_its_number_its_stamp_and_its_publisher():
    bus, sink = joined()
    for stamp_s in (1.0, 1.5):
        sink.take(topics.ODOM, TYPES[topics.ODOM], stamp_s, b"odom")
    sink.take(TF_ODOM, "", 1.25, b"tf")
    notes = [(key, read_attachment(note)) for key, _, _, note in bus.sent]
    odom, tf = (gid(next(one for one in bus.announced if f"/%{name}/" in one)) for name in ("odom", "tf"))
    assert notes == [
        (key_of(topics.ODOM), (1, START_NS + 1_000_000_000, odom)),
        (key_of(topics.ODOM), (2, START_NS + 1_500_000_000, odom)),
        (key_of(TF_ODOM), (1, START_NS + 1_250_000_000, tf)),
    ]
    assert next((payload, encoding) for _, payload, encoding, _ in bus.sent) == (b"odom", "application/cdr")


def test_before_the_session_is_open_nothing_goes_out_without_its_attachment():
    bus = RosBus()
    sink = Ros2Sink(bus, GRAPH, RatesHz(), LASER, wall_clock=WALL_CLOCK)
    sink.take(topics.ODOM, TYPES[topics.ODOM], 1.0, b"odom")
    assert bus.sent == []


def test_the_fixed_frame_is_published_once_and_kept():
    bus, _ = joined()
    ((key, payload, encoding, note),) = bus.latched
    assert (key, encoding) == (GRAPH.data_key(TF_STATIC), "application/cdr")
    assert read_attachment(note)[:2] == (1, START_NS + 5_000_000_000)
    assert b"base_link\0" in payload
    assert b"laser\0" in payload


def test_a_map_is_published_once_and_kept_for_subscribers_that_come_later():
    bus, sink = joined()
    assert sink.claim(topics.MAP, 1.0), "there is no reader yet"
    sink.take(topics.MAP, TYPES[topics.MAP], 1.0, b"map")
    key, payload, _, note = bus.latched[-1]
    assert (key, payload) == (key_of(topics.MAP), b"map")
    assert read_attachment(note)[:2] == (1, START_NS + 1_000_000_000)
    bus.wishes.add(key)
    assert not any(sink.claim(topics.MAP, 1.0 + later_s) for later_s in range(100))
    assert PUBLISHED[topics.MAP].qos == TF_STATIC.qos
    assert GRAPH.data_key(PUBLISHED[topics.LINE]) in access(GRAPH).latched


def test_a_map_waits_for_the_session_and_is_turned_off_by_its_rate():
    assert not Ros2Sink(RosBus(), GRAPH, RatesHz(), LASER, wall_clock=WALL_CLOCK).claim(topics.MAP, 1.0)
    assert not joined(map=0.0)[1].claim(topics.MAP, 1.0)


@pytest.mark.parametrize(("rate_hz", "claimed"), [(20.0, 200), (5.0, 50), (0.0, 0)])
def test_the_rates_are_those_of_the_topics_and_tf_has_that_of_tf(rate_hz, claimed):
    bus, sink = joined(tf=rate_hz)
    bus.wishes.add(key_of(TF_ODOM))
    assert sum(sink.claim(TF_ODOM, 1.0 + i * 0.025) for i in range(400)) == pytest.approx(claimed, abs=1)
