"""Steering by a line: exact feed-forward, a stable return, a flat approach, and the delay taken out."""

import cmath
import math

import pytest

from tests.runtime.control.line_following.lines import circle
from wallride.runtime.control.line_following import line_law
from wallride.runtime.control.line_following.line_law import heading_error_rad, speed_mps, steering_rad
from wallride.runtime.control.tyres import MOST_SHARE, Moving, Tyres, slip_rad
from wallride.runtime.control.vehicle import GRAVITY_MPS2

TYRES = Tyres(0.33, 0.8, 4.7, 5.5)
WIDE = circle(radius_m=6.0, speed_mps=4.0)


def beside(turn=0.0, aside_m=0.0, off_rad=0.0, speed=4.0, trim_rad=0.0):
    """Return a car beside the wide circle that turns as the circle does."""
    slip = TYRES.rear_slip_rad(speed**2 / 6.0)
    place = (6.0 - aside_m) * cmath.exp(1j * turn)
    return Moving(place, turn + math.pi / 2 + slip + off_rad, speed, speed / 6.0, trim_rad)


def steered(car):
    return steering_rad(car, WIDE, WIDE.nearest(car.place_m), TYRES)


def driven(car, line, told_rad):
    """Yield the car every 5 ms: it is steered along a line by commands at 40 Hz, which act after 45 ms."""
    wire = [told_rad] * 9
    for step in range(300):
        if step % 5 == 0:
            then = car.later(0.045, told_rad, TYRES)
            told_rad = steering_rad(then, line, line.nearest(then.place_m), TYRES)
        wire.append(told_rad)
        car = car.later(0.005, wire.pop(0), TYRES)
        yield car


@pytest.mark.parametrize("speed", [0.5, 2.0, 4.0, 5.5])
def test_on_the_line_the_wheels_turn_as_the_bend_needs(speed):
    needed_rad = math.atan(0.33 / 6.0) + TYRES.understeer_rad(speed**2 / 6.0)
    assert steered(beside(speed=speed)) == pytest.approx(needed_rad, abs=0.004)
    assert steered(beside(speed=speed, trim_rad=0.03)) == pytest.approx(needed_rad - 0.03, abs=0.004)


@pytest.mark.parametrize(("mu", "stiffness", "speed", "frequency_radps"), [
    (0.8, 1.0, 4.0, 6.0), (0.8, 1.0, 6.0, 6.0), (0.8, 0.7, 6.0, 5.04), (0.5, 1.0, 5.6, 4.82), (0.5, 1.0, 0.2, 6.0),
])  # fmt: skip
def test_the_feedback_is_no_faster_than_the_tyres_settle(mu, stiffness, speed, frequency_radps):
    per_m = line_law.feedback_per_m(speed, Tyres(0.33, mu, 4.7 * stiffness, 5.5 * stiffness))
    assert per_m * max(speed, 1.0) == pytest.approx(frequency_radps, abs=0.02)


def test_steering_and_turn_are_each_others_inverse():
    for speed in (1.0, 3.0, 5.0):
        wheels_rad = TYRES.steering_rad(0.2, speed)
        assert TYRES.turn_radps(wheels_rad, speed, 0.2 * speed) == pytest.approx(0.2 * speed)


def test_braking_in_a_bend_slips_the_rear_more_and_needs_less_steering_than_driving_on():
    brakes, drives = TYRES.pulling(-2.0), TYRES.pulling(2.0)
    assert brakes.rear_slip_rad(4.2) == pytest.approx(0.122, abs=0.008), "as the simulated car needs"
    assert drives.rear_slip_rad(4.2) == pytest.approx(0.091, abs=0.008)
    assert brakes.understeer_rad(4.2) == pytest.approx(-0.006, abs=0.003)
    assert drives.understeer_rad(4.2) == pytest.approx(0.034, abs=0.008)
    assert TYRES.pulling(0.0) == TYRES


def test_a_correction_steers_as_much_while_the_car_brakes():
    def answered(aside_m, pulled):
        car = beside(aside_m=aside_m)
        return steering_rad(car, WIDE, WIDE.nearest(car.place_m), TYRES, pulled)

    braked, free = (answered(0.2, tyres) - answered(0.0, tyres) for tyres in (TYRES.pulling(-3.0), TYRES))
    assert braked == pytest.approx(free, abs=0.002)


def test_a_tyre_slips_more_than_in_proportion_and_never_without_end():
    grip_mps2 = 0.8 * GRAVITY_MPS2
    assert slip_rad(0.1 * grip_mps2, 5.0, 0.8) == pytest.approx(0.02, abs=1e-5)
    assert slip_rad(-0.9 * grip_mps2, 5.0, 0.8) < -1.2 * 0.18
    assert slip_rad(9.0 * grip_mps2, 5.0, 0.8) == slip_rad(MOST_SHARE * grip_mps2, 5.0, 0.8)


def test_tyres_become_what_is_observed_of_them():
    seen = TYRES.slipping(0.03)
    assert seen.rear_slip_rad(1.0) == pytest.approx(0.03, rel=0.01)
    assert seen.front_per_rad / seen.rear_per_rad == pytest.approx(TYRES.front_per_rad / TYRES.rear_per_rad)
    assert TYRES.slipping(1e9).rear_per_rad == pytest.approx(TYRES.rear_per_rad / 1.7)
    assert TYRES.slipping(-1.0).rear_per_rad == pytest.approx(TYRES.rear_per_rad * 1.7)


