"""Scans of another program: what is delivered, and what stops the car with which reason. In virtual time."""

import asyncio
import contextlib
import math

import numpy as np
import pytest

from wallride.drivers.api import LinkState, Scan
from wallride.runtime.ros.messages import ros_laser_scan
from wallride.runtime.scan_topic import TopicLidar
from wallride.runtime.settings.devices import TopicLidarSettings
from wallride.runtime.wire.rmw_zenoh import attachment

STEP_S, EPOCH_NS = 0.025, 1_764_000_000 * 10**9
GID, OTHER_GID = b"a" * 16, b"b" * 16


class Rig:
    """A topic lidar, and a publisher whose scans take 5 ms; ahead_s: by how much its clock is ahead of the car's."""

    def __init__(self):
        self.now_s, self.ahead_s, self.sequence, self.got = 100.0, 0.0, 0, []
        self.lidar = TopicLidar(
            TopicLidarSettings(), clock=lambda: self.now_s, unix_ns=lambda: EPOCH_NS + round(self.now_s * 1e9)
        )
        self.running = self.lidar.run(self.got.append)
        self.running.send(None)

    def make(self, age_s=0.005, beams=1081, gid=GID, clock_s=None):
        self.sequence += 1
        at_ns = EPOCH_NS + round((self.now_s - age_s + (self.ahead_s if clock_s is None else clock_s)) * 1e9)
        ranges_m = np.linspace(1, 3, beams, dtype=np.float32)
        scan = Scan(0, 0, -math.radians(135), math.radians(270) / 1080, 0.02, 30.0, ranges_m, 0)
        return ros_laser_scan(at_ns, scan, STEP_S), attachment(self.sequence, at_ns, gid)

    def take(self, message):
        payload, note = message
        self.lidar.receive(payload, note, self.now_s)

    def drive(self, seconds=1.0):
        for _ in range(round(seconds / STEP_S)):
            self.now_s += STEP_S
            self.take(self.make())


@pytest.fixture
def rig():
    async def made():
        return Rig()

    loop = asyncio.new_event_loop()
    rig = loop.run_until_complete(made())
    yield rig
    with contextlib.suppress(RuntimeError):
        rig.running.close()
    loop.close()


def stops_with(rig, words):
    """Tell whether the car stops: the lidar is faulty with these words, and a good scan right after changes nothing."""
    health, before = rig.lidar.health, len(rig.got)
    assert words in health.trouble
    assert health.link is LinkState.FAULTY
    rig.drive(0.9)
    assert len(rig.got) == before
    assert rig.lidar.health.link is LinkState.FAULTY
    return True


def test_scans_are_delivered_once_the_clock_was_compared(rig):
    rig.drive(0.5)
    assert not rig.got
    assert rig.lidar.health.link == "absent"
    rig.drive(0.5)
    assert len(rig.got) == 20
    assert rig.got[-1].stamp_s == pytest.approx(rig.now_s - 0.005, abs=1e-6)
    assert rig.lidar.health.link is LinkState.READY


def test_two_publishers_are_a_stop(rig):
    rig.drive()
    rig.take(rig.make(gid=OTHER_GID))
    assert stops_with(rig, "two publishers")


def test_scans_out_of_order_are_a_stop(rig):
    rig.drive()
    early = rig.make()
    rig.now_s += STEP_S
    rig.take(rig.make())
    rig.take(early)
    assert stops_with(rig, "out of order")


@pytest.mark.parametrize("message", ["geometry", "damaged", "no attachment", "future"])
def test_a_message_that_cannot_be_trusted_is_a_stop(rig, message):
    rig.drive()
    rig.now_s += STEP_S
    payload, note = rig.make(
        beams=1001 if message == "geometry" else 1081, clock_s=0.05 if message == "future" else None
    )
    rig.take((payload[:-9] if message == "damaged" else payload, None if message == "no attachment" else note))
    words = {
        "geometry": "changed its field", "damaged": "do not fit", "no attachment": "attachment of 0 bytes",
        "future": "after it was received",
    }  # fmt: skip
    assert stops_with(rig, words[message])


def test_late_scans_are_dropped_and_then_told(rig):
    rig.drive()
    before = len(rig.got)
    for _ in range(24):
        rig.now_s += STEP_S
        rig.take(rig.make(age_s=0.25))
    assert len(rig.got) == before
    assert rig.lidar.health.trouble.endswith("s; the last came 0.25 s late")


@pytest.mark.parametrize(("ahead_s", "words"), [(-900.0, "900 s behind"), (900.0, "after it was received")])
def test_a_clock_that_is_off_never_drives(rig, ahead_s, words):
    rig.ahead_s = ahead_s
    rig.drive(3.0)
    assert not rig.got
    assert words in rig.lidar.health.trouble


def test_it_drives_again_after_a_clean_second(rig):
    rig.drive()
    rig.take(rig.make(gid=OTHER_GID))
    before = len(rig.got)
    rig.drive(1.1)
    assert len(rig.got) > before
    assert rig.lidar.health.link is LinkState.READY


def test_another_type_on_the_topic_is_a_stop(rig):
    rig.drive()
    rig.lidar.refuse_other_type("0/lidar/scan/a/b", "0/lidar/scan/a/b", b"", rig.now_s)
    assert not rig.lidar.health.trouble
    rig.lidar.refuse_other_type("0/lidar/scan/a/b", "0/lidar/scan/a/c", b"", rig.now_s)
    assert stops_with(rig, "another type")


def test_a_rehearsal_is_delivered_to_no_one_and_leaves_every_check_as_it_was(rig):
    rig.lidar.rehearse()  # before the first message
    for _ in range(80):
        rig.drive(STEP_S)
        before = len(rig.got), dict(rig.lidar.health.counts), rig.lidar.health.message
        rig.now_s += 0.02
        rig.lidar.rehearse()
        rig.now_s -= 0.02
        assert (len(rig.got), rig.lidar.health.counts, rig.lidar.health.message) == before
    assert [scan.sequence for scan in rig.got] == list(range(rig.got[0].sequence, rig.got[0].sequence + len(rig.got)))
    assert rig.lidar._understudy.health.link is LinkState.READY, "it goes the whole way"
    rig.take(rig.make(gid=OTHER_GID))
    rig.lidar.rehearse()
    assert stops_with(rig, "two publishers")


def test_a_rehearsed_scan_that_comes_again_is_still_out_of_order(rig):
    rig.drive()
    rig.now_s += STEP_S
    twice = rig.make()
    rig.take(twice)
    rig.lidar.rehearse()
    rig.take(twice)
    assert stops_with(rig, "out of order or twice")
