"""The way out: patience, a plan, a few tries, and plain words when there is none. On a rolling car without devices."""

import math
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from tests.runtime.in_earnest import judged
from wallride.drivers.api import Drive, MotorState, Scan
from wallride.runtime.control.recovery.traffic import SETTLED_S
from wallride.runtime.control.recovery.way_out import DISBELIEF, HELP, NO_ADVICE, TRAFFIC, TURNS, Recovery
from wallride.runtime.control.safety.swept import SweptGuard
from wallride.runtime.control.safety.swept_settings import RecoverySettings, SweptSettings
from wallride.runtime.control.vehicle import CarSettings
from wallride.sim.world.pose import CAR as OUTLINE
from wallride.sim.world.pose import Pose
from wallride.sim.world.segments import SegmentGeometry, box

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
        self.guard = SweptGuard(SweptSettings(), CAR)
        self.recovery = Recovery(RecoverySettings(**settings))
        self.pose = Pose(-1.5, 0.0, 0.0)
        self.now_s = self.way_m = self.speed_mps = self.wheel_rad = 0.0
        self.said = []
        self.assessment: Any = None
        self.advice: Any = None

    def look(self):
        self.now_s += SCAN_S
        at = self.pose.ahead(CAR.lidar_x_m)
        ranges_m = self.surroundings.cast(at.x_m, at.y_m, BEARING_RAD + self.pose.yaw_rad).astype(np.float32)
        state = MotorState(
            self.now_s, self.speed_mps, self.way_m, self.wheel_rad, 12.0, 0.0, 0.0, 20.0, "",
            timed_out=False, killed=False,
        )  # fmt: skip
        scan = Scan(self.now_s, self.now_s, -STEP_RAD * 540, STEP_RAD, 0.02, 30.0, ranges_m, 0)
        self.assessment = self.guard.look(scan, state)
        return state

    def step(self, wish=WAY, *, believed=True, toward_rad=math.nan):
        state = self.look()
        advice = self.advice = self.recovery.step(
            self.assessment, wish, state, believed=believed, toward_rad=toward_rad
        )
        if advice.words and (not self.said or self.said[-1] != advice.words):
            self.said.append(advice.words)
        drive = advice.drive or wish or Drive(0.0, 0.0)
        verdict = judged(self.assessment, drive.speed_mps, drive.steering_rad)
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

    def drive_up(self):
        """Drive until the car stands, and begin to count there."""
        self.go(1.0)
        while abs(self.speed_mps) > 0.0:
            self.step()
        self.said.clear()
        return self

    def manoeuvres(self, until, most_s=40.0):
        """Go on until this holds; the least clearance on the way."""
        least_m = math.inf
        for _ in range(round(most_s / SCAN_S)):
            self.step()
            least_m = min(least_m, self.clearance_m)
            if until(self):
                return least_m
        raise AssertionError(f"not within {most_s} s: {self.said[-3:]} at {self.pose}")

    @property
    def moves(self):
        """Whether the manoeuvre asks for a speed, beyond turning the wheels."""
        return self.advice.drive is not None and self.advice.drive.speed_mps != 0.0

    @property
    def last(self):
        return self.said[-1] if self.said else ""

    @property
    def clearance_m(self):
        return self.surroundings.clearance(self.pose, OUTLINE)


def test_patience_first():
    stage = Stage(AHEAD).drive_up()
    at_m = stage.way_m
    stage.go(1.8)
    assert stage.said == ["waiting for the way to clear"]
    assert stage.way_m == at_m


def test_a_person_who_walks_on_costs_no_manoeuvre():
    stage = Stage(AHEAD).drive_up()
    stage.go(1.5)
    stage.surroundings = room()
    stage.go(1.2)  # a hard stop is held for a moment
    assert stage.step() == NO_ADVICE
    assert stage.said == ["waiting for the way to clear"]
    assert stage.pose.x_m > 0.5


def test_a_moving_car_is_not_asked_about():
    """A human may be driving it: the safety would start to brake for what only the follower wished."""
    stage = Stage(room((-0.4, 0.0, 0.5, 0.3)))
    stage.speed_mps = 2.0
    state = stage.look()
    assert stage.recovery.step(stage.assessment, Drive(2.0, 0.0), state) == NO_ADVICE
    assert not stage.guard.memory.braking
    assert judged(stage.assessment, 2.0, 0.0).forward_mps == 0.0
    assert stage.guard.memory.braking


