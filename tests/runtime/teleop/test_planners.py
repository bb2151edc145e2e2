"""The planners' desk, under the real arbitration and operator's desk, in virtual time: every rule, broken once each."""

import math

import pytest

from drivers.api import Drive
from runtime.arbitration.command import DriveCommand, Source, arbitrate, consent, refusal
from runtime.arbitration.command_queue import CommandQueue
from runtime.arbitration.emergency_stop import EmergencyStop
from runtime.arbitration.permit import Permit
from runtime.ros import messages
from runtime.settings.operator import OperatorSettings
from runtime.settings.tree import Settings, load_settings
from runtime.teleop.desk import OperatorDesk
from runtime.teleop.planners import PlannerDesk
from runtime.wire import topics
from runtime.wire.rmw_zenoh import attachment
from runtime.wire.teleop import Command, Input, Press, read_beat
from tests.runtime.operator_rig import REQUIRED, Client

CAR_SESSION = 0xCAFE
STEP_S = 0.02
EXPIRY_S = 0.2
DRIVES = Press.MANUAL
ORDER = load_settings(None, ["planners.enabled=true"]).effective_order()
GID, OTHER_GID = bytes(16), bytes(range(16))


class Planner:
    """A planner outside: numbers its commands and echoes what it heard."""

    def __init__(self, rig, name, session=1):
        self.rig, self.name, self.session, self.sequence = rig, name, session, 0
        self.echo = 0
        rig.planners.append(self)

    def make(self, flags=DRIVES, **changes):
        self.sequence += 1
        fields = {
            "session": self.session, "sequence": self.sequence, "car_session": CAR_SESSION, "beat": self.echo,
            "flags": flags, "input": Input.SCRIPT, "speed_mps": 1.5, "steering_rad": 0.2,
        }  # fmt: skip
        return Command(**{**fields, **changes}).pack()

    def send(self, flags=DRIVES, **changes):
        payload = self.make(flags, **changes)
        self.rig.send(self.name, payload)
        return payload


class Rig:
    """Both desks at a real queue; safety consents, and the follower always wants 1 m/s."""

    def __init__(self, permit="always", names=("slam", "nn", "ros2")):
        self.now_s = 100.0
        clock = lambda: self.now_s  # noqa: E731 - the clock is this rig's hand
        self.queue = CommandQueue(ORDER, clock)
        self.permit = Permit(self.queue, permit)
        self.desk = OperatorDesk(
            OperatorSettings(permit=permit), self.queue, self.permit, EmergencyStop(self.queue), lambda: None, clock,
            CAR_SESSION,
        )  # fmt: skip
        self.planner_desk = PlannerDesk(
            names, EXPIRY_S, self.queue, self.permit, self.desk.beats, self.desk.rearm, clock, CAR_SESSION
        )
        self.planners, self.clients = [], []
        self.queue.put(consent(Source.SAFETY, "clear"))
        self.queue.put(DriveCommand(Source.NAVIGATION, Drive(1.0, 0.0), None, "follows the wall"))
        self.beat()

    def beat(self):
        self.desk.tick()
        self.planner_desk.tick()
        self.heard = read_beat(self.desk.beat(math.nan).pack())
        for client in self.clients:
            client.hear(self.heard)
        for planner in self.planners:
            planner.echo = self.heard.beat

    def wait(self, seconds):
        for _ in range(round(seconds / STEP_S)):
            self.now_s += STEP_S
            self.beat()

    def drive(self, planner, seconds=0.1, **changes):
        for _ in range(round(seconds / STEP_S)):
            self.wait(STEP_S)
            planner.send(**changes)

    def send(self, name, payload):
        self.planner_desk.receive(topics.planner_key("car1", name), payload, self.now_s)

    def operator(self):
        client = Client(self, "ann", 50)
        self.clients.append(client)
        client.hear(self.heard)
        return client

    @property
    def decision(self):
        return arbitrate(self.queue.live(), REQUIRED, self.queue.order)

    def refused(self, name):
        return self.planner_desk.status()["planners"][name]["refused"]


@pytest.fixture
def rig():
    return Rig()


@pytest.fixture
def slam(rig):
    planner = Planner(rig, "slam")
    rig.beat()
    return planner


