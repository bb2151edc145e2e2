"""A promised path is judged in place of the arc, if it is believed; no source is trusted."""

import math
from dataclasses import replace
from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest

from tests.runtime.control.safety.promise_scenes import (
    BESIDE,
    OPEN,
    PERIOD_S,
    SLIP_RAD_PER_MPS2,
    SPEED_MPS,
    Promising,
    by_arc,
    changed,
    judged,
    promise_of,
    way,
)
from tests.runtime.control.safety.swept_scenes import wall_at, world
from wallride.drivers.api import Drive, Scan
from wallride.runtime.arbitration.command import DriveCommand, Source, SpeedLimit, Verdict, arbitrate
from wallride.runtime.control.guidance import Guidance
from wallride.runtime.control.own_laws.guard import CappedAssessment
from wallride.runtime.control.perception.motion.scan_matching import ScanPose
from wallride.runtime.control.recovery.recovering_follower import RecoveringFollower
from wallride.runtime.control.recovery.way_out import RecoveryAdvice
from wallride.runtime.control.safety import promise_judgement, promise_record, promised_way
from wallride.runtime.control.safety.promise_record import LEAST_MARGIN_M, NO_PROMISES
from wallride.runtime.control.tyres import eased_mps
from wallride.runtime.live_stack import LiveStack
from wallride.runtime.recording.decision_log import DecisionLog
from wallride.runtime.settings.tree import load_settings


def test_a_kept_promise_is_judged_in_place_of_the_arc():
    car = Promising()
    promised, plain = judged(car, BESIDE, promise_of)
    assert plain.forward_mps < SPEED_MPS - 0.1
    assert plain.reason.startswith(("slower: wall", "braking"))
    assert promised.forward_mps >= SPEED_MPS
    assert not car.record.reason


def test_a_source_is_judged_by_its_arc_until_it_has_kept_promises():
    for scans in (0, 1, 12, 18):
        promised, plain = judged(Promising(scans), BESIDE, promise_of)
        assert promised == plain


def test_without_a_promise_nothing_is_remembered():
    car = Promising()
    judged(car, OPEN, lambda _: None)
    assert car.record is NO_PROMISES


def test_a_command_that_leads_elsewhere_is_judged_by_its_arc():
    car = Promising()
    promised, plain = judged(car, BESIDE, promise_of, steering_rad=-0.34)
    assert car.record.reason == promise_judgement.OTHER_COMMAND
    assert promised == plain


@pytest.mark.parametrize(
    ("bend_per_m", "further_rad", "elsewhere"),
    [(0.3, 0.14, False), (-0.3, -0.14, False), (0.0, 0.14, True), (0.3, 0.16, True)],
)
def test_front_tyres_that_slip_more_than_the_rear_ones_lead_nowhere_else(bend_per_m, further_rad, elsewhere):
    steering_rad = math.atan(0.33 * bend_per_m) + further_rad
    grip_mps2 = 0.8 * 9.81
    car = promised_way.Roadworthy(3.0, steering_rad, 0.05, 3.2, 0.33, 0.34, grip_mps2, SLIP_RAD_PER_MPS2, 4.0)
    places_m = way(9.0, bend_per_m)[0] * np.exp(-9j * SLIP_RAD_PER_MPS2 * bend_per_m)
    driven: Any = promised_way.way_of(
        places_m, np.full(places_m.size, 3.0), car._replace(wheel_rad=0.3 * bend_per_m), 3.0
    )
    assert promise_judgement._leads_elsewhere(driven, car, steering_rad, 0.0) is elsewhere


def test_before_a_place_without_room_to_brake_it_brakes_the_less_the_more_the_bend_takes():
    def limit_mps(left):
        one, unused = np.ones(1), cast("Any", None)
        judged_way = promise_judgement.JudgedWay(unused, 0.0, unused, unused, 0.0, 2.0 * one, 2.0 * one, left * one)
        return judged_way.limit(Promising(1).guard.body, 0.1).forward_mps

    assert limit_mps(1.0) == pytest.approx(math.sqrt(0.353**2 + 2.0 * 3.53 * 2.0 + 4.0) - 0.353, abs=0.01)
    assert limit_mps(0.5) == pytest.approx(math.sqrt(0.177**2 + 2.0 * 1.77 * 2.0 + 4.0) - 0.177, abs=0.01)