def wait(stage, monkeypatch, *episodes):
    """Let the car be boxed in or not for some time each, (seconds, boxed, speed), and say whether it set about it."""
    for seconds, boxed, speed_mps in episodes:
        monkeypatch.setattr(stage.recovery, "_is_boxed_in", lambda *_, boxed=boxed: boxed)
        for _ in range(round(seconds / SCAN_S)):
            state = stage.look()
            stage.assessment.percept = replace(stage.assessment.percept, speed_mps=speed_mps)
            begun = stage.recovery.step(stage.assessment, WAY, state).drive is not None
    return begun


def test_noise_at_the_edge_does_not_make_patience_begin_anew(monkeypatch):
    """Now and then a scan or five say that the way is free; the car does not get going on that."""
    assert wait(Stage(AHEAD).drive_up(), monkeypatch, *[(0.5, True, 0.0), (0.125, False, 0.0)] * 3, (0.5, True, 0.0))


def test_patience_begins_anew_when_the_way_was_free_for_a_moment(monkeypatch):
    assert not wait(Stage(AHEAD).drive_up(), monkeypatch, (1.8, True, 0.0), (0.35, False, 0.0), (1.0, True, 0.0))


def test_patience_begins_anew_when_the_car_got_going(monkeypatch):
    assert not wait(Stage(AHEAD).drive_up(), monkeypatch, (1.8, True, 0.0), (0.1, False, 0.3), (1.0, True, 0.0))


def free(stage):
    """Whether the manoeuvre is over and the wheel handed back."""
    return stage.last.startswith("turning") and stage.step() == NO_ADVICE


def test_backs_out_turns_out_and_hands_the_wheel_back_without_a_touch():
    stage = Stage(AHEAD).drive_up()
    least_m = stage.manoeuvres(free)
    assert stage.said[0] == "waiting for the way to clear"
    assert set(stage.said[1:]) == {"backing out, try 1 of 6", "turning out, try 1 of 6"}
    assert least_m > 0.02
    stage.go(2.0)
    assert stage.pose.x_m > 1.0 or abs(stage.pose.y_m) > 1.0  # past the box
    assert stage.step() == NO_ADVICE


def test_wheels_turn_before_the_car_moves():
    stage = Stage(AHEAD).drive_up()
    at_m, advice = stage.way_m, NO_ADVICE
    while advice.drive is None:
        advice = stage.step()
    assert advice.drive.speed_mps == 0.0
    assert stage.way_m == at_m


BLIND = room((0.9, 0.0, 0.2, 2.0), (-1.5, 0.75, 5.0, 0.2), (-1.5, -0.75, 5.0, 0.2))
"""A lane 1.3 m wide that ends before the car: there is no other way than to turn round in it and to leave."""


def test_turns_round_in_a_blind_end_and_leaves_it_without_a_touch():
    stage = Stage(BLIND)
    stage.pose = Pose(-2.7, 0.0, 0.0)
    stage.drive_up()
    least_m = stage.manoeuvres(lambda stage: free(stage) and abs(stage.pose.yaw_rad) > 2.0, 60.0)
    assert least_m > 0.005
    assert HELP not in stage.said


def test_where_nothing_opens_it_asks_for_help_and_stays():
    stage = Stage(room((0.7, 0.0, 0.4, 1.4), (0.1, 0.36, 1.4, 0.3), (0.1, -0.36, 1.4, 0.3), (-0.5, 0.0, 0.2, 1.4)))
    stage.pose = Pose(0.0, 0.0, 0.0)
    stage.go(8.0)
    assert stage.said[:1] + stage.said[-1:] == ["waiting for the way to clear", HELP]
    assert stage.way_m == 0.0


def test_a_car_that_never_saw_what_is_behind_it_does_not_back():
    """Set down with its nose before a box and its tail before another one, which no beam meets."""
    stage = Stage(room((0.75, 0.0, 0.5, 0.3), (-0.4, 0.0, 0.3, 0.3)))
    stage.pose = Pose(0.0, 0.0, 0.0)
    stage.go(8.0)
    assert stage.said[-1] == HELP
    assert stage.way_m == 0.0


def test_does_not_back_on_an_odometry_that_is_not_believed():
    stage = Stage(AHEAD).drive_up()
    at_m = stage.way_m
    for _ in range(round(8 / SCAN_S)):
        stage.step(believed=False)
    assert stage.said == [DISBELIEF]
    assert stage.way_m == at_m


def test_odometry_that_ceases_to_be_believed_ends_a_manoeuvre():
    stage = Stage(AHEAD).drive_up()
    stage.manoeuvres(lambda stage: stage.speed_mps < 0.0)
    at_m = stage.way_m
    for _ in range(round(3 / SCAN_S)):
        assert stage.step(believed=False).drive is None
    assert stage.way_m >= at_m