def driven(rig):
    return rig.decision.driver, rig.decision.speed_mps, rig.decision.steering_rad


PLANNED = (Source.PLANNER, pytest.approx(1.5), pytest.approx(0.2))


def test_a_planner_drives_in_the_followers_place(rig, slam):
    assert rig.decision.driver is Source.NAVIGATION
    rig.drive(slam)
    assert driven(rig) == PLANNED
    assert rig.decision.reason == "planner slam drives"
    assert rig.planner_desk.status()["driving"] == "slam"


def test_safety_and_permit_bind_it_and_teleop_and_e_stop_go_first(rig, slam):
    rig.drive(slam)
    rig.queue.put(refusal(Source.SAFETY, "wall ahead"))
    assert (rig.decision.speed_mps, rig.decision.winner) == (0.0, Source.SAFETY)
    rig.queue.withdraw(Source.SAFETY)
    assert rig.decision.reason == "no word from safety", "its silence is a stop"
    rig.queue.put(consent(Source.SAFETY, "clear"))
    rig.permit.refuse("no operator permits autonomy")
    assert (rig.decision.speed_mps, rig.decision.winner) == (0.0, Source.PERMIT)
    rig.queue.put(DriveCommand(Source.TELEOP, Drive(-0.5, 0.0), None, "ann drives"))
    assert (rig.decision.driver, rig.decision.speed_mps) == (Source.TELEOP, -0.5)
    rig.queue.put(refusal(Source.ESTOP, "red button"))
    assert (rig.decision.speed_mps, rig.decision.winner) == (0.0, Source.ESTOP)


def test_the_order_is_that_of_the_settings():
    assert Source.PLANNER not in Settings().effective_order(), "off by default"
    for order in (ORDER, load_settings(None, ["planners.enabled=true", "safety.binds_teleop=true"]).effective_order()):
        places = [order.index(source) for source in (Source.PERMIT, Source.PLANNER, Source.PLANNER_HOLD)]
        assert places == sorted(places)
        assert order.index(Source.SAFETY) < order.index(Source.PLANNER)
        assert order.index(Source.TELEOP) < order.index(Source.PLANNER)
        assert order[-1] is Source.NAVIGATION


def test_a_command_holds_from_the_beat_that_it_echoes_and_no_longer(rig, slam):
    rig.drive(slam)
    sent_s = rig.now_s
    rig.now_s = sent_s + EXPIRY_S - 0.001
    assert driven(rig) == PLANNED
    rig.now_s = sent_s + EXPIRY_S
    assert rig.decision.speed_mps == 0.0


def test_the_follower_does_not_drive_in_its_place_not_even_before_the_silence_is_noticed(rig, slam):
    rig.drive(slam)
    rig.now_s += EXPIRY_S  # without a tick
    assert (rig.decision.speed_mps, rig.decision.winner) == (0.0, Source.PLANNER_HOLD)
    rig.wait(60.0)
    assert rig.decision.speed_mps == 0.0
    assert rig.decision.reason == "planner slam was lost"
    assert rig.planner_desk.status()["lost"] == "slam"


def test_a_planner_that_asks_for_nothing_stops_the_car(rig, slam):
    rig.drive(slam)
    slam.send(Press(0))
    assert (rig.decision.speed_mps, rig.decision.winner) == (0.0, Source.PLANNER_HOLD)
    rig.drive(slam)
    assert driven(rig) == PLANNED


def test_a_goodbye_gives_the_car_back_and_may_be_said_thrice(rig, slam):
    rig.drive(slam)
    for _ in range(3):
        slam.send(Press.GOODBYE)
    assert rig.decision.driver is Source.NAVIGATION
    assert rig.refused("slam") == {}
    rig.wait(1.0)
    assert rig.planner_desk.status()["lost"] == ""


