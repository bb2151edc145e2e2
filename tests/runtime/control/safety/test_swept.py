"""The swept safety: the path, the allowed speed, bends, and the form of its answers."""

import math

import numpy as np
import pytest

from tests.runtime.control.safety.swept_scenes import FRONT_M, REACTION_S, Car, judge, wall_at, world
from tests.runtime.in_earnest import judged
from wallride.runtime.control.safety import swept_path
from wallride.runtime.control.safety.footprint import contact_on_arc
from wallride.runtime.control.safety.stopping import speed_to_stop_within_mps, stopping_distance_m
from wallride.runtime.control.safety.swept_path import Strip
from wallride.runtime.control.vehicle import GRAVITY_MPS2, CarSettings

GRADED_MPS2 = 0.45 * 0.8 * GRAVITY_MPS2


def test_a_straight_path_meets_a_wall_at_its_bumper_to_the_centimetre():
    for x_m in (0.6, 0.73, 1.1, 1.5):
        contact = Car().look(world(wall_at(x_m))).strip.contact(0.0, 3.0)
        assert contact.travel_m == pytest.approx(x_m - FRONT_M, abs=0.011)
        assert contact.aside_m == 0


@pytest.mark.parametrize("sign", [1, -1])
def test_a_wall_beside_is_not_in_the_way_and_is_when_steering_toward_it(sign):
    beside = world((-2, sign * 0.3, 6, sign * 0.3))
    assert judge(beside, 1.0).forward_mps == math.inf
    assert judge(beside, 1.0, -sign * 0.1).forward_mps == math.inf
    assert judge(beside, 1.0, sign * 0.34).forward_mps < 1.0


def test_the_margin_is_four_centimetres_aside():
    assert judge(world((1, 0.175, 1, 0.6)), 4.0).forward_mps < 4.0
    assert judge(world((1, 0.2, 1, 0.6)), 4.0).forward_mps == math.inf


def test_a_three_beam_pole_stops_the_car_and_two_beams_do_not():
    for beams, seen in ((3, True), (2, False)):
        ranges_m = world()
        ranges_m[540 : 540 + beams] = 1.0
        assert (judge(ranges_m, 4.0).forward_mps < 4.0) == seen


def test_what_stands_beside_the_car_stops_its_tail_beside_a_cable_too():
    """A post at the right flank, which the car has passed: it may go straight on, but not turn its flank into it."""
    car = Car()
    for x_m in np.arange(0.6, 0.15, -0.02):
        ranges_m = world((x_m, -0.2, x_m - 0.04, -0.2))
        ranges_m[7:19] = 0.07
        assessment = car.look(ranges_m, speed_mps=0.8, wheel_rad=-0.34 * (x_m < 0.17), moved_m=0.02)
    assert judged(assessment, 1.0, 0.0).forward_mps == math.inf
    assert judged(assessment, 1.0, -0.34).forward_mps < 1.0


def test_grip_widens_the_path():
    fast = Car().look(world((2.0, 1.2, 2.0, -6)), 4.0, wheel_rad=-0.34)
    slow = Car().look(world((2.0, 1.2, 2.0, -6)), 1.0, wheel_rad=-0.34)
    assert fast.strip.contact(-0.34, 3.0).travel_m < 2.5
    assert slow.strip.contact(-0.34, 2.0).travel_m == math.inf


def test_a_bend_that_needs_good_grip_is_judged_on_a_slippery_floor_too():
    corner = world((3.0, -6.0, 3.0, 6.0))
    hasty = Car(slippery_mu=0.5).look(corner, speed_mps=4.0, wheel_rad=0.3).strip.contact(0.3, 6.0)
    trusting = Car(slippery_mu=0.8).look(corner, speed_mps=4.0, wheel_rad=0.3).strip.contact(0.3, 6.0)
    assert hasty.slippery
    assert hasty.travel_m < trusting.travel_m
    gentle = Car().look(corner, speed_mps=2.0, wheel_rad=0.3).strip.contact(0.3, 6.0)
    assert not gentle.slippery


def test_the_graded_limit_stops_ten_centimetres_before_the_wall():
    for way_m in (0.4, 0.8, 1.5):
        verdict = judge(world(wall_at(FRONT_M + way_m)), 4.0)
        expected_mps = speed_to_stop_within_mps(verdict.measure - 0.10, REACTION_S, GRADED_MPS2)
        assert verdict.measure == pytest.approx(way_m, abs=0.012)
        assert verdict.forward_mps == pytest.approx(expected_mps)
        assert verdict.reason == "slower: wall ahead"
        assert verdict.reverse_mps == math.inf


def test_what_is_beyond_the_stopping_distance_limits_nothing():
    verdict = judge(world(wall_at(4.5)), 4.0, speed_mps=4.0)
    assert (verdict.forward_mps, verdict.reason) == (math.inf, "clear")