def test_wheels_that_report_no_way_end_a_manoeuvre_and_every_other():
    stage = Stage(AHEAD)
    stage.drive_up()
    while stage.speed_mps >= 0.0:
        stage.step()
    stands_m, from_m = stage.way_m, complex(stage.pose.x_m, stage.pose.y_m)
    for _ in range(400):
        stage.step()
        stage.way_m = stands_m
    assert abs(complex(stage.pose.x_m, stage.pose.y_m) - from_m) < 0.45
    assert stage.said[-1] == HELP
    assert stage.speed_mps == 0.0


def test_no_more_tries_than_allowed():
    stage = Stage(AHEAD, tries=1).drive_up()
    before = stage.pose, stage.way_m
    stage.manoeuvres(free)
    stage.pose, stage.way_m, stage.speed_mps = *before, 0.0  # put back before the box
    stage.go(6.0)
    assert stage.said[-1] == HELP
    assert {words for words in stage.said if words.startswith("backing")} == {"backing out, try 1 of 1"}


def test_tries_are_counted_anew_farther_on():
    stage = Stage(AHEAD, tries=1).drive_up()
    before = stage.pose
    stage.manoeuvres(free)
    stage.way_m += 5.0
    stage.surroundings = room()
    stage.step()
    stage.surroundings, stage.pose, stage.speed_mps = AHEAD, before, 0.0
    stage.said.clear()
    stage.manoeuvres(lambda stage: "backing out, try 1 of 1" in stage.said)


@pytest.mark.parametrize("wish", [None, Drive(0.0, 0.0), Drive(-0.5, 0.0)])
def test_a_driver_who_does_not_want_ahead_is_left_alone(wish):
    stage = Stage(AHEAD).drive_up()
    stage.manoeuvres(lambda stage: stage.speed_mps < 0.0)
    assert stage.step(wish) == NO_ADVICE
    assert stage.step(WAY).drive is None


def test_a_new_obstacle_ends_a_leg():
    stage = Stage(AHEAD).drive_up()
    stage.manoeuvres(lambda stage: stage.last.startswith("turning") and stage.speed_mps > 0.0)
    ahead = stage.pose.ahead(0.75)
    stage.surroundings = SegmentGeometry(np.array([*box(ahead.x_m, ahead.y_m, 0.3, 3.0, stage.pose.yaw_rad)]))
    before_m = stage.way_m
    stage.go(1.5)
    assert stage.way_m - before_m < 0.15
    assert stage.step().drive is None


def test_a_move_that_safety_refuses_is_not_planned_again(monkeypatch):
    """Something in the map's noise makes the search go where safety does not: the next way begins otherwise."""
    stage = Stage(AHEAD).drive_up()
    stage.manoeuvres(lambda stage: stage.last.startswith("backing") and stage.moves)
    first = stage.advice.drive
    judge = type(stage.assessment).judge

    def refuses(assessment, speed_mps, steering_rad, memory):
        verdict, memory = judge(assessment, speed_mps, steering_rad, memory)
        refused = speed_mps * first.speed_mps > 0 and steering_rad == first.steering_rad
        return replace(verdict, reverse_mps=0.0) if refused else verdict, memory

    monkeypatch.setattr(type(stage.assessment), "judge", refuses)
    stage.manoeuvres(
        lambda stage: stage.last.startswith(("backing", "turning")) and "try 2" in stage.last and stage.moves
    )
    second = stage.advice.drive
    assert (second.steering_rad, second.speed_mps > 0) != (first.steering_rad, first.speed_mps > 0)


def test_a_car_that_sees_nothing_is_not_boxed_in():
    """Safety says what is wrong; nothing plans a way out, and nothing talks of walls."""
    stage = Stage(AHEAD).drive_up()
    stage.surroundings = SegmentGeometry(np.array([[50.0, 50.0, 51.0, 50.0]]))
    stage.go(3.0)
    assert judged(stage.assessment, 1.0, 0.0).reason == "the lidar sees almost nothing: uncover or clean it"
    assert stage.said == []


def test_without_a_motor_report_nothing_is_begun():
    stage = Stage(AHEAD)
    stage.look()
    assert stage.recovery.step(stage.assessment, WAY, None) == NO_ADVICE