def test_a_lost_planner_takes_the_permit_along_and_only_a_new_one_lets_the_follower_go():
    rig = Rig(permit="required")
    slam, ann = Planner(rig, "slam"), rig.operator()
    rig.beat()
    ann.click(Press.AUTONOMY)
    for _ in range(5):
        rig.wait(STEP_S)
        ann.send(Press.AUTONOMY)
        slam.send()
    assert driven(rig) == PLANNED
    ann.hold(Press.AUTONOMY, 0.5)
    assert rig.decision.speed_mps == 0.0
    assert not rig.desk.view().permitted, "still held, and worth nothing"
    rig.drive(slam, 0.1)
    assert rig.decision.speed_mps == 0.0, "its return is no permit"
    rig.wait(0.3)
    ann.send()
    ann.hold(Press.AUTONOMY, 0.1)
    assert (rig.decision.driver, rig.decision.speed_mps) == (Source.NAVIGATION, 1.0)
    assert rig.planner_desk.status()["lost"] == ""


def test_a_planner_lost_while_a_human_drives_does_not_stop_the_human():
    rig = Rig(permit="required")
    slam, ann = Planner(rig, "slam"), rig.operator()
    rig.beat()
    ann.click()
    for _ in range(5):
        rig.wait(STEP_S)
        ann.send(Press.MANUAL)
        slam.send()
    ann.hold(Press.MANUAL, 0.5)
    assert (rig.decision.driver, rig.decision.speed_mps) == (Source.TELEOP, 2.0)


def test_where_no_permit_is_needed_it_drives_on_when_it_is_back(rig, slam):
    rig.drive(slam)
    rig.wait(1.0)
    assert rig.decision.speed_mps == 0.0
    rig.drive(slam)
    assert driven(rig) == PLANNED


@pytest.mark.parametrize(
    ("changes", "kind"),
    [
        ({"car_session": 5}, "for another start of the car"),
        ({"beat": 9999}, "unknown beat"),
        ({"sequence": 1}, "replay"),
        ({"flags": Press.ESTOP}, "contradicting buttons"),
        ({"flags": Press.AUTONOMY}, "contradicting buttons"),
        ({"flags": Press.MANUAL | Press.RESET}, "contradicting buttons"),
        ({"flags": Press.TAKE_OVER}, "contradicting buttons"),
        ({"session": 99}, "too many sessions"),
    ],
)
def test_what_does_not_count_is_refused_counted_and_named_and_its_drive_ends(rig, slam, changes, kind):
    rig.drive(slam)
    before_s = rig.now_s
    for _ in range(5):
        rig.wait(STEP_S)
        slam.send(**{"speed_mps": 9.0, **changes})
    assert rig.refused("slam") == {kind: 5}
    assert rig.decision.speed_mps == pytest.approx(1.5), "the last good one holds"
    rig.now_s = before_s + EXPIRY_S
    assert rig.decision.speed_mps == 0.0
    assert rig.desk.view().e_stop == {}


def test_a_command_that_waited_is_stale(rig, slam):
    rig.drive(slam)
    waited = [slam.make() for _ in range(50)]
    rig.wait(EXPIRY_S + STEP_S)
    for payload in waited:
        rig.send("slam", payload)
    assert rig.refused("slam") == {"stale": 50}
    assert rig.decision.speed_mps == 0.0


@pytest.mark.parametrize("payload", [b"", b"x" * 60, b"WRC1" + bytes(56), b"x" * 1000])
def test_nonsense_is_counted(rig, slam, payload):
    rig.drive(slam)
    rig.send("slam", payload)
    assert rig.refused("slam") == {"malformed": 1}
    assert driven(rig) == PLANNED


def test_numbers_that_are_none_are_nonsense(rig, slam):
    import struct

    payload = bytearray(slam.make())
    struct.pack_into("<f", payload, 28, math.nan)
    rig.send("slam", bytes(payload))
    assert rig.refused("slam") == {"malformed": 1}
    assert rig.decision.driver is Source.NAVIGATION


def test_the_more_urgent_planner_drives_and_each_has_a_slot_of_its_own(rig, slam):
    neural = Planner(rig, "nn", session=2)
    rig.beat()
    rig.drive(neural, speed_mps=0.7)
    assert rig.decision.speed_mps == pytest.approx(0.7)
    for _ in range(5):
        rig.wait(STEP_S)
        slam.send()
        neural.send(speed_mps=0.7)
    assert driven(rig) == PLANNED
    rig.drive(neural, 0.3, speed_mps=0.7)
    assert rig.decision.speed_mps == pytest.approx(0.7), "slam fell silent"
    slam.send(Press.GOODBYE)
    rig.drive(neural, 0.1, speed_mps=0.7)
    assert rig.decision.speed_mps == pytest.approx(0.7)