def test_a_command_that_is_faster_than_promised_is_judged_by_its_arc():
    car = Promising()
    assessment = car.see(BESIDE)
    plain = by_arc(assessment, car.guard.memory, 5.0, car.wheel_rad)
    assert car.told(assessment, promise_of(car.now_s), speed_mps=5.0) == plain
    assert car.record.reason == promise_judgement.TOO_FAST


def test_a_source_that_leaves_its_path_is_judged_by_its_arc_until_it_has_kept_others():
    car = Promising()
    for number in range(14):
        before = car.record
        car.drive(OPEN, 2.0 - number * PERIOD_S * SPEED_MPS, wheel_rad=0.0)
        if car.record.reason:
            break
    assert before.refused == 0
    assert car.record.reason in {promise_record.LEFT, promise_record.TAKEN_BACK}
    for number in range(15):
        promised, plain = judged(car, BESIDE, lambda stamp_s, n=number: promise_of(stamp_s, 2.0 - n * 0.075))
        assert promised == plain


def test_a_turn_that_is_put_off_again_and_again_is_no_promise():
    car, taken_back = Promising(), 0
    for _ in range(20):
        car.drive(OPEN, 1.5)
        taken_back += car.record.reason == promise_record.TAKEN_BACK
    assert taken_back >= 1
    promised, plain = judged(car, BESIDE, lambda stamp_s: promise_of(stamp_s, 1.5))
    assert promised == plain


def test_paths_that_alternate_are_no_promise():
    car = Promising()
    for number in range(8):
        car.drive(OPEN, 3.0 * (number % 2))
        assert not car.record.trusts(car.guard.assessment.percept.motion.here) or number == 0
    assert car.record.reason == promise_record.TAKEN_BACK


def test_a_place_that_a_scan_corrects_takes_no_promise_back():
    car = Promising(scans=1, ends_m=3.0)
    matched = car.guard.perception.matched
    at_m, yaw_rad = matched._here.pose
    matched._here, matched._key = matched._here.at(ScanPose(at_m + 0.1j, yaw_rad + 0.2)), None
    for number in range(4):
        car.drive(OPEN, 3.0 - number * PERIOD_S * SPEED_MPS)
        assert not car.record.reason
        assert len(car.record.given) > 1


def test_after_locked_wheels_the_odometry_tells_nothing_of_a_promise():
    car = Promising()
    car.drive(OPEN, 0.2, speed_mps=0.0)
    car.drive(OPEN, 0.1, speed_mps=0.0)
    assert car.record.reason == promise_judgement.SLID


def test_a_promise_through_a_wall_stops_the_car_before_the_wall():
    for ahead_m in (0.9, 1.3, 2.0, 3.0):
        car = Promising(bend_per_m=0.001)
        assessment = car.see(world(wall_at(ahead_m)))
        plain = by_arc(assessment, car.guard.memory, SPEED_MPS, car.wheel_rad)
        promised = car.told(assessment, promise_of(car.now_s, bend_per_m=0.001))
        assert promised.forward_mps <= plain.forward_mps + 0.05


def test_room_for_a_full_brake_bounds_the_speed_of_a_promise_that_turns_away():
    car = Promising(ends_m=1.0)
    verdict = car.told(car.see(world((1.15, -1.0, 1.15, -0.1))), promise_of(car.now_s, 1.0))
    assert not car.record.reason
    assert verdict.reason == "slower: a full brake needs the room"
    assert 1.0 < verdict.forward_mps < SPEED_MPS


