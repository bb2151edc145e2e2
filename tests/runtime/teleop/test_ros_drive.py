"""ROS 2's /drive as a planner: its clock, its publisher, and what is refused."""

import math

import pytest

from tests.runtime.teleop.planner_rig import GID, OTHER_GID, STEP_S, Rig, driven
from wallride.runtime.arbitration.command import Source
from wallride.runtime.ros import messages
from wallride.runtime.settings.tree import SettingsError, load_settings
from wallride.runtime.wire.rmw_zenoh import attachment


@pytest.fixture
def rig():
    return Rig()


class RosSender:
    """A ROS 2 program with another clock: 1000 s behind, and a link that takes way_s."""

    def __init__(self, rig, gid=GID):
        self.rig, self.gid, self.sequence, self.way_s, self.ahead_s = rig, gid, 0, 0.01, -1000.0
        self.header_s = lambda now_s: now_s - 500.0  # of a scan: a third clock

    def make(self, speed_mps=0.8):
        self.sequence += 1
        stamp_s = self.rig.now_s + self.ahead_s
        note = attachment(self.sequence, round(stamp_s * 1e9), self.gid)
        return messages.ackermann(round(self.header_s(self.rig.now_s) * 1e9), speed_mps, -0.1), note

    def send(self, **changes):
        payload, note = self.make(**changes)
        self.rig.planner_desk.receive_ros(payload, note, self.rig.now_s + self.way_s)

    def deliver(self, waited):
        """Let what waited in the link arrive now."""
        for payload, note in waited:
            self.rig.planner_desk.receive_ros(payload, note, self.rig.now_s)

    def drive(self, seconds):
        for _ in range(round(seconds / STEP_S)):
            self.rig.wait(STEP_S)
            self.send()


@pytest.fixture
def sender(rig):
    """One whose clock has been compared."""
    one = RosSender(rig)
    one.drive(0.6)
    return one


def test_ros_drive_counts_once_its_clock_was_compared(rig):
    sender = RosSender(rig)
    sender.drive(0.48)
    assert rig.decision.driver is Source.NAVIGATION
    assert set(rig.refused_of("ros2")) == {"clock not compared yet"}
    sender.drive(0.1)
    assert driven(rig) == (Source.PLANNER, pytest.approx(0.8), pytest.approx(-0.1))
    assert rig.decision.reason == "planner ros2 drives"
    rig.wait(0.3)
    assert rig.decision.speed_mps == 0.0
    assert rig.planner_desk.status()["lost"] == "ros2"


def test_ros_commands_that_waited_are_stale_however_fresh_they_arrive(rig, sender):
    waited = []
    for _ in range(40):  # the link stands still for 0.8 s, then delivers everything at once
        rig.wait(STEP_S)
        waited.append(sender.make(speed_mps=9.0))
    sender.deliver(waited[:28])
    assert rig.refused_of("ros2")["stale"] == 28
    assert rig.decision.speed_mps == 0.0


def test_a_planner_that_is_stuck_on_an_old_scan_is_stale_however_fresh_it_sends(rig, sender):
    stuck_s = sender.header_s(rig.now_s)
    sender.header_s = lambda _now_s: stuck_s
    sender.drive(0.16)
    assert rig.decision.speed_mps == pytest.approx(0.8), "a scan may be answered more than once"
    assert "stale" not in rig.refused_of("ros2")
    sender.drive(0.3)
    assert rig.decision.speed_mps == 0.0
    assert rig.refused_of("ros2")["stale"] >= 12
    assert rig.planner_desk.status()["lost"] == "ros2"


def test_a_command_for_an_old_scan_is_stale_and_the_next_one_for_a_new_scan_counts(rig, sender):
    on_time = sender.header_s
    sender.header_s = lambda now_s: on_time(now_s) - 5.0
    sender.drive(0.1)
    assert rig.refused_of("ros2")["stale"] == 5
    sender.header_s = on_time
    sender.drive(0.02)
    assert rig.decision.speed_mps == pytest.approx(0.8)


def test_a_scan_that_was_answered_late_holds_for_less(rig, sender):
    on_time = sender.header_s
    sender.header_s = lambda now_s: on_time(now_s) - 0.15
    sender.drive(0.02)
    rig.wait(0.04)
    assert rig.decision.speed_mps == pytest.approx(0.8)
    rig.wait(0.04)
    assert rig.decision.speed_mps == 0.0


