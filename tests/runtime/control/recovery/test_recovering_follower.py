"""A car that cannot go on says so where people look: in the reason of the decision, which the status quotes."""

from copy import deepcopy
from dataclasses import replace

import numpy as np
import pytest

from tests.runtime.control.recovery.stage import room
from tests.runtime.control.scans import BEARING_RAD, CAR, SCAN_S, scan_of
from wallride.drivers.api import Drive, MotorState
from wallride.runtime.arbitration.command import DriveCommand, Output, Source, SpeedLimit, Verdict, arbitrate
from wallride.runtime.control.guidance import Guidance
from wallride.runtime.control.laws import LiveLaws
from wallride.runtime.control.recovery.recovering_follower import RecoveringFollower
from wallride.runtime.control.recovery.way_out import ASKS_AFTER_S, DISBELIEF, HELP, Recovery
from wallride.runtime.control.safety.swept import SweptGuard
from wallride.runtime.control.safety.swept_settings import RecoverySettings, SweptSettings
from wallride.runtime.settings.tree import Settings
from wallride.runtime.telemetry.status import decision_fields

SAFETY, NAVIGATION = Source.SAFETY, Source.NAVIGATION


class Straight:
    """Wants to go straight on, whatever it sees."""

    def follow(self, scan, motor):
        return Guidance(Drive(1.0, 0.0), 1.0, 0.0, 0.0, "wall")


class Car:
    """A car that stands between boxes, its laws, and the mux's decision after each scan."""

    def __init__(self, *boxes, **settings):
        self.rooms = room(*boxes)
        self.guard = SweptGuard(SweptSettings(), CAR)
        self.follower = RecoveringFollower(Straight(), self.guard, Recovery(RecoverySettings(**settings)))
        self.scans = 0
        self.word = DriveCommand(NAVIGATION, Drive(1.0, 0.0), None, "wall")
        self.said = set()

    def decide(self, assessment):
        live = (SpeedLimit(SAFETY, assessment, self.scan.stamp_s), self.word)
        decision, ((judge, memory),) = arbitrate(live, frozenset({SAFETY}), (SAFETY, Source.TELEOP, NAVIGATION))
        judge.commit(memory)
        return decision

    def look(self):
        self.scans += 1
        now_s = self.scans * SCAN_S
        self.scan = scan_of(self.rooms.cast(CAR.lidar_x_m, 0.0, BEARING_RAD), now_s, self.scans)
        self.motor = MotorState(now_s, 0.0, 0.0, 0.0)
        return self.guard.look(self.scan, self.motor)

    def step(self):
        assessment = self.look()
        guidance = self.follower.follow(self.scan, self.motor)
        self.word = DriveCommand(
            NAVIGATION, guidance.drive or Drive(0.0, 0.0), self.scan.stamp_s, guidance.reason, guidance.stuck
        )
        self.said.add(guidance.reason)
        return self.decide(assessment)

    def go(self, seconds):
        return [self.step() for _ in range(round(seconds / SCAN_S))]


CAGE = (0.7, 0.0, 0.4, 1.4), (0.1, 0.36, 1.4, 0.3), (0.1, -0.36, 1.4, 0.3)


@pytest.fixture(scope="module")
def _waited():
    car = Car(*CAGE)
    car.go(4.0)
    return car


@pytest.fixture
def caged(_waited):
    """Return a car that has asked for help in a cage."""
    return deepcopy(_waited)


def test_boxed_in_without_a_way_out_reaches_the_status():
    car = Car(*CAGE)
    first, *_, last = car.go(4.0)
    assert first.reason == "boxed in"
    assert (last.speed_mps, last.winner, last.reason) == (0.0, SAFETY, HELP)
    fields = decision_fields(Output(4.0, Drive(0.0, 0.0), last, delivered=True), {NAVIGATION: car.word})
    assert (fields["winner"], fields["reason"], fields["driver"]) == ("safety", "boxed in: needs help", "navigation")
    assert fields["measure"] == pytest.approx(0.05, abs=0.04), "and how far away what is ahead is"


def test_between_a_scan_and_its_answer_the_words_are_the_same(caged):
    """The mux may decide in between; a reason that changes to and fro would be an event eighty times a second."""
    assessment = caged.look()
    caged.word = replace(caged.word, scan_stamp_s=None)
    assert caged.decide(assessment).reason == HELP


def test_a_human_who_drives_a_boxed_in_car_reads_what_is_in_the_way(caged):
    caged.word = DriveCommand(Source.TELEOP, caged.word.drive, None, "pad drives")
    assert caged.decide(caged.look()).reason == "boxed in"


def test_a_stuck_driver_hides_no_other_reason_of_safety(caged):
    late = Verdict(0.0, 0.0, "the scan is too old")
    assert caged.decide(late).reason == "the scan is too old"


def test_when_the_way_is_free_again_no_help_is_asked_for(caged):
    cage, caged.rooms = caged.rooms, Car().rooms
    caged.go(1.0)
    caged.rooms = cage
    assert caged.step().reason == "boxed in"


@pytest.mark.parametrize("stood_s", np.arange(2.1, 2.7, 0.1))
def test_nobody_backs_out_of_a_way_that_has_just_become_free(stood_s):
    """A stop is held for a moment, and patience may end just then."""
    car = Car(*CAGE)
    car.go(stood_s)
    car.rooms = Car().rooms
    assert car.go(1.0)[-1].speed_mps == 1.0
    assert car.said == {"wall", "waiting for the way to clear", HELP}


def test_who_may_not_back_out_asks_for_help_when_nobody_has_walked_on():
    car = Car((0.75, 0.0, 0.5, 0.3), tries=0)
    waiting = car.go(ASKS_AFTER_S - 1.0)
    assert {decision.reason for decision in waiting} == {"boxed in"}
    asking = car.go(2.0)
    assert asking[-1].reason == HELP
    assert {decision.speed_mps for decision in waiting + asking} == {0.0}


@pytest.mark.parametrize("believed", [True, False])
def test_a_car_looks_for_a_way_out_only_by_an_odometry_that_is_believed(believed):
    car = Car((0.62, 0.0, 0.3, 0.5))
    car.follower = RecoveringFollower(Straight(), car.guard, Recovery(RecoverySettings()), lambda: believed)
    car.go(4.0)
    assert (HELP in car.said) is believed
    assert (DISBELIEF in car.said) is not believed


@pytest.mark.parametrize("believed", [True, False])
def test_the_cars_laws_ask_whether_the_wheels_way_is_the_scans(believed):
    settings = Settings()
    laws = LiveLaws(settings.wall_follow, settings.safety, CAR)
    laws.plausibility.believed = believed
    car = Car(*CAGE)
    assert isinstance(laws.guard, SweptGuard)
    assert isinstance(laws.follower, RecoveringFollower)
    car.guard, car.follower = laws.guard, laws.follower
    car.go(4.0)
    assert (HELP in car.said) is believed
    assert (DISBELIEF in car.said) is not believed