def test_a_full_brake_that_would_hit_hard_is_no_promise():
    car = Promising(ends_m=1.0)
    car.told(car.see(world((0.62, -1.0, 0.62, -0.1))), promise_of(car.now_s, 1.0))
    assert car.record.reason == promise_judgement.NO_BRAKING


def test_what_hides_the_path_bounds_the_speed():
    for pillar, hidden in ((world((0.75, 0.9, 1.3, 0.75)), True), (OPEN, False)):
        car = Promising(ends_m=3.0)
        verdict = car.told(car.see(pillar), promise_of(car.now_s, 3.0), speed_mps=3.4)
        assert not car.record.reason
        assert (verdict.reason == promise_judgement.HIDDEN) == hidden


def test_the_margin_is_what_the_source_has_kept_and_never_less_than_the_laws_own():
    car = Promising()
    assert car.record.given[-1].margin_m == LEAST_MARGIN_M
    assert car.record._replace(off_m=0.2).margin_m(0.0) > 0.2
    assert car.record.margin_m(0.3) == 0.3


def test_what_is_beside_the_path_is_swept_with_the_margin():
    for margin_m, free in ((0.02, True), (0.3, False)):
        car = Promising(bend_per_m=0.001)
        beside = world((1.0, 0.3, 6.0, 0.3))
        verdict = car.told(car.see(beside), promise_of(car.now_s, bend_per_m=0.001, margin_m=margin_m))
        assert (verdict.forward_mps >= SPEED_MPS) == free


@pytest.mark.parametrize(("begins_m", "aside_m", "slows", "stops"), [
    (0.7, 0.36, True, False), (0.7, 0.25, True, True), (1.7, 0.36, True, False), (0.7, 0.5, False, False)
])  # fmt: skip
def test_a_car_brakes_at_full_for_half_of_a_margin_and_slows_down_for_all_of_it(begins_m, aside_m, slows, stops):
    car = Promising(bend_per_m=0.001)
    beside = world((begins_m, aside_m, begins_m + 4.0, aside_m))
    verdict = car.told(car.see(beside), promise_of(car.now_s, bend_per_m=0.001, margin_m=0.3))
    assert not car.record.reason
    assert (verdict.forward_mps < SPEED_MPS, verdict.forward_mps == 0.0) == (slows, stops)


@pytest.mark.parametrize(("turn_radps", "slower_mps"), [
    (0.0, math.inf), (0.9, math.inf), (1.1, 0.29), (-1.1, 0.29), (1.6, 0.18), (2.4, 0.26), (math.nan, math.inf)
])  # fmt: skip
def test_in_a_bend_a_limit_slows_down_by_what_the_bend_leaves_of_the_grip(turn_radps, slower_mps):
    """A motor obeys 0.3 m/s at once: on a floor of 0.5 the car that turns at 1.1 rad/s then spins."""
    least_mps = eased_mps(3.0, 3.0 * turn_radps, max(4.9, 1.1 * abs(3.0 * turn_radps)))
    assert least_mps == pytest.approx(3.0 - slower_mps, abs=0.01)


@pytest.mark.parametrize(("margin_m", "aside_m", "limit_mps"), [(0.3, 0.45, (2.8, 3.0)), (0.45, 0.36, (-0.1, 2.8))])
def test_only_what_is_beside_a_promise_by_more_than_half_of_its_margin_slows_it_down_by_that(
    margin_m, aside_m, limit_mps
):
    """In the outer half the car passes if it keeps to its path; within the other one it may have to stop."""
    car, beside = Promising(), world((0.6, aside_m, 6.0, aside_m))
    promised, plain = judged(car, beside, lambda stamp_s: promise_of(stamp_s, margin_m=margin_m))
    assert not car.record.reason
    assert limit_mps[0] < promised.forward_mps < limit_mps[1]
    assert plain.forward_mps < 2.5


