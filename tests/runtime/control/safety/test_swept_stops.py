"""The swept safety: drivers that change sides, moving obstacles, hard stops and the last centimetres."""

import math

import pytest

from tests.runtime.control.safety.swept_scenes import FRONT_M, REACTION_S, SETTINGS, Car, judge, wall_at, world
from tests.runtime.in_earnest import judged
from wallride.runtime.control.safety.stopping import stopping_distance_m
from wallride.runtime.control.vehicle import GRAVITY_MPS2

BESIDE_A_POST = world((1.3, -0.3, 1.3, -0.1))
"""A post that the car can pass on the left, but not on the right."""


def drives(car, steering_rad, scans, speed_mps=2.5, scan=BESIDE_A_POST):
    for _ in range(scans):
        verdict = judged(car.look(scan, speed_mps=speed_mps), speed_mps, steering_rad)
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
    assert judged(Car().look(near, speed_mps=2.0), 2.0, -0.05).forward_mps == 0.0
    wavers = drives(car, 0.34, 1, speed_mps=2.0, scan=near)
    assert wavers.reason == "slower: the driver wavers"
    assert SETTINGS.creep_mps <= wavers.forward_mps < 2.0


def test_one_wrong_wish_is_no_wavering():
    car = Car()
    drives(car, 0.34, 5, speed_mps=2.0)
    assert drives(car, -0.05, 1, speed_mps=2.0).reason == "slower: wall ahead"
    assert drives(car, 0.34, 1, speed_mps=2.0).forward_mps == math.inf


def test_a_pole_that_only_one_beam_meets_is_seen_after_a_few_scans():
    car = Car()
    verdicts = []
    for step in range(6):
        ranges_m = world()
        ranges_m[545] = 3.0 - 0.1 * step
        verdicts.append(judged(car.look(ranges_m, speed_mps=4.0, moved_m=0.1), 4.0, 0.0).forward_mps)
    assert verdicts[:4] == [math.inf] * 4
    assert max(verdicts[4:]) < 4.0


def test_what_stands_does_not_come_while_the_wheels_are_locked():
    car = Car()
    for step in range(20):
        x_m = 4.0 - 0.05 * step
        car.look(world((x_m, 0.8, x_m, 1.1), empty_m=9.0), speed_mps=2.0, moved_m=0.05)
    for step in range(14):
        x_m = 3.0 - 0.04 * step
        assessment = car.look(world((x_m, 0.8, x_m, 1.1), empty_m=9.0), speed_mps=0.0)
    assert assessment.speed_mps > 0
    assert assessment.strip.more_m.size == 0


def test_what_stands_does_not_move_while_the_motor_reports_nothing():
    """Without a report the odometry stands still and everything comes nearer."""
    car = Car()
    for step in range(24):
        x_m = 4.0 - 0.05 * step
        assessment = car.look(world((x_m, 0.8, x_m, 1.1), empty_m=9.0), motor=False)
        assert assessment.strip.more_m.size == 0


def test_a_person_who_comes_is_braked_for_before_he_is_near():
    def person(at_m):
        return world((at_m, -0.2, at_m, 0.2), empty_m=9.0)

    car = Car()
    for step in range(22):
        at_m = 4.3 - (1.5 + 2.0) * 0.025 * step
        comes = judged(car.look(person(at_m), speed_mps=2.0, moved_m=0.05), 2.0, 0.0)
    stands = judge(person(at_m), 2.0, speed_mps=2.0)
    assert stands.forward_mps == math.inf
    assert comes.forward_mps < 2.0


def braking_car():
    car = Car()
    assert judged(car.look(world(wall_at(FRONT_M + 0.3)), speed_mps=2.0), 2.0, 0.0).forward_mps == 0.0
    return car


def test_a_hard_stop_is_held_for_a_fifth_of_a_second():
    car = braking_car()
    for _ in range(7):
        assert judged(car.look(world(), speed_mps=2.0), 2.0, 0.0).forward_mps == 0.0
    car.look(world(), speed_mps=2.0)
    assert judged(car.look(world(), speed_mps=2.0), 2.0, 0.0).forward_mps == math.inf


def test_a_moving_car_is_released_only_with_room_to_spare():
    car = braking_car()
    car.now_s += 0.3
    hard_m = 0.05 + stopping_distance_m(1.0, REACTION_S, 0.8 * 0.8 * GRAVITY_MPS2)
    assert judged(car.look(world(wall_at(FRONT_M + hard_m + 0.15)), speed_mps=1.0), 1.0, 0.0).forward_mps == 0.0
    assert judged(car.look(world(wall_at(FRONT_M + hard_m + 0.25)), speed_mps=1.0), 1.0, 0.0).forward_mps > 0.0


def test_a_standing_car_is_released_by_the_graded_limit():
    car = braking_car()
    car.now_s += 0.5
    assert judged(car.look(world(wall_at(FRONT_M + 0.2)), speed_mps=0.0), 1.0, 0.0).forward_mps > 0.25


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
