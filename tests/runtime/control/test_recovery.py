"""The way out: patience, a plan, a few tries, and plain words when there is none. On a rolling car without devices."""

import math
from typing import Any

import numpy as np
import pytest

from drivers.api import Drive, MotorState, Scan
from runtime.car_settings import CarSettings
from runtime.control.footprint import STEP_M
from runtime.control.perception import Eyes
from runtime.control.recovery import NO_ADVICE, Leg, Recovery, _manoeuvres, plan
from runtime.control.swept import SweptGuard
from runtime.control.swept_settings import RecoverySettings, SweptSettings
from sim.pose import CAR as OUTLINE
from sim.pose import Pose
from sim.segments import SegmentGeometry, box

CAR = CarSettings()
STEP_RAD = math.radians(0.25)
BEARING_RAD = STEP_RAD * (np.arange(1081) - 540)
SCAN_S = 0.025
WAY = Drive(1.0, 0.0)


def room(*boxes):
    walls = [*box(0.0, 0.0, 12.0, 12.0, 0.0)]
    for x_m, y_m, length_m, width_m in boxes:
        walls += [*box(x_m, y_m, length_m, width_m, 0.0)]
    return SegmentGeometry(np.array(walls))


AHEAD = room((0.75, 0.0, 0.5, 0.3))
"""A box 8 cm before the bumper, in the middle of a room."""


class Stage:
    """A car that rolls exactly as told, its safety, and its way out; `step` is one scan."""

    def __init__(self, surroundings, **settings):
        self.surroundings = surroundings
        self.guard = SweptGuard(SweptSettings(), CAR, Eyes(CAR))
        self.recovery = Recovery(RecoverySettings(**settings))
        self.pose = Pose(0.0, 0.0, 0.0)
        self.now_s = self.way_m = self.speed_mps = self.wheel_rad = 0.0
        self.said = []
        self.outlook: Any = None

    def look(self):
        self.now_s += SCAN_S
        at = self.pose.ahead(CAR.lidar_x_m)
        ranges_m = self.surroundings.cast(at.x_m, at.y_m, BEARING_RAD + self.pose.yaw_rad).astype(np.float32)
        state = MotorState(
            self.now_s, self.speed_mps, self.way_m, self.wheel_rad, 12.0, 0.0, 0.0, 20.0, "",
            timed_out=False, killed=False,
        )  # fmt: skip
        scan = Scan(self.now_s, self.now_s, -STEP_RAD * 540, STEP_RAD, 0.02, 30.0, ranges_m, 0)
        self.outlook = self.guard.look(scan, state)
        return state

    def step(self, wish=WAY):
        state = self.look()
        advice = self.recovery.step(self.outlook, wish, state)
        if advice.words and (not self.said or self.said[-1] != advice.words):
            self.said.append(advice.words)
        drive = advice.drive or wish or Drive(0.0, 0.0)
        verdict = self.outlook.limit(drive.speed_mps, drive.steering_rad)
        self.speed_mps = max(-verdict.reverse_mps, min(verdict.forward_mps, drive.speed_mps))
        self.wheel_rad += max(-0.08, min(0.08, drive.steering_rad - self.wheel_rad))
        step_m = self.speed_mps * SCAN_S
        turn_rad = step_m * math.tan(self.wheel_rad) / CAR.wheelbase_m
        moved = self.pose.ahead(step_m)
        self.pose = Pose(moved.x_m, moved.y_m, self.pose.yaw_rad + turn_rad)
        self.way_m += step_m
        return advice

    def go(self, seconds, wish=WAY):
        return [self.step(wish) for _ in range(round(seconds / SCAN_S))]

    @property
    def clearance_m(self):
        return self.surroundings.clearance(self.pose, OUTLINE)


def test_patience_first():
    stage = Stage(AHEAD)
    stage.go(1.9)
    assert stage.said == ["waiting for the way to clear"]
    assert stage.way_m == 0.0


def test_somebody_who_walks_on_costs_no_manoeuvre():
    stage = Stage(AHEAD)
    stage.go(1.5)
    stage.surroundings = room()
    stage.go(1.2)  # a hard stop is held for a moment
    assert stage.step() == NO_ADVICE
    assert stage.said == ["waiting for the way to clear"]
    assert stage.pose.x_m > 0.5


def test_a_moving_car_is_not_asked_about():
    """A human may be driving it: the safety would start to brake for what only the follower wished."""
    stage = Stage(room((1.1, 0.0, 0.5, 0.3)))
    stage.speed_mps = 2.0
    state = stage.look()
    assert stage.recovery.step(stage.outlook, Drive(2.0, 0.0), state) == NO_ADVICE
    assert not stage.guard.memory.braking
    assert stage.outlook.limit(2.0, 0.0).forward_mps == 0.0
    assert stage.guard.memory.braking