def test_what_can_wait_is_thought_once_for_each_scan():
    """Whether the answer's way leaves time for it or not, the same scans find the same way."""
    early, late = Stage(AHEAD).drive_up(), Stage(AHEAD).drive_up()
    for _ in range(round(6 / SCAN_S)):
        early.step()
        early.recovery.think()
        early.recovery.think()
        late.step()
    assert early.said == late.said
    assert early.pose == late.pose


def walk(stage, *places, mps=1.0):
    """Let a box of 0.3 m, a person or a vehicle, go along these places, (x, y) in base_link where the car stands."""
    here, at = stage.pose, complex(*places[0])
    for place in places[1:]:
        to = complex(*place)
        while abs(to - at) > mps * SCAN_S:
            at += (to - at) / abs(to - at) * mps * SCAN_S
            spot = here.ahead(at.real, at.imag)
            stage.surroundings = room((0.75, 0.0, 0.5, 0.3), (spot.x_m, spot.y_m, 0.3, 0.3))
            stage.step()


def test_does_not_back_while_what_came_up_may_stand_behind_unseen():
    stage = Stage(AHEAD).drive_up()
    at_m = stage.way_m
    walk(stage, (1.0, 2.0), (-0.5, 1.2), (-0.7, 0.0))
    since_s = stage.now_s
    stage.manoeuvres(lambda stage: stage.last == TRAFFIC, 5.0)
    stage.go(24.0)
    assert stage.way_m == at_m
    assert judged(stage.assessment, -0.4, 0.0).reverse_mps > 0, "safety does not know it"
    stage.surroundings = AHEAD  # it has gone the way it came, unseen
    stage.manoeuvres(free, 40.0)
    assert 25.0 < stage.now_s - since_s < 60.0, "the wait is bounded"


def test_what_stands_in_sight_after_it_moved_is_an_obstacle_like_any_other():
    stage = Stage(AHEAD).drive_up()
    walk(stage, (2.0, 2.5), (1.0, 1.5))
    since_s = stage.now_s
    stage.manoeuvres(lambda stage: stage.moves, 10.0)
    assert SETTLED_S - 0.5 < stage.now_s - since_s < SETTLED_S + 3.0


def test_does_not_set_about_it_while_something_passes():
    stage = Stage(AHEAD).drive_up()
    at_m = stage.way_m
    for _ in range(3):
        walk(stage, (-0.2, 1.5), (2.5, 1.5), (2.5, 2.5), (-0.2, 2.5))
    assert stage.way_m == at_m
    assert stage.said[-1] == TRAFFIC


def test_what_comes_up_while_the_car_backs_ends_the_manoeuvre():
    stage = Stage(AHEAD).drive_up()
    stage.manoeuvres(lambda stage: stage.speed_mps < 0.0)
    at_m = stage.way_m
    walk(stage, (1.5, 2.0), (-0.2, 2.0), mps=2.0)
    assert TRAFFIC in stage.said
    assert stage.speed_mps >= 0.0
    assert at_m - stage.way_m < 0.4


LANE = SegmentGeometry(np.array([*box(0.0, 0.0, 20.0, 2.2, 0.0)]))
NARROW = SegmentGeometry(np.array([*box(0.0, 0.0, 20.0, 1.0, 0.0)]))


def toward(stage, yaw_rad):
    """Return the bearing of a direction in the world; NaN where the car goes that way already."""
    off_rad = math.remainder(yaw_rad - stage.pose.yaw_rad, math.tau)
    return off_rad if abs(off_rad) > 1.0 else math.nan


@pytest.mark.parametrize("yaw_rad", [math.pi, -2.5, 1.6])
def test_a_car_that_goes_the_wrong_way_is_turned_without_a_touch(yaw_rad):
    stage = Stage(LANE)
    stage.go(1.0)
    for _ in range(1200):
        stage.step(toward_rad=toward(stage, yaw_rad))
        assert stage.clearance_m > 0.0
        if stage.advice == NO_ADVICE:
            break
    assert abs(math.remainder(yaw_rad - stage.pose.yaw_rad, math.tau)) < 0.8
    assert stage.said[0] == TURNS


def test_where_there_is_no_room_to_turn_it_goes_on_and_looks_again_after_some_metres():
    stage = Stage(NARROW)
    stage.go(1.0)
    for _ in range(800):
        stage.step(toward_rad=toward(stage, math.pi))
    assert stage.pose.x_m > 2.0
    assert stage.said == [TURNS]


def test_a_car_that_may_not_back_out_does_not_turn():
    stage = Stage(LANE, tries=0)
    assert {stage.step(toward_rad=math.pi) for _ in range(40)} == {NO_ADVICE}
