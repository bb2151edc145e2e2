"""Safety `swept`, rule by rule: what is in the strip, how fast is safe, when it brakes, releases, creeps, backs."""

import math

import numpy as np
import pytest

from drivers.api import MotorState, Scan
from runtime.control.perception.view import PerceptionCache
from runtime.control.safety.no_return_regions import enclosed_dark
from runtime.control.safety.stopping import GRAVITY_MPS2, speed_to_stop_within_mps, stopping_distance_m
from runtime.control.safety.swept import SweptGuard
from runtime.control.safety.swept_path import Strip
from runtime.control.safety.swept_settings import SweptSettings
from runtime.control.vehicle import CarSettings

BEAMS = 1081
STEP_RAD = math.radians(0.25)
BEARING_RAD = STEP_RAD * (np.arange(BEAMS) - BEAMS // 2)
CAR = CarSettings()
SETTINGS = SweptSettings()
GRADED_MPS2 = 0.45 * 0.8 * GRAVITY_MPS2
REACTION_S = 0.05
FRONT_M = CAR.front_m + SETTINGS.front_margin_m


def world(*walls_m, empty_m=8.0):
    """Ranges to segments (x0, y0, x1, y1) in base_link; elsewhere something far."""
    ranges_m = np.full(BEAMS, empty_m)
    cos, sin = np.cos(BEARING_RAD), np.sin(BEARING_RAD)
    for x0, y0, x1, y1 in walls_m:
        ax, ay, dx, dy = x0 - CAR.lidar_x_m, y0, x1 - x0, y1 - y0
        cross = cos * dy - sin * dx
        with np.errstate(divide="ignore", invalid="ignore"):
            along = (ax * dy - ay * dx) / cross
            share = (ax * sin - ay * cos) / cross
        hit = (along > 0) & (share >= 0) & (share <= 1)
        ranges_m = np.where(hit, np.minimum(ranges_m, along), ranges_m)
    return ranges_m


def wall_at(x_m, half_m=2.0):
    return (x_m, -half_m, x_m, half_m)


class Car:
    """A guard with scans and motor reports on a clock of their own."""

    def __init__(self, clock=None, **settings):
        self.now_s = 100.0
        self.guard = SweptGuard(SweptSettings(**settings), CAR, PerceptionCache(CAR), clock=clock)
        self.distance_m = 0.0

    def look(self, ranges_m, speed_mps=0.0, wheel_rad=0.0, age_s=0.0, moved_m=0.0, motor=True):
        self.now_s += 0.025
        self.distance_m += moved_m
        state = MotorState(
            self.now_s, speed_mps, self.distance_m, wheel_rad, 12.0, 0.0, 0.0, 20.0, "", timed_out=False, killed=False
        )
        ranges_m = np.asarray(ranges_m, np.float32)
        scan = Scan(self.now_s - age_s, self.now_s, -STEP_RAD * (BEAMS // 2), STEP_RAD, 0.02, 30.0, ranges_m, 0)
        return self.guard.look(scan, state if motor else None)


def judge(ranges_m, wanted_mps, steering_rad=0.0, **state):
    return Car().look(ranges_m, **state).limit(wanted_mps, steering_rad)


# --- the strip


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
        outlook = car.look(ranges_m, speed_mps=0.8, wheel_rad=-0.34 * (x_m < 0.17), moved_m=0.02)
    assert outlook.limit(1.0, 0.0).forward_mps == math.inf
    assert outlook.limit(1.0, -0.34).forward_mps < 1.0


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


# --- how fast


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
    outlook = car.look(world(wall_at(FRONT_M + 0.6)), speed_mps=2.0)
    assert outlook.limit(2.0, 0.0).forward_mps > 0
    now[0] += 0.09
    assert outlook.limit(2.0, 0.0).forward_mps == 0.0


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
    assert car.look(ranges_m, speed_mps=0.0).limit(3.0, 0.0).reason == "braking: wall ahead"


# --- the bend and the wish


OUTER_WALL = ((-2.0, -0.6, 2.4, -0.6), (2.4, -0.6, 2.4, 8.0))


def test_no_gain_of_speed_that_would_carry_the_car_out_of_its_bend():
    """Speeding up takes grip that turning needs, and the faster car needs more of it."""
    outlook = Car().look(world(*OUTER_WALL), speed_mps=1.6, wheel_rad=0.3)
    holding, gaining = outlook.limit(1.6, 0.3), outlook.limit(4.0, 0.3)
    assert holding.forward_mps == math.inf
    assert gaining.reason == "no faster in this bend"
    assert 1.6 <= gaining.forward_mps < 4.0
    nearer = world((-2.0, -0.6, 1.4, -0.6), (1.4, -0.6, 1.4, 8.0))
    fast = Car().look(nearer, speed_mps=2.0, wheel_rad=0.3).limit(4.0, 0.3)
    assert (fast.forward_mps, fast.reason) == (2.0, "no faster in this bend")  # and no slower: holding it passes
    straight = Car().look(world(), speed_mps=1.6, wheel_rad=0.3).limit(4.0, 0.3)
    assert straight.forward_mps == math.inf


BESIDE_THE_BEND = (1.2, 0.4, 1.23, 0.3)
"""A leg just outside of the arc of a car that keeps its speed."""


def test_nor_of_speed_that_takes_the_grip_that_the_bend_needs_on_a_slippery_floor():
    """Neither the bend nor the gain needs more than 0.5 g, but both together do (Kamm)."""
    outlook = Car().look(world(BESIDE_THE_BEND), speed_mps=1.5, wheel_rad=0.3)
    assert outlook.limit(1.5, 0.3).forward_mps == math.inf
    assert outlook.limit(1.8, 0.3).forward_mps == math.inf
    assert outlook.limit(2.1, 0.3).reason == "no faster in this bend"
    assert 1.5 < outlook.limit(2.1, 0.3).forward_mps < 1.8


def test_nor_where_something_farther_on_lets_it_go_faster():
    scan = world(BESIDE_THE_BEND, (-2.0, 1.0, 4.0, 1.0))
    outlook = Car().look(scan, speed_mps=1.5, wheel_rad=0.3)
    farther = Car().look(world((-2.0, 1.0, 4.0, 1.0)), speed_mps=1.5, wheel_rad=0.3).limit(2.1, 0.3)
    assert farther.reason == "slower: wall ahead"
    assert farther.forward_mps > 2.1
    assert outlook.limit(2.1, 0.3).reason == "no faster in this bend"


def test_at_an_edge_noise_does_not_let_a_fast_car_go_again():
    just_outside = world((2.0, 0.20, 2.0, 0.5))
    assert judge(just_outside, 4.0, speed_mps=3.0).forward_mps == math.inf
    car = Car()
    assert car.look(world((2.0, 0.16, 2.0, 0.5)), speed_mps=3.0).limit(4.0, 0.0).forward_mps < 4.0
    assert car.look(just_outside, speed_mps=3.0).limit(4.0, 0.0).forward_mps < 4.0
    assert car.look(world((2.0, 0.25, 2.0, 0.5)), speed_mps=3.0).limit(4.0, 0.0).forward_mps == math.inf
    car.now_s += 0.3
    assert car.look(just_outside, speed_mps=3.0).limit(4.0, 0.0).forward_mps == math.inf


def test_a_slow_car_keeps_its_narrow_margins():
    car = Car()
    car.look(world((2.0, 0.16, 2.0, 0.5)), speed_mps=3.0).limit(4.0, 0.0)
    car.now_s += 0.22  # time to brake, but not to forget
    assert car.look(world((0.8, 0.20, 0.8, 0.5)), speed_mps=0.9).limit(0.9, 0.0).forward_mps == math.inf


def test_all_questions_about_one_scan_get_the_same_answer():
    car = Car()
    car.look(world((2.0, 0.16, 2.0, 0.5)), speed_mps=3.0)
    outlook = car.look(world((2.0, 0.16, 2.0, 0.5)), speed_mps=3.0)
    first = outlook.limit(4.0, 0.0)
    swept = len(outlook.strip._kept)
    assert outlook.limit(4.0, 0.0) == first
    assert len(outlook.strip._kept) == swept


# --- a driver who turns round


BESIDE_A_POST = world((1.3, -0.3, 1.3, -0.1))
"""A post that the car can pass on the left, but not on the right."""


def drives(car, steering_rad, scans, speed_mps=2.5, scan=BESIDE_A_POST):
    for _ in range(scans):
        verdict = car.look(scan, speed_mps=speed_mps).limit(speed_mps, steering_rad)
    return verdict


def test_who_has_just_turned_round_may_turn_back():
    assert drives(Car(), 0.34, 1).forward_mps == math.inf
    car = Car()
    before = drives(car, -0.05, 5)
    assert before.reason == "slower: wall ahead"
    wavers = drives(car, 0.34, 10)
    assert wavers.reason == "slower: the driver wavers"
    assert 1.0 < wavers.forward_mps < 2.5
    assert drives(car, 0.34, 4).forward_mps == math.inf  # 0.3 s later it drives where it steers


def test_a_driver_who_wavers_is_slowed_and_keeps_its_steering_and_its_brake():
    """It may mean it: a stop would take away the grip that it turns with."""
    near = world((0.9, -0.3, 0.9, -0.12))
    car = Car()
    drives(car, -0.05, 5, speed_mps=2.0, scan=world())
    assert Car().look(near, speed_mps=2.0).limit(2.0, -0.05).forward_mps == 0.0
    wavers = drives(car, 0.34, 1, speed_mps=2.0, scan=near)
    assert wavers.reason == "slower: the driver wavers"
    assert SETTINGS.creep_mps <= wavers.forward_mps < 2.0


def test_one_wrong_wish_is_no_wavering():
    car = Car()
    drives(car, 0.34, 5, speed_mps=2.0)
    assert drives(car, -0.05, 1, speed_mps=2.0).reason == "slower: wall ahead"
    assert drives(car, 0.34, 1, speed_mps=2.0).forward_mps == math.inf


# --- who comes, and what is thin


def test_a_pole_that_only_one_beam_meets_is_seen_after_a_few_scans():
    car = Car()
    verdicts = []
    for step in range(6):
        ranges_m = world()
        ranges_m[545] = 3.0 - 0.1 * step
        verdicts.append(car.look(ranges_m, speed_mps=4.0, moved_m=0.1).limit(4.0, 0.0).forward_mps)
    assert verdicts[:4] == [math.inf] * 4
    assert max(verdicts[4:]) < 4.0


def test_what_stands_does_not_come_while_the_wheels_are_locked():
    car = Car()
    for step in range(20):
        x_m = 4.0 - 0.05 * step
        car.look(world((x_m, 0.8, x_m, 1.1), empty_m=9.0), speed_mps=2.0, moved_m=0.05)
    for step in range(14):
        x_m = 3.0 - 0.04 * step
        outlook = car.look(world((x_m, 0.8, x_m, 1.1), empty_m=9.0), speed_mps=0.0)
    assert outlook.speed_mps > 0
    assert outlook.strip.more_m.size == 0


def test_a_person_who_comes_is_braked_for_before_he_is_near():
    def person(at_m):
        return world((at_m, -0.2, at_m, 0.2), empty_m=9.0)

    car = Car()
    for step in range(22):
        at_m = 4.3 - (1.5 + 2.0) * 0.025 * step
        comes = car.look(person(at_m), speed_mps=2.0, moved_m=0.05).limit(2.0, 0.0)
    stands = judge(person(at_m), 2.0, speed_mps=2.0)
    assert stands.forward_mps == math.inf
    assert comes.forward_mps < 2.0


# --- release


def braking_car():
    car = Car()
    assert car.look(world(wall_at(FRONT_M + 0.3)), speed_mps=2.0).limit(2.0, 0.0).forward_mps == 0.0
    return car


def test_a_hard_stop_is_held_for_a_fifth_of_a_second():
    car = braking_car()
    for _ in range(7):
        assert car.look(world(), speed_mps=2.0).limit(2.0, 0.0).forward_mps == 0.0
    car.look(world(), speed_mps=2.0)
    assert car.look(world(), speed_mps=2.0).limit(2.0, 0.0).forward_mps == math.inf


def test_a_moving_car_is_released_only_with_room_to_spare():
    car = braking_car()
    car.now_s += 0.3
    hard_m = 0.05 + stopping_distance_m(1.0, REACTION_S, 0.8 * 0.8 * GRAVITY_MPS2)
    assert car.look(world(wall_at(FRONT_M + hard_m + 0.15)), speed_mps=1.0).limit(1.0, 0.0).forward_mps == 0.0
    assert car.look(world(wall_at(FRONT_M + hard_m + 0.25)), speed_mps=1.0).limit(1.0, 0.0).forward_mps > 0.0


def test_a_standing_car_is_released_by_the_graded_limit():
    car = braking_car()
    car.now_s += 0.5
    assert car.look(world(wall_at(FRONT_M + 0.2)), speed_mps=0.0).limit(1.0, 0.0).forward_mps > 0.25


# --- the last centimetres


def test_never_slower_than_the_motor_can_hold():
    for way_mm in range(60, 200):
        verdict = judge(world(wall_at(FRONT_M + way_mm / 1000, 0.3)), 1.0)
        assert verdict.forward_mps == 0.0 or verdict.forward_mps >= SETTINGS.slowest_mps


def test_creeps_where_another_steering_is_free():
    pole = (FRONT_M + 0.115, 0.13, FRONT_M + 0.115, 0.2)
    verdict = judge(world(pole), 1.0)
    assert (verdict.forward_mps, verdict.reason) == (0.3, "creeping: wall ahead")


def test_boxed_in_when_no_steering_is_free():
    verdict = judge(world(wall_at(FRONT_M + 0.115)), 1.0)
    assert (verdict.forward_mps, verdict.reason) == (0.0, "boxed in")
    assert verdict.measure == pytest.approx(0.115, abs=0.015)


def test_nose_on_something_small_is_no_way_even_with_another_free():
    pole = (FRONT_M + 0.065, 0.165, FRONT_M + 0.065, 0.2)
    verdict = judge(world(pole), 1.0)
    assert (verdict.forward_mps, verdict.reason) == (0.0, "wall ahead")


def test_what_is_inside_the_margin_already_is_judged_by_the_bare_outline():
    beside = world((-2.0, 0.17, 4.0, 0.17))
    assert judge(beside, 1.0).forward_mps == math.inf
    assert judge(beside, 1.0, 0.3).forward_mps == 0.0


def test_dirt_on_the_window_does_not_hold_the_car():
    ranges_m = world()
    ranges_m[536:546] = 0.14  # inside the outline
    ranges_m[600:606] = 0.3  # thin
    assert judge(ranges_m, 1.0).forward_mps == math.inf


# --- no information


def darkened(from_m, to_m, left_m, right_m, middle=540, half=60):
    ranges_m = world()
    ranges_m[middle - half : middle + half] = math.nan
    ranges_m[middle + half :] = left_m
    ranges_m[: middle - half] = right_m
    return ranges_m[from_m:to_m]


def test_an_enclosed_dark_patch_limits_the_speed():
    verdict = judge(darkened(0, None, 2.0, 2.0), 3.0, speed_mps=3.0)
    assert (verdict.forward_mps, verdict.reason) == (1.0, "no information ahead")


@pytest.mark.parametrize(("left_m", "right_m"), [(9.0, 9.0), (2.0, 9.0), (9.0, 2.0)])
def test_the_dark_end_of_a_corridor_or_a_corner_does_not(left_m, right_m):
    car = Car()
    for half in range(1, 60, 5):  # it comes into view
        ranges_m = darkened(0, None, left_m, right_m, half=half)
        ranges_m[480:600] = np.where(np.isfinite(ranges_m[480:600]), 28.0, np.nan)
        car.look(ranges_m, speed_mps=3.0)
    outlook = car.look(darkened(0, None, left_m, right_m), speed_mps=3.0)
    assert outlook.limit(3.0, 0.0).forward_mps == math.inf


def test_a_third_of_the_window_must_be_dark():
    eyes = PerceptionCache(CAR)
    for dark_beams, dark in ((20, False), (30, True)):
        ranges_m = np.full(BEAMS, 2.0, np.float32)
        ranges_m[540 : 540 + dark_beams] = np.nan
        view = eyes.see(Scan(0.0, 0.0, -STEP_RAD * 540, STEP_RAD, 0.02, 30.0, ranges_m, 0))
        assert enclosed_dark(view, 0.0, 3.0) == dark


def test_where_the_lidar_does_not_look_nothing_is_dark():
    ranges_m = np.full(BEAMS, 2.0, np.float32)
    ranges_m[300:700] = np.nan
    view = PerceptionCache(CAR).see(Scan(0.0, 0.0, -STEP_RAD * 540, STEP_RAD, 0.02, 30.0, ranges_m, 0))
    assert enclosed_dark(view, 0.0, 3.0)
    assert not enclosed_dark(view, -3.0, 3.0)
    assert not enclosed_dark(view, 3.0, 3.0)


def test_a_covered_lidar_stops_the_car():
    verdict = judge(np.full(BEAMS, math.nan), 1.0)
    assert (verdict.forward_mps, verdict.reason) == (0.0, "the lidar sees almost nothing: uncover or clean it")


# --- backwards


def test_backs_slowly_out_of_anything():
    verdict = judge(world(wall_at(FRONT_M + 0.02)), -1.0)
    assert (verdict.reverse_mps, verdict.forward_mps) == (0.5, math.inf)


def test_what_is_seen_behind_stops_it():
    behind = world((-0.2, -0.6, -0.2, -0.36), (-0.2, 0.36, -0.2, 0.6))
    assert judge(behind, -0.5).reverse_mps == 0.5
    close = Car().look(world((-0.15, 0.19, 0.3, 0.19)))
    assert close.limit(-0.5, -0.34).reverse_mps == 0.0  # the nose swings into the wall on the left


def test_half_a_metre_without_seeing_and_no_more():
    car = Car()
    for _ in range(9):
        outlook = car.look(world(), speed_mps=-0.4, moved_m=-0.05)
        assert outlook.limit(-0.5, 0.0).reverse_mps > 0
    car.look(world(), speed_mps=-0.4, moved_m=-0.05)
    outlook = car.look(world(), speed_mps=0.0, moved_m=-0.05)
    assert outlook.limit(-0.5, 0.0).reverse_mps == 0.0
    assert outlook.limit(-0.5, 0.0).reason == "backed far enough without seeing"
    outlook = car.look(world(), speed_mps=0.4, moved_m=0.3)
    assert outlook.limit(-0.5, 0.0).reverse_mps > 0


def test_what_was_passed_is_remembered_behind():
    """A box that was beside the car while it drove by is where its tail goes when it backs to the left."""
    car = Car()
    for step in range(12):
        x_m = 0.6 - 0.1 * step
        car.look(world((x_m, 0.25, x_m + 0.25, 0.25)), speed_mps=1.0, moved_m=0.1)
    outlook = car.look(world(), speed_mps=0.0)
    assert outlook.limit(-0.5, 0.34).measure < 0.25
    assert outlook.limit(-0.5, -0.34).measure == math.inf
    assert Car().look(world()).limit(-0.5, 0.34).measure == math.inf


# --- manners


@pytest.mark.parametrize("nonsense", [(math.nan, 0.0), (1.0, math.nan), (math.inf, 0.0)])
def test_nonsense_is_not_judged(nonsense):
    assert judge(world(wall_at(0.5)), *nonsense).reason == "window clean"


def test_standing_needs_no_consent_and_starts_no_hold():
    car = Car()
    outlook = car.look(world(wall_at(FRONT_M + 0.1)), speed_mps=2.0)
    assert outlook.limit(0.0, 0.0).forward_mps == math.inf
    assert not car.guard.memory.braking


def test_without_a_motor_report_it_still_looks():
    assert Car().look(world(wall_at(FRONT_M + 0.3)), motor=False).limit(2.0, 0.0).forward_mps < 2.0


def test_the_same_question_is_swept_once():
    outlook = Car().look(world(wall_at(1.5)))
    first = outlook.limit(1.51, 0.1)
    kept = dict(outlook.strip._kept)
    assert outlook.limit(1.6, 0.1) == first
    assert outlook.strip._kept == kept
    assert outlook.strip.contact(0.1, 2.0) is outlook.strip.contact(0.1, 2.0)
    assert outlook.strip.contact(0.1, 2.0).travel_m < 2.0
    kept = dict(outlook.strip._kept)
    outlook.limit(1.6, 0.2)
    assert len(outlook.strip._kept) == len(kept) + 1
