"""The planners' desk, under the real arbitration and operator's desk, in virtual time: every rule, broken once each."""

import math
import struct

import pytest

from tests.runtime.teleop.planner_rig import DRIVES, EXPIRY_S, ORDER, PLANNED, STEP_S, Planner, Rig, driven
from wallride.drivers.api import Drive
from wallride.runtime.arbitration.command import DriveCommand, Source, consent, refusal
from wallride.runtime.settings.tree import Settings, load_settings
from wallride.runtime.wire.teleop import Press


@pytest.fixture
def rig():
    return Rig()


@pytest.fixture
def slam(rig):
    planner = Planner(rig, "slam")
    rig.beat()
    return planner


def together(rig, ann, press, *sends):
    """Let an operator press, and planners send beside it for a tenth of a second."""
    rig.beat()
    ann.click(press)
    for _ in range(5):
        rig.wait(STEP_S)
        ann.send(press)
        for send in sends:
            send()


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
    assert rig.refused_of("slam") == {}
    rig.wait(1.0)
    assert rig.planner_desk.status()["lost"] == ""


def test_a_planner_that_leaves_unsure_is_lost_at_once_and_its_name_is_free(rig, slam):
    rig.drive(slam)
    assert driven(rig) == PLANNED
    for _ in range(3):
        slam.send(Press.GOODBYE | Press.UNSURE)
    assert rig.decision.speed_mps == 0.0
    assert rig.planner_desk.status()["lost"] == "slam"
    assert rig.refused_of("slam") == {}
    rig.drive(Planner(rig, "slam", session=2))
    assert driven(rig) == PLANNED


def test_a_planner_that_fails_before_its_first_plan_stops_the_car_and_its_name_is_free(rig, slam):
    slam.send(Press(0))
    slam.send(Press.GOODBYE | Press.UNSURE)
    assert rig.decision.speed_mps == 0.0
    rig.wait(5.0)
    assert rig.decision.speed_mps == 0.0, "a failure gives the car to no follower"
    rig.drive(Planner(rig, "slam", session=2))
    assert driven(rig) == PLANNED


def test_a_lost_planner_takes_the_permit_along_and_only_a_new_one_lets_the_follower_go():
    rig = Rig(permit="required")
    slam, ann = Planner(rig, "slam"), rig.client("ann", 50)
    together(rig, ann, Press.AUTONOMY, slam.send)
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
    slam, ann = Planner(rig, "slam"), rig.client("ann", 50)
    together(rig, ann, Press.MANUAL, slam.send)
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
    assert rig.refused_of("slam") == {kind: 5}
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
    assert rig.refused_of("slam") == {"stale": 50}
    assert rig.decision.speed_mps == 0.0


@pytest.mark.parametrize("payload", [b"", b"x" * 60, b"WRC1" + bytes(56), b"x" * 1000])
def test_nonsense_is_counted(rig, slam, payload):
    rig.drive(slam)
    rig.send("slam", payload)
    assert rig.refused_of("slam") == {"malformed": 1}
    assert driven(rig) == PLANNED


def test_numbers_that_are_none_are_nonsense(rig, slam):
    payload = slam.make()
    rig.send("slam", payload[:28] + struct.pack("<f", math.nan) + payload[32:])
    assert rig.refused_of("slam") == {"malformed": 1}
    assert rig.decision.driver is Source.NAVIGATION


@pytest.mark.parametrize("asks", [DRIVES, Press(0)])
def test_after_a_goodbye_the_next_planner_in_force_has_the_car_at_once_and_its_loss_is_noticed(asks):
    rig = Rig(permit="required")
    slam, nn, ann = Planner(rig, "slam"), Planner(rig, "nn", session=2), rig.client("ann", 50)
    together(rig, ann, Press.AUTONOMY, slam.send, lambda: nn.send(asks, speed_mps=0.7))
    slam.send(Press.GOODBYE)
    assert rig.planner_desk.status()["driving"] == "nn"
    assert rig.decision.speed_mps == (pytest.approx(0.7) if asks else 0.0)
    ann.hold(Press.AUTONOMY, 0.5)
    assert rig.planner_desk.status()["lost"] == "nn"
    assert not rig.desk.view().permitted, "the permit ended with the planner"


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
