"""The ends of steering that a motor driver leaves are those that every law counts on."""

import pytest

from tests.runtime.control.corridor_following.course_scenes import BEND, CAR, JUNCTION, follower, report, seen_in
from wallride.drivers.pwm.settings import PwmSettings
from wallride.drivers.vesc.settings import VescSettings
from wallride.runtime.control.laws import LiveLaws
from wallride.runtime.control.safety.emergency_manoeuvre import candidates
from wallride.runtime.control.vehicle import CarSettings, ServoCar
from wallride.runtime.live_stack import LiveStack
from wallride.runtime.recording.decision_log import DecisionLog
from wallride.runtime.settings.driven_car import driven_car
from wallride.runtime.settings.tree import load_settings
from wallride.sim.world.pose import Pose

STOCK = (-0.2634, 0.3135)
NARROW = ServoCar(max_speed_mps=6.0, servo_ends_rad=(-0.1, 0.2))


def settings(*assignments):
    return load_settings(None, list(assignments), laws=True)


def test_stock_limits_of_a_vesc_leave_less_and_least_to_the_right():
    car = driven_car(settings())
    assert car.steering_ends_rad == pytest.approx(STOCK, abs=1e-4)
    assert car.narrower_end_rad == pytest.approx(-STOCK[0], abs=1e-4)
    assert [car.steered_rad(asked_rad) for asked_rad in (-1.0, 0.1, 1.0)] == pytest.approx(
        [STOCK[0], 0.1, STOCK[1]], abs=1e-4
    )


def test_a_servo_that_reaches_as_far_as_the_car_is_no_limit():
    car = driven_car(settings("motor.servo_min=0.05", "motor.servo_max=1"))
    assert type(car) is CarSettings
    assert car.steering_ends_rad == (-0.34, 0.34)


def test_the_other_sign_of_the_gain_swaps_the_ends():
    vesc = VescSettings(steering_to_servo_gain=1.2135)
    assert vesc.servo_ends_rad == pytest.approx((-STOCK[1], -STOCK[0]), abs=1e-4)


def test_the_pulses_of_a_board_are_limits_too():
    ends_rad = PwmSettings(steering_min_us=1300, steering_max_us=1900).servo_ends_rad
    assert ends_rad == pytest.approx((-400 / 1150, 200 / 1150))
    car = driven_car(settings("motor.driver=pca9685", "motor.steering_min_us=1300"))
    assert car.steering_ends_rad == pytest.approx((-0.34, 200 / 1150))


def test_the_car_that_drives_has_them():
    stack = LiveStack(settings(), DecisionLog(lambda: 0.0))
    assert isinstance(stack.laws, LiveLaws)
    assert stack.laws.guard.car.steering_ends_rad == pytest.approx(STOCK, abs=1e-4)


def judged_mps(*assignments):
    """Return what safety allows 1 m before a wall for the car's own end to the right, and for the stock servo's."""
    stack = LiveStack(settings("wall_follow.speed_mps=2", *assignments), DecisionLog(lambda: 0.0))
    for k in range(4):
        at = Pose(8.7 + 0.05 * k, 0.0, 0.0)
        assessment = stack.look(seen_in(JUNCTION, at, 0.025 * k, k), report(0.025 * k, 2.0, 0.05 * k))
    return [assessment.ask(3.0, steering_rad).forward_mps for steering_rad in (-0.34, STOCK[0])]


def test_a_command_is_judged_by_the_angle_to_which_the_wheels_are_steered():
    asked_mps, possible_mps = judged_mps()
    assert asked_mps == pytest.approx(possible_mps, abs=0.01)
    asked_mps, possible_mps = judged_mps("motor.servo_min=0.05", "motor.servo_max=1")
    assert asked_mps < possible_mps - 0.5


def test_an_emergency_tries_no_turn_beyond_them():
    tried = {manoeuvre.steering_rad for manoeuvre in candidates(0.05, STOCK, (8.0, 5.0), 0.2)}
    assert tried == {0.05, 0.0, *STOCK, *(end_rad / 2 for end_rad in STOCK)}


def asked_rad(kind, side, car):
    """Return the steering that a follower asks for, askew before a bend."""
    one = follower(side=side, car=car)
    one = one if kind == "corridor" else one._ball
    sign, found = 1.0 if side == "left" else -1.0, []
    for k in range(30):
        at = Pose(3.0 + 0.05 * k, -0.4 * sign, -0.5 * sign)
        answer = one.follow(seen_in(BEND, at, 0.025 * k, k), report(0.025 * k, 2.0, 0.05 * k))
        found.append(answer.drive.steering_rad)
    return found


@pytest.mark.parametrize("side", ["left", "right"])
@pytest.mark.parametrize("kind", ["ball", "corridor"])
def test_no_follower_asks_for_more(kind, side):
    free, bound = asked_rad(kind, side, CAR), asked_rad(kind, side, NARROW)
    assert min(free) < -0.1 or max(free) > 0.2
    assert min(bound) >= -0.1
    assert max(bound) <= 0.2