def test_more_slip_than_tyres_explain_is_a_floor_with_less_grip():
    assumed_s2pm = 1.0 / (TYRES.mu * GRAVITY_MPS2 * TYRES.rear_per_rad)
    assert TYRES.floor_mu(1.07 * assumed_s2pm) == TYRES.mu
    assert TYRES.mu / 1.13 < TYRES.floor_mu(1.13 * assumed_s2pm) < TYRES.mu
    assert TYRES.floor_mu(1.2 * assumed_s2pm) == pytest.approx(TYRES.mu / 1.2)
    assert TYRES.floor_mu(2.0 * assumed_s2pm) == pytest.approx(TYRES.mu / 2.0)
    assert TYRES.floor_mu(-1.0) == TYRES.mu


@pytest.mark.parametrize("aside_m", [0.2, -0.2])
def test_beside_the_line_it_steers_back(aside_m):
    assert (steered(beside(aside_m=aside_m)) - steered(beside())) * aside_m < 0.0
    assert (steered(beside(off_rad=aside_m)) - steered(beside())) * aside_m < 0.0


@pytest.mark.parametrize("speed", [1.0, 3.0, 5.0])
def test_it_comes_back_without_swinging_over(speed):
    car = beside(aside_m=0.3, speed=speed)
    told_rad, step_s, asides = 0.0, 0.025, []
    for _ in range(160):
        then = car.later(0.045, told_rad, TYRES)
        told_rad = steered(then)
        car = car.later(step_s, told_rad, TYRES)
        asides.append(WIDE.nearest(car.place_m).aside_m)
    assert min(asides) > -0.08
    assert max(map(abs, asides[-40:])) < 0.04


@pytest.mark.parametrize("speed", [2.0, 4.0, 5.5])
def test_a_heading_error_dies_out_although_turn_and_command_lag(speed):
    line = circle(radius_m=20.0)
    slip_rad = TYRES.rear_slip_rad(speed**2 / 20.0)
    car = Moving(20.0 + 0j, math.pi / 2 + slip_rad + 0.1, speed, speed / 20.0)
    way = driven(car, line, TYRES.steering_rad(1 / 20.0, speed))
    off_rad = [heading_error_rad(car, line.nearest(car.place_m), TYRES) for car in way]
    over = min(off_rad)
    assert over > -0.09
    assert max(off_rad[off_rad.index(over) :]) < 0.025


def test_no_error_asks_for_a_tighter_bend_than_the_grip_allows():
    most_radpm = TYRES.most_radpm(5.5)
    assert most_radpm * 5.5**2 == pytest.approx(MOST_SHARE * TYRES.mu * GRAVITY_MPS2)
    for aside_m, off_rad in ((0.4, 0.4), (-0.4, -0.4), (0.0, 0.8)):
        asked_rad = steered(beside(aside_m=aside_m, off_rad=off_rad, speed=5.5))
        assert abs(asked_rad) <= abs(TYRES.steering_rad(most_radpm, 5.5)) + 1e-9


def test_the_way_to_the_line_is_no_steeper_than_its_bound():
    speed = 1.2
    car = beside(aside_m=2.0, speed=speed)
    steep_rad = math.asin(line_law.STEEPEST)
    at_bound = steered(beside(aside_m=2.0, off_rad=-steep_rad, speed=speed))
    assert steered(car) < at_bound, "it turns toward the line first"
    assert at_bound == pytest.approx(math.atan(0.33 / 6.0), abs=0.03), "and then goes on straight"


@pytest.mark.parametrize(("speed", "ahead_mps", "expected_mps"), [(4.0, 2.0, 2.0), (1.0, 2.0, 3.0), (4.0, 5.0, 3.0)])
def test_a_lower_speed_is_taken_where_the_motor_obeys_and_a_higher_one_at_its_place(speed, ahead_mps, expected_mps):
    line = circle(radius_m=6.0, speed_mps=3.0)
    line.speed_mps[4:] = ahead_mps
    car = Moving(line.place_at(0.0), math.pi / 2, speed, 0.0)
    assert speed_mps(car, line, line.nearest(car.place_m)) == pytest.approx(expected_mps)


def test_the_wheels_stand_as_told_before_until_the_servo_obeys():
    wheels, car = line_law.ToldWheels(10.0), Moving(0j, 0.0, 4.0, 0.0)
    wheels.tell(0.1, 0.025)
    still = wheels.ahead(car, line_law.SERVO_S, TYRES)
    assert (still.yaw_rad, still.turn_radps) == (0.0, 0.0)
    assert wheels.ahead(car, 0.05, TYRES) == still.later(0.05 - line_law.SERVO_S, 0.1, TYRES)
    wheels.tell(0.3, 0.01)
    assert wheels.rad == pytest.approx(0.2), "as fast as the servo turns"
    assert wheels.ahead(car, line_law.SERVO_S, TYRES).turn_radps > 0.0
    wheels.mirror()
    assert wheels.rad == pytest.approx(-0.2)
    assert wheels.ahead(car, line_law.SERVO_S, TYRES).turn_radps < 0.0


def test_the_heading_error_is_that_of_the_way():
    car = beside(speed=5.0)
    assert heading_error_rad(car, WIDE.nearest(car.place_m), TYRES) == pytest.approx(0.0, abs=0.01)