def test_it_looks_as_far_as_the_wish_needs_not_only_the_present_speed():
    assert judge(world(wall_at(2.5)), 4.0, speed_mps=0.0).forward_mps < 4.0


@pytest.mark.parametrize("speed_mps", [1.0, 2.0, 3.0, 4.0])
def test_the_hard_stop_begins_at_the_stopping_distance(speed_mps):
    hard_m = 0.05 + stopping_distance_m(speed_mps, REACTION_S, 0.8 * 0.8 * GRAVITY_MPS2)
    before = judge(world(wall_at(FRONT_M + hard_m + 0.02)), speed_mps, speed_mps=speed_mps)
    assert before.reason == "slower: wall ahead"
    after = judge(world(wall_at(FRONT_M + hard_m - 0.02)), speed_mps, speed_mps=speed_mps)
    assert (after.forward_mps, after.reason, after.brake_mps2) == (0.0, "braking: wall ahead", math.inf)


@pytest.mark.parametrize("speed_mps", [60.0, 2e3, 1e7, 1e150])
def test_no_look_goes_beyond_the_lidars_range(speed_mps, monkeypatch):
    lengths_m = []
    contact = Strip.contact

    def noted(self, steering_rad, length_m, *rest, **more):
        lengths_m.append(length_m)
        return contact(self, steering_rad, length_m, *rest, **more)

    monkeypatch.setattr(Strip, "contact", noted)
    assert judge(world(), 4.0, 0.1, speed_mps=speed_mps).forward_mps >= 0
    assert max(lengths_m) == 30.0


def test_the_age_of_the_scan_lengthens_the_distance():
    ranges_m = world(wall_at(FRONT_M + 0.6))
    assert judge(ranges_m, 2.0, speed_mps=2.0, age_s=0.0).forward_mps > 0
    assert judge(ranges_m, 2.0, speed_mps=2.0, age_s=0.09).forward_mps == 0.0


def test_with_a_clock_the_age_is_that_of_the_moment():
    now = [0.0]
    car = Car(clock=lambda: now[0])
    now[0] = car.now_s + 0.025
    assessment = car.look(world(wall_at(FRONT_M + 0.6)), speed_mps=2.0)
    assert judged(assessment, 2.0, 0.0).forward_mps > 0
    now[0] += 0.09
    assert judged(assessment, 2.0, 0.0).forward_mps == 0.0


def test_late_scans_slow_and_stale_scans_stop():
    assert judge(world(), 3.0, age_s=0.09).forward_mps == math.inf
    late = judge(world(), 3.0, age_s=0.11)
    assert (late.forward_mps, late.reason) == (1.0, "the scan is late")
    for wanted_mps in (1.0, -0.3, 0.0):
        stale = judge(world(), wanted_mps, age_s=0.26)
        assert (stale.forward_mps, stale.reverse_mps, stale.reason) == (0.0, 0.0, "the scan is too old")


def test_locked_wheels_are_not_a_standing_car():
    car = Car()
    ranges_m = world(wall_at(FRONT_M + 0.5))
    car.look(ranges_m, speed_mps=3.0)
    assert judged(car.look(ranges_m, speed_mps=0.0), 3.0, 0.0).reason == "braking: wall ahead"


OUTER_WALL = ((-2.0, -0.6, 2.4, -0.6), (2.4, -0.6, 2.4, 8.0))


def test_no_gain_of_speed_that_would_carry_the_car_out_of_its_bend():
    """Speeding up takes grip that turning needs, and the faster car needs more of it."""
    assessment = Car().look(world(*OUTER_WALL), speed_mps=1.6, wheel_rad=0.3)
    holding, gaining = judged(assessment, 1.6, 0.3), judged(assessment, 4.0, 0.3)
    assert holding.forward_mps == math.inf
    assert gaining.reason == "no faster in this bend"
    assert 1.6 <= gaining.forward_mps < 4.0
    nearer = world((-2.0, -0.6, 1.4, -0.6), (1.4, -0.6, 1.4, 8.0))
    fast = judged(Car().look(nearer, speed_mps=2.0, wheel_rad=0.3), 4.0, 0.3)
    assert (fast.forward_mps, fast.reason) == (2.0, "no faster in this bend")  # and no slower: holding it passes
    open_floor = Car().look(world(), speed_mps=1.6, wheel_rad=0.3)
    assert judged(open_floor, 2.8, 0.3).forward_mps == math.inf


@pytest.mark.parametrize("speed_mps", [1.6, 3.5])
def test_nor_of_speed_at_which_the_tyres_cannot_hold_the_bend(speed_mps):
    """Where it slides, its way is not the one that is judged; it is not braked for that either."""
    verdict = judged(Car().look(world(), speed_mps=speed_mps, wheel_rad=0.3), 4.0, 0.3)
    bend_mps = math.sqrt(0.8 * GRAVITY_MPS2 * CarSettings().wheelbase_m / math.tan(0.3))
    assert verdict.reason == "no faster in this bend"
    assert verdict.forward_mps == pytest.approx(max(speed_mps, bend_mps), rel=0.01)