def wait(stage, monkeypatch, *episodes):
    """Let the car be boxed in or not for some time each, (seconds, boxed, speed), and say whether it set about it."""
    for seconds, boxed, speed_mps in episodes:
        monkeypatch.setattr(stage.recovery, "_is_boxed_in", lambda *_, boxed=boxed: boxed)
        for _ in range(round(seconds / SCAN_S)):
            state = stage.look()
            stage.outlook.speed_mps = speed_mps
            stage.recovery.step(stage.outlook, WAY, state)
    return bool(stage.recovery._legs)


def test_noise_at_the_edge_does_not_make_patience_begin_anew(monkeypatch):
    """Now and then a scan or five say that the way is free; the car does not get going on that."""
    assert wait(Stage(AHEAD), monkeypatch, *[(0.5, True, 0.0), (0.125, False, 0.0)] * 3, (0.5, True, 0.0))


def test_patience_begins_anew_when_the_way_was_free_for_a_moment(monkeypatch):
    assert not wait(Stage(AHEAD), monkeypatch, (1.8, True, 0.0), (0.35, False, 0.0), (1.0, True, 0.0))


def test_patience_begins_anew_when_the_car_got_going(monkeypatch):
    assert not wait(Stage(AHEAD), monkeypatch, (1.8, True, 0.0), (0.1, False, 0.3), (1.0, True, 0.0))


def test_backs_out_turns_out_and_hands_the_wheel_back_without_a_touch():
    stage = Stage(AHEAD)
    least_m = 1.0
    for _ in range(round(8 / SCAN_S)):
        stage.step()
        least_m = min(least_m, stage.clearance_m)
        if stage.said[-1].startswith("turning") and stage.recovery._legs == []:
            break
    assert stage.said[1:] == ["backing out, try 1 of 3", "turning out, try 1 of 3"]
    assert least_m > 0.02
    stage.go(2.0)
    assert stage.pose.x_m > 1.2  # past the box
    assert stage.step() == NO_ADVICE


def test_wheels_turn_before_the_car_moves():
    stage = Stage(AHEAD)
    advices = stage.go(2.3)
    first = next(advice.drive for advice in advices if advice.drive)
    assert first.speed_mps == 0.0
    assert stage.way_m == 0.0


def test_where_nothing_opens_it_asks_for_help_and_stays():
    stage = Stage(room((0.7, 0.0, 0.4, 1.4), (0.1, 0.36, 1.4, 0.3), (0.1, -0.36, 1.4, 0.3)))
    stage.go(6.0)
    assert stage.said == ["waiting for the way to clear", "boxed in: needs help"]
    assert stage.way_m == 0.0


def remember(stage, x_m, y_m=0.0):
    """Put something 10 cm wide across the way back into the memory of what is behind."""
    stage.guard.behind._views.append(x_m + 1j * (y_m + np.linspace(-0.05, 0.05, 12)))
    stage.outlook.strip._hidden_m = None
    stage.outlook.strip._kept.clear()


def longest_back_m(stage, settings):
    return max((-leg.travel_m for legs, _ in _manoeuvres(stage.outlook, settings) for leg in legs[:1]), default=0.0)


@pytest.mark.parametrize("at_x_m", [-0.4, -0.5])
def test_what_is_behind_ends_the_way_back(at_x_m):
    """The lidar does not see the thing behind; what it saw while coming, it knows."""
    stage, settings = Stage(AHEAD), RecoverySettings(back_m=0.5)
    stage.look()
    assert longest_back_m(stage, settings) > 0.45
    remember(stage, at_x_m)
    room_m = -at_x_m - CAR.rear_m - stage.guard.settings.front_margin_m
    assert room_m - 3 * STEP_M < longest_back_m(stage, settings) <= room_m - STEP_M + 1e-9


def test_what_a_slide_has_put_where_the_car_is_holds_nobody():
    """Locked wheels tell of no way: what was beside the car is remembered in it, and nothing else is there."""
    stage, settings = Stage(AHEAD), RecoverySettings(back_m=0.5)
    stage.look()
    remember(stage, -0.02)
    remember(stage, -0.02, 0.16)
    assert longest_back_m(stage, settings) > 0.45
    remember(stage, -0.4)
    assert longest_back_m(stage, settings) < 0.3


def test_nothing_is_planned_where_there_is_no_room_behind():
    stage = Stage(AHEAD)
    stage.look()
    remember(stage, -0.28)
    assert plan(stage.outlook, RecoverySettings()) == []