def test_what_hides_the_way_bounds_the_speed_in_a_bend_as_on_a_straight():
    """That limit is the last one before a stop is too long, and no hard stop stands behind it."""
    one, unused = np.ones(1), cast("Any", None)
    hidden = promise_judgement.JudgedWay(unused, 0.0, unused, unused, 0.0, 2.0 * one, 0.0 * one, one, 6.0)
    assert hidden.limit(Promising(1).guard.body, 0.1).forward_mps < 4.5


def way_in(car, ranges_m, promise):
    """Return a scan's assessment and the believed way of a promise."""
    assessment = car.see(ranges_m)
    command, memory = (SPEED_MPS, car.wheel_rad), car.guard.memory
    way, _ = promise_judgement.believed(
        assessment.percept, assessment.strip, command, promise(car.now_s), memory.promises, 4.0
    )
    assert way is not None
    return assessment, way


@pytest.mark.parametrize("honest", [True, False])
def test_a_promise_is_judged_once_for_a_scan_and_its_command(monkeypatch, honest):
    car, asked = Promising(), list[float]()

    def asking(places_m, speed_mps, roadworthy, look_m):
        asked.append(look_m)
        return promised_way.way_of(places_m, speed_mps, roadworthy, look_m)

    monkeypatch.setattr(promise_judgement, "way_of", asking)
    assessment = car.see(BESIDE)
    promise = (
        promise_of(car.now_s) if honest else changed(lambda path_m: path_m[:, ::8], lambda mps: mps[::8])(car.now_s)
    )
    first = car.told(assessment, promise)
    assert [car.told(assessment, promise) for _ in range(4)] == [first] * 4
    assert len(asked) == 1
    car.told(assessment, promise, speed_mps=2.5)
    car.told(assessment, replace(promise, margin_m=0.03))
    assert len(asked) == 3


def test_what_was_judged_before_changes_no_verdict():
    rng = np.random.default_rng(54)
    for _ in range(6):
        car = Promising()
        assessment = car.see(BESIDE)
        promises = [promise_of(car.now_s), promise_of(car.now_s, 0.3), changed(margin_m=0.3)(car.now_s), None]
        promises.append(promise_of(car.now_s - PERIOD_S))
        for _ in range(25):
            promise, speed_mps = promises[rng.integers(5)], float(rng.choice((2.5, SPEED_MPS, 5.0)))
            steering_rad = car.wheel_rad + float(rng.choice((0.0, 0.02, -0.3)))
            new = replace(assessment, strip=replace(assessment.strip, judged=None, _kept={}, _dark={}))
            expected = new.judge(speed_mps, steering_rad, assessment.memory, promise)
            found = assessment.judge(speed_mps, steering_rad, assessment.memory, promise)
            assert found[0] == expected[0]
            assert found[1].promises._replace(given=()) == expected[1].promises._replace(given=())
            if rng.random() < 0.5:
                assessment.commit(found[1])


def test_a_bend_that_needs_all_of_the_grip_bounds_the_speed_there():
    _, way = way_in(Promising(ends_m=3.0), OPEN, lambda stamp_s: promise_of(stamp_s, 3.0, speed_mps=4.3))
    assert way.cap_mps.size
    assert way.cap_mps.min() == pytest.approx(math.sqrt(7.848 / 0.5), abs=0.1)


@pytest.mark.parametrize("beside", [True, False])
def test_while_the_car_brakes_both_its_promise_and_its_arc_have_to_be_free(beside):
    car = Promising(ends_m=0.0 if beside else 3.0)
    ranges_m = world((0.4, 0.55, 6.0, 0.55)) if beside else OPEN
    assessment = car.see(ranges_m)
    far = promise_of(car.now_s, 0.0 if beside else 3.0)
    way, record = promise_judgement.believed(
        assessment.percept, assessment.strip, (SPEED_MPS, car.wheel_rad), far, car.guard.memory.promises, 4.0
    )
    assert way is not None
    if not beside:
        way.found = replace(way.found, travel_m=0.2)
    braking = car.guard.memory._replace(braking=True, promises=record)
    found = assessment._found(car.wheel_rad, 4.0, braking, way)
    assert found.travel_m == (assessment.strip.contact(car.wheel_rad, 4.0).travel_m if beside else 0.2)
    assert assessment._found(car.wheel_rad, 4.0, braking._replace(braking=False), way) is way.found