BESIDE_THE_BEND = (1.2, 0.4, 1.23, 0.3)
"""A leg just outside of the arc of a car that keeps its speed."""


def test_nor_of_speed_that_takes_the_grip_that_the_bend_needs_on_a_slippery_floor():
    """Neither the bend nor the gain needs more than 0.5 g, but both together do (Kamm)."""
    assessment = Car().look(world(BESIDE_THE_BEND), speed_mps=1.5, wheel_rad=0.3)
    assert judged(assessment, 1.5, 0.3).forward_mps == math.inf
    assert judged(assessment, 1.8, 0.3).forward_mps == math.inf
    assert judged(assessment, 2.1, 0.3).reason == "no faster in this bend"
    assert 1.5 < judged(assessment, 2.1, 0.3).forward_mps < 1.8


def test_nor_where_something_farther_on_lets_it_go_faster():
    scan = world(BESIDE_THE_BEND, (-2.0, 1.0, 4.0, 1.0))
    assessment = Car().look(scan, speed_mps=1.5, wheel_rad=0.3)
    farther = judged(Car().look(world((-2.0, 1.0, 4.0, 1.0)), speed_mps=1.5, wheel_rad=0.3), 2.1, 0.3)
    assert farther.reason == "slower: wall ahead"
    assert farther.forward_mps > 2.1
    assert judged(assessment, 2.1, 0.3).reason == "no faster in this bend"


def test_at_an_edge_noise_does_not_let_a_fast_car_go_again():
    just_outside = world((2.0, 0.20, 2.0, 0.5))
    assert judge(just_outside, 4.0, speed_mps=3.0).forward_mps == math.inf
    car = Car()
    assert judged(car.look(world((2.0, 0.16, 2.0, 0.5)), speed_mps=3.0), 4.0, 0.0).forward_mps < 4.0
    assert judged(car.look(just_outside, speed_mps=3.0), 4.0, 0.0).forward_mps < 4.0
    assert judged(car.look(world((2.0, 0.25, 2.0, 0.5)), speed_mps=3.0), 4.0, 0.0).forward_mps == math.inf
    car.now_s += 0.3
    assert judged(car.look(just_outside, speed_mps=3.0), 4.0, 0.0).forward_mps == math.inf


def test_a_slow_car_keeps_its_narrow_margins():
    car = Car()
    judged(car.look(world((2.0, 0.16, 2.0, 0.5)), speed_mps=3.0), 4.0, 0.0)
    car.now_s += 0.22  # time to brake, but not to forget
    assert judged(car.look(world((0.8, 0.20, 0.8, 0.5)), speed_mps=0.9), 0.9, 0.0).forward_mps == math.inf


def test_all_questions_about_one_scan_get_the_same_answer():
    car = Car()
    car.look(world((2.0, 0.16, 2.0, 0.5)), speed_mps=3.0)
    assessment = car.look(world((2.0, 0.16, 2.0, 0.5)), speed_mps=3.0)
    first = judged(assessment, 4.0, 0.0)
    assert [judged(assessment, 4.0, 0.0) for _ in range(3)] == [first] * 3


@pytest.mark.parametrize("nonsense", [(math.nan, 0.0), (1.0, math.nan), (math.inf, 0.0)])
def test_nonsense_is_not_judged(nonsense):
    assert judge(world(wall_at(0.5)), *nonsense).reason == "window clean"


def test_standing_needs_no_consent_and_starts_no_hold():
    car = Car()
    assessment = car.look(world(wall_at(FRONT_M + 0.1)), speed_mps=2.0)
    assert judged(assessment, 0.0, 0.0).forward_mps == math.inf
    assert not car.guard.memory.braking


def test_without_a_motor_report_it_still_looks():
    assert judged(Car().look(world(wall_at(FRONT_M + 0.3)), motor=False), 2.0, 0.0).forward_mps < 2.0


def test_the_same_question_is_swept_once(monkeypatch):
    sweeps = []

    def sweep(*given_):
        sweeps.append(given_)
        return contact_on_arc(*given_)

    monkeypatch.setattr(swept_path, "contact_on_arc", sweep)
    assessment = Car().look(world(wall_at(1.5)))
    first = judged(assessment, 1.51, 0.1)
    asked = len(sweeps)
    assert asked > 0
    assert judged(assessment, 1.6, 0.1) == first
    assert len(sweeps) == asked
    assert assessment.strip.contact(0.1, 2.0) is assessment.strip.contact(0.1, 2.0)
    assert assessment.strip.contact(0.1, 2.0).travel_m < 2.0
    asked = len(sweeps)
    judged(assessment, 1.6, 0.2)
    assert len(sweeps) == asked + 1
