"""The way out: patience, a plan, a few tries, and plain words when there is none. On a rolling car without devices."""

from dataclasses import replace

import numpy as np
import pytest

from tests.runtime.control.recovery.stage import AHEAD, WAY, Stage, boxed_in, room
from tests.runtime.control.scans import SCAN_S
from tests.runtime.in_earnest import judged
from wallride.drivers.api import Drive
from wallride.runtime.control.recovery.traffic import SETTLED_S
from wallride.runtime.control.recovery.way_out import DISBELIEF, HELP, NO_ADVICE, TRAFFIC
from wallride.runtime.control.safety.swept import SweptGuard
from wallride.runtime.control.safety.swept_settings import SweptSettings
from wallride.runtime.control.vehicle import ServoCar
from wallride.sim.world.pose import Pose
from wallride.sim.world.segments import SegmentGeometry, box


def test_patience_first():
    stage = boxed_in()
    at_m = stage.way_m
    stage.go(1.8)
    assert stage.said == ["waiting for the way to clear"]
    assert stage.way_m == at_m


def test_a_person_who_walks_on_costs_no_manoeuvre():
    stage = boxed_in()
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


def test_a_leg_that_the_mux_does_not_let_drive_is_given_back_and_driven_once_it_does():
    stage = boxed_in()
    pose, at_m = stage.pose, stage.way_m
    stage.manoeuvres(lambda stage: stage.moves, most_s=6.0)
    for driven, seconds in ((False, 0.7), (True, 0.3), (False, 8.0)):  # the operator lets go, as the car has stopped
        stage.recovery.driven = driven
        for _ in range(round(seconds / SCAN_S)):
            stage.step()
            stage.way_m, stage.speed_mps, stage.pose = at_m, 0.0, pose
    waiting, backing = "waiting for the way to clear", "backing out, try 1 of 6"
    assert stage.said[:4] == [waiting, backing, waiting, backing]
    assert HELP not in stage.said
    stage.recovery.driven = True
    stage.manoeuvres(lambda stage: stage.clearance_m > 0.3)
    assert stage.said[-1].endswith("try 1 of 6")


def test_a_hand_that_backs_the_car_gives_the_tries_back():
    stage = boxed_in()
    stage.manoeuvres(lambda stage: stage.moves)
    assert stage.recovery._tries == 1
    stage.recovery.step(stage.assessment, None, None)
    stage.surroundings, stage.way_m = room(), stage.way_m - 2.1
    stage.step()
    assert stage.recovery._tries == 0


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
    assert wait(boxed_in(), monkeypatch, *[(0.5, True, 0.0), (0.125, False, 0.0)] * 3, (0.5, True, 0.0))


def test_patience_begins_anew_when_the_way_was_free_for_a_moment(monkeypatch):
    assert not wait(boxed_in(), monkeypatch, (1.8, True, 0.0), (0.35, False, 0.0), (1.0, True, 0.0))


def test_patience_begins_anew_when_the_car_got_going(monkeypatch):
    assert not wait(boxed_in(), monkeypatch, (1.8, True, 0.0), (0.1, False, 0.3), (1.0, True, 0.0))


def free(stage):
    """Whether the manoeuvre is over and the wheel handed back."""
    return stage.last.startswith("turning") and stage.step() == NO_ADVICE


def test_backs_out_turns_out_and_hands_the_wheel_back_without_a_touch():
    stage = boxed_in()
    least_m = stage.manoeuvres(free)
    assert stage.said[0] == "waiting for the way to clear"
    assert set(stage.said[1:]) == {"backing out, try 1 of 6", "turning out, try 1 of 6"}
    assert least_m > 0.02
    stage.go(2.0)
    assert stage.pose.x_m > 1.0 or abs(stage.pose.y_m) > 1.0  # past the box
    assert stage.step() == NO_ADVICE


def test_no_leg_counts_on_more_steering_than_the_servo_has_to_either_side():
    stage = Stage(AHEAD)
    stage.guard = SweptGuard(SweptSettings(), ServoCar(servo_ends_rad=(-0.2, 0.3)))
    stage.drive_up()
    asked_rad = set()
    while not free(stage):
        advice = stage.step()
        if advice.drive is not None:
            asked_rad.add(abs(advice.drive.steering_rad))
    assert max(asked_rad) == 0.2


def test_wheels_turn_before_the_car_moves():
    stage = boxed_in()
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
    stage = boxed_in()
    at_m = stage.way_m
    for _ in range(round(8 / SCAN_S)):
        stage.step(believed=False)
    assert stage.said == [DISBELIEF]
    assert stage.way_m == at_m


def test_odometry_that_ceases_to_be_believed_ends_a_manoeuvre():
    stage = boxed_in()
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
    stage = boxed_in()
    stage.manoeuvres(lambda stage: stage.speed_mps < 0.0)
    assert stage.step(wish) == NO_ADVICE
    assert stage.step(WAY).drive is None


def test_a_new_obstacle_ends_a_leg():
    stage = boxed_in()
    stage.manoeuvres(lambda stage: stage.last.startswith("turning") and stage.speed_mps > 0.0)
    ahead = stage.pose.ahead(0.75)
    stage.surroundings = SegmentGeometry(np.array([*box(ahead.x_m, ahead.y_m, 0.3, 3.0, stage.pose.yaw_rad)]))
    before_m = stage.way_m
    stage.go(1.5)
    assert stage.way_m - before_m < 0.15
    assert stage.step().drive is None


def test_a_move_that_safety_refuses_is_not_planned_again(monkeypatch):
    """Something in the map's noise makes the search go where safety does not: the next way begins otherwise."""
    stage = boxed_in()
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
    stage = boxed_in()
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
    early, late = boxed_in(), boxed_in()
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
    stage = boxed_in()
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
    stage = boxed_in()
    walk(stage, (2.0, 2.5), (1.0, 1.5))
    since_s = stage.now_s
    stage.manoeuvres(lambda stage: stage.moves, 10.0)
    assert SETTLED_S - 0.5 < stage.now_s - since_s < SETTLED_S + 3.0


def test_does_not_set_about_it_while_something_passes():
    stage = boxed_in()
    at_m = stage.way_m
    for _ in range(3):
        walk(stage, (-0.2, 1.5), (2.5, 1.5), (2.5, 2.5), (-0.2, 2.5))
    assert stage.way_m == at_m
    assert stage.said[-1] == TRAFFIC


def test_what_comes_up_while_the_car_backs_ends_the_manoeuvre():
    stage = boxed_in()
    stage.manoeuvres(lambda stage: stage.speed_mps < 0.0)
    at_m = stage.way_m
    walk(stage, (1.5, 2.0), (-0.2, 2.0), mps=2.0)
    assert TRAFFIC in stage.said
    assert stage.speed_mps >= 0.0
    assert at_m - stage.way_m < 0.4