class RosSender:
    """A ROS 2 program with another clock: 1000 s behind, and a link that takes way_s."""

    def __init__(self, rig, gid=GID):
        self.rig, self.gid, self.sequence, self.way_s, self.ahead_s = rig, gid, 0, 0.01, -1000.0

    def make(self, speed_mps=0.8):
        self.sequence += 1
        stamp_s = self.rig.now_s + self.ahead_s
        note = attachment(self.sequence, round(stamp_s * 1e9), self.gid)
        return messages.ackermann(1, speed_mps, -0.1), note

    def send(self, **changes):
        payload, note = self.make(**changes)
        self.rig.planner_desk.receive_ros(payload, note, self.rig.now_s + self.way_s)

    def drive(self, seconds):
        for _ in range(round(seconds / STEP_S)):
            self.rig.wait(STEP_S)
            self.send()


def test_ros_drive_counts_once_its_clock_was_compared(rig):
    sender = RosSender(rig)
    sender.drive(0.48)
    assert rig.decision.driver is Source.NAVIGATION
    assert set(rig.refused("ros2")) == {"clock not compared yet"}
    sender.drive(0.1)
    assert driven(rig) == (Source.PLANNER, pytest.approx(0.8), pytest.approx(-0.1))
    assert rig.decision.reason == "planner ros2 drives"
    rig.wait(0.3)
    assert rig.decision.speed_mps == 0.0
    assert rig.planner_desk.status()["lost"] == "ros2"


def test_ros_commands_that_waited_are_stale_however_fresh_they_arrive(rig):
    sender = RosSender(rig)
    sender.drive(0.6)
    waited = []
    for _ in range(40):  # the link stands still for 0.8 s, then delivers everything at once
        rig.wait(STEP_S)
        waited.append(sender.make(speed_mps=9.0))
    for payload, note in waited[:28]:
        rig.planner_desk.receive_ros(payload, note, rig.now_s)
    assert rig.refused("ros2")["stale"] == 28
    assert rig.decision.speed_mps == 0.0


def test_after_a_long_silence_the_clock_is_compared_anew(rig):
    sender = RosSender(rig)
    sender.drive(0.6)
    waited = [sender.make(speed_mps=9.0) for _ in range(50)]
    rig.wait(3.0)
    for payload, note in waited:
        rig.planner_desk.receive_ros(payload, note, rig.now_s)
    assert rig.decision.speed_mps == 0.0


def test_a_ros_program_that_starts_again_with_another_clock_is_compared_anew(rig):
    sender = RosSender(rig)
    sender.drive(0.6)
    rig.wait(2.0)
    sender.sequence, sender.ahead_s = 0, -1090.0
    sender.drive(0.6)
    assert rig.decision.speed_mps == pytest.approx(0.8)


def test_a_second_ros_publisher_and_a_replay_are_refused(rig):
    sender, other = RosSender(rig), RosSender(rig, OTHER_GID)
    sender.drive(0.6)
    other.send(speed_mps=9.0)
    payload, note = sender.make()
    for _ in range(2):
        rig.planner_desk.receive_ros(payload, note, rig.now_s + 0.011)
    refused = rig.refused("ros2")
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
def test_ros_nonsense_is_counted_and_drives_nothing(rig, change):
    sender = RosSender(rig)
    sender.drive(0.6)
    before = rig.decision.speed_mps
    rig.planner_desk.receive_ros(*change(*sender.make(speed_mps=9.0)), rig.now_s)
    assert rig.refused("ros2")["malformed"] == 1
    assert rig.decision.speed_mps == before


def test_ros_drive_without_its_parts_is_a_mistake_in_the_settings():
    from runtime.settings.tree import SettingsError

    for missing in (["ros2.enabled=true"], ["planners.enabled=true"], []):
        with pytest.raises(SettingsError, match=r"ros2\.drive needs"):
            load_settings(None, ["ros2.drive=true", *missing])
    settings = load_settings(None, ["ros2.drive=true", "ros2.enabled=true", "planners.enabled=true"])
    assert settings.planner_names() == ("ros2",)
    assert load_settings(None, ['planners.names=["slam"]']).planner_names() == (), "off"