def test_what_is_not_seen_bounds_a_promise_where_its_path_leads():
    assessment, way = way_in(Promising(ends_m=3.0), OPEN, lambda stamp_s: promise_of(stamp_s, 3.0))
    on_path_m = np.array([0.9 + 0.1j + 0.01j * number for number in range(20)])
    nothing = np.empty(0, np.complex128)
    unknown = SimpleNamespace(hard=on_path_m, soft=nothing, doubted=nothing, blind=False)
    percept = replace(assessment.percept, visibility=SimpleNamespace(unknown=lambda: unknown))
    verdict = replace(assessment, percept=percept)._unseen(SPEED_MPS, -0.34, 0.05, way)
    assert verdict.forward_mps == 0.0


def test_a_dark_region_where_the_promise_leads_bounds_the_speed(monkeypatch):
    assessment, way = way_in(Promising(ends_m=3.0), OPEN, lambda stamp_s: promise_of(stamp_s, 3.0))
    asked = []

    def is_dark(_strip, toward_rad, _look_m):
        asked.append(toward_rad)
        return True

    monkeypatch.setattr(type(assessment.strip), "is_dark", is_dark)
    assert assessment._no_contact(0.0, 4.0, SPEED_MPS, 0.05, way).reason == "no information ahead"
    assert asked == [way.toward_rad]
    assert 0.2 < way.toward_rad < 0.8


class Asked:
    """An assessment that keeps the promise that it is asked about."""

    def __init__(self):
        self.memory, self.promises = None, []

    def judge(self, _speed_mps, _steering_rad, memory, promise=None):
        self.promises.append(promise)
        return Verdict(math.inf, math.inf, "clear"), memory


def test_a_promise_comes_with_its_command_to_safety():
    promise = promise_of(1.0)
    asked: Any = Asked()
    word = DriveCommand(Source.NAVIGATION, Drive(1.0, 0.0), 1.0, "wall", promise=promise)
    arbitrate([SpeedLimit(Source.SAFETY, asked, 1.0), word], frozenset(), [Source.SAFETY, Source.NAVIGATION])
    assert asked.promises == [promise]
    capped = CappedAssessment(asked, Verdict(1.0, 1.0, "mine"))
    capped.judge(1.0, 0.0, asked.memory, promise)
    assert asked.promises == [promise, promise]


def test_a_way_out_is_driven_without_the_followers_promise():
    promise = promise_of(1.0)
    scan: Any = SimpleNamespace()
    answer = Guidance(Drive(1.0, 0.0), math.nan, math.nan, math.nan, "wall", promise=promise)
    guard: Any = SimpleNamespace(assessment=SimpleNamespace(view=SimpleNamespace(scan=scan)))
    for backs, expected in ((Drive(-0.4, 0.0), None), (None, promise)):
        recovery: Any = SimpleNamespace(
            step=lambda *_, backs=backs, **__: RecoveryAdvice(backs, "looking for a way out")
        )
        one = RecoveringFollower(SimpleNamespace(follow=lambda *_: answer), guard, recovery)
        assert one.follow(scan, None).promise is expected


def test_the_promise_of_a_followers_answer_is_its_commands():
    stack: Any = LiveStack(load_settings(None, []), DecisionLog(lambda: 0.1, 0))
    promise = promise_of(0.1)
    answer = Guidance(Drive(1.0, 0.0), math.nan, math.nan, math.nan, "wall", promise=promise)
    stack.laws = SimpleNamespace(follow=lambda *_: answer)
    stack.follow(Scan(0.1, 0.1, -1.0, 0.1, 0.02, 30.0, np.ones(20, np.float32), 0), None)
    (word,) = stack.queue.sweep()
    assert word.promise is promise