def test_no_more_tries_than_allowed():
    stage = Stage(AHEAD, tries=1)
    for _ in range(round(20 / SCAN_S)):
        busy = bool(stage.recovery._legs)
        stage.step()
        if busy and not stage.recovery._legs:
            stage.pose = Pose(0.0, 0.0, 0.0)  # somebody puts it back before the box
    assert stage.said[-1] == "boxed in: needs help"
    assert [words for words in stage.said if words.startswith("backing")][-1] == "backing out, try 1 of 1"


def test_tries_are_counted_anew_farther_on():
    stage = Stage(AHEAD)
    stage.go(8.0)
    stage.way_m += 5.0
    stage.surroundings = room()
    stage.step()
    stage.surroundings, stage.pose, stage.speed_mps = AHEAD, Pose(0.0, 0.0, 0.0), 0.0
    stage.said.clear()
    stage.go(4.5)
    assert "backing out, try 1 of 3" in stage.said


@pytest.mark.parametrize("wish", [None, Drive(0.0, 0.0), Drive(-0.5, 0.0)])
def test_a_driver_who_does_not_want_ahead_is_left_alone(wish):
    stage = Stage(AHEAD)
    stage.go(2.6)
    assert stage.recovery._legs
    assert stage.step(wish) == NO_ADVICE
    assert not stage.recovery._legs


def test_a_new_obstacle_ends_a_leg():
    stage = Stage(AHEAD)
    while not stage.said or not stage.said[-1].startswith("turning"):
        stage.step()
    stage.surroundings = room((stage.pose.x_m + 0.8, stage.pose.y_m, 0.5, 3.0))
    before_m = stage.way_m
    stage.go(1.5)
    assert stage.way_m - before_m < 0.15
    assert not stage.recovery._legs


def test_a_car_that_sees_nothing_is_not_boxed_in():
    """Safety says what is wrong; nobody plans a way out, and nobody talks of walls."""
    stage = Stage(AHEAD)
    stage.surroundings = SegmentGeometry(np.array([[50.0, 50.0, 51.0, 50.0]]))
    stage.go(3.0)
    assert stage.outlook.limit(1.0, 0.0).reason == "the lidar sees almost nothing: uncover or clean it"
    assert stage.said == []


def test_without_a_motor_report_nothing_is_begun():
    stage = Stage(AHEAD)
    stage.look()
    assert stage.recovery.step(stage.outlook, WAY, None) == NO_ADVICE


def turn_piece(back_rad, ahead_rad, back_m=0.2, ahead_m=0.3):
    return [Leg(back_rad, -back_m), Leg(ahead_rad, ahead_m)], ahead_m


@pytest.mark.parametrize(
    ("pieces", "chosen"),
    [
        ([turn_piece(0.34, -0.34)], 0),
        ([turn_piece(0.34, 0.34), turn_piece(-0.34, 0.17), turn_piece(0.0, 0.34)], 1),
        ([turn_piece(0.34, -0.34), turn_piece(0.34, -0.34, ahead_m=0.4)], 1),
        ([turn_piece(0.34, -0.34), turn_piece(0.34, 0.34, ahead_m=1.0)], 1),
        ([turn_piece(0.34, -0.34, ahead_m=0.2)], None),
    ],
)
def test_where_nothing_opens_back_and_ahead_with_opposite_wheels_turns_the_car(monkeypatch, pieces, chosen):
    monkeypatch.setattr("runtime.control.recovery._manoeuvres", lambda *_: iter(pieces))
    stage = Stage(AHEAD)
    stage.look()
    assert plan(stage.outlook, RecoverySettings()) == ([] if chosen is None else pieces[chosen][0])


@pytest.mark.parametrize(("ahead_m", "begun"), [(0.3, 2), (0.6, 1)])
def test_a_piece_of_a_turn_and_what_follows_are_one_try(monkeypatch, ahead_m, begun):
    monkeypatch.setattr(
        "runtime.control.recovery._manoeuvres", lambda *_: iter([turn_piece(0.34, -0.34, ahead_m=ahead_m)])
    )
    stage, begins = Stage(AHEAD, tries=1), 0
    for _ in range(round(20 / SCAN_S)):
        busy = bool(stage.recovery._legs)
        stage.step()
        begins += not busy and bool(stage.recovery._legs)
        if busy and not stage.recovery._legs:
            stage.pose = Pose(0.0, 0.0, 0.0)  # somebody puts it back before the box
    assert begins == begun
    assert stage.said[-1] == "boxed in: needs help"