def test_headers_without_a_stamp_are_not_judged(rig):
    sender = RosSender(rig)
    sender.header_s = lambda _now_s: 0.0
    sender.drive(2.0)
    assert rig.decision.speed_mps == pytest.approx(0.8)
    assert set(rig.refused_of("ros2")) == {"clock not compared yet"}


def test_after_a_long_silence_the_clock_is_compared_anew(rig, sender):
    waited = [sender.make(speed_mps=9.0) for _ in range(50)]
    rig.wait(3.0)
    sender.deliver(waited)
    assert rig.decision.speed_mps == 0.0


def test_a_ros_program_that_starts_again_with_another_clock_is_compared_anew(rig, sender):
    rig.wait(2.0)
    sender.sequence, sender.ahead_s = 0, -1090.0
    sender.drive(0.6)
    assert rig.decision.speed_mps == pytest.approx(0.8)


@pytest.mark.parametrize("back_s", [0.3, 10.0])
def test_a_clock_that_is_set_back_while_it_sends_is_a_new_one_after_a_second(rig, sender, back_s):
    sender.ahead_s -= back_s
    sender.drive(0.9)
    assert rig.decision.speed_mps == 0.0, "until then it may as well have waited"
    assert rig.planner_desk.status()["lost"] == "ros2"
    sender.drive(0.2)
    assert rig.decision.speed_mps == pytest.approx(0.8)
    waited = [sender.make(speed_mps=9.0) for _ in range(2)]
    rig.wait(0.3)
    sender.deliver(waited)
    assert rig.decision.speed_mps == 0.0, "by the new clock what waits is stale as before"


@pytest.mark.parametrize("pace", [0.0, 0.5])
def test_stamps_that_went_back_and_do_not_keep_step_are_no_new_clock(rig, sender, pace):
    since_s, old_s = rig.now_s, sender.header_s(rig.now_s) - 9.0
    sender.header_s = lambda now_s: old_s + pace * (now_s - since_s)
    sender.drive(4.0)
    assert rig.decision.speed_mps == 0.0


def test_a_link_that_becomes_slow_for_good_is_no_new_clock(rig, sender):
    waiting = []
    for _ in range(200):
        rig.wait(STEP_S)
        waiting.append(sender.make(speed_mps=9.0))
        if len(waiting) > 20:
            rig.planner_desk.receive_ros(*waiting.pop(0), rig.now_s)
    assert rig.decision.speed_mps == 0.0


def test_a_second_ros_publisher_and_a_replay_are_refused(rig, sender):
    RosSender(rig, OTHER_GID).send(speed_mps=9.0)
    payload, note = sender.make()
    for _ in range(2):
        rig.planner_desk.receive_ros(payload, note, rig.now_s + 0.011)
    refused = rig.refused_of("ros2")
    assert (refused["too many sessions"], refused["replay"]) == (1, 1)
    assert rig.decision.speed_mps == pytest.approx(0.8)


@pytest.mark.parametrize(
    "change",
    [
        lambda payload, note: (payload, None),
        lambda payload, note: (payload, note[:-1]),
        lambda payload, note: (payload[:-1], note),
        lambda payload, note: (payload + b"\0", note),
        lambda payload, note: (b"\x00\x00" + payload[2:], note),
        lambda payload, note: (payload[:12] + b"\xff\xff\xff\xff" + payload[16:], note),
        lambda payload, note: (messages.ackermann(1, math.nan, 0.0), note),
        lambda payload, note: (messages.ackermann(1, 1.0, math.inf), note),
        lambda payload, note: (messages.ackermann(1, 51.0, 0.0), note),
        lambda payload, note: (b"", note),
    ],
)
def test_ros_nonsense_is_counted_and_drives_nothing(rig, sender, change):
    before = rig.decision.speed_mps
    rig.planner_desk.receive_ros(*change(*sender.make(speed_mps=9.0)), rig.now_s)
    assert rig.refused_of("ros2")["malformed"] == 1
    assert rig.decision.speed_mps == before


def test_ros_drive_without_its_parts_is_a_mistake_in_the_settings():
    for missing in (["ros2.enabled=true"], ["planners.enabled=true"], []):
        with pytest.raises(SettingsError, match=r"ros2\.drive needs"):
            load_settings(None, ["ros2.drive=true", *missing])
    settings = load_settings(None, ["ros2.drive=true", "ros2.enabled=true", "planners.enabled=true"])
    assert settings.planner_names() == ("ros2",)
    assert load_settings(None, ['planners.names=["slam"]']).planner_names() == (), "off"
