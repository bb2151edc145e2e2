"""The car against closed forms: circle, grip, brakes, delays; and for ever sane."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from pydantic import ValidationError

from wallride.sim.car.vehicle import BrakeDemand, CoastDemand, DelayLine, SpeedDemand, Vehicle, VehicleSettings
from wallride.sim.world.pose import Pose

STEP_S = 0.005
G_MPS2 = 9.81
INSTANT = {"drive_delay_s": 0.0, "steering_delay_s": 0.0}
LOCKING_A = 100.0


def car(speed_mps=0.0, **changes):
    vehicle = Vehicle(VehicleSettings(**changes))
    vehicle.place(Pose(0, 0, 0), speed_mps=speed_mps)
    return vehicle


def drive(vehicle, seconds, demand, steering_rad=0.0, step_s=STEP_S):
    for _ in range(round(seconds / step_s)):
        vehicle.step(step_s, demand, steering_rad)
    return vehicle


def stop(vehicle, demand, steering_rad=0.0, step_s=STEP_S):
    """Brake until it stands; return the distance."""
    start = (vehicle.x_m, vehicle.y_m)
    for _ in range(round(10 / step_s)):
        vehicle.step(step_s, demand, steering_rad)
        if vehicle.speed_mps == 0.0 and vehicle.yaw_rate_radps == 0.0:
            return math.hypot(vehicle.x_m - start[0], vehicle.y_m - start[1])
    raise AssertionError("still moving after 10 s")


@pytest.mark.parametrize("steering_rad", [0.05, 0.2, 0.34, -0.34])
def test_a_slow_circle_has_the_radius_of_the_geometry(steering_rad):
    vehicle = drive(car(), 2.0, SpeedDemand(0.35), steering_rad)
    radius_m = vehicle.speed_mps / vehicle.yaw_rate_radps
    assert radius_m == pytest.approx(0.33 / math.tan(steering_rad), rel=1e-3)
    xy = []
    for _ in range(round(math.tau * abs(radius_m) / 0.34 / STEP_S)):  # a little more than once round
        vehicle.step(STEP_S, SpeedDemand(0.35), steering_rad)
        xy.append((vehicle.x_m, vehicle.y_m))
    x, y = np.array(xy).T
    assert np.ptp(x) == pytest.approx(2 * abs(radius_m), rel=5e-3)
    assert np.ptp(y) == pytest.approx(2 * abs(radius_m), rel=5e-3)


@pytest.mark.parametrize("mu", [0.5, 0.8, 1.0])
def test_no_bend_is_taken_faster_than_grip_allows_and_the_best_nearly_uses_it(mu):
    best = 0.0
    for steering_rad in np.linspace(0.06, 0.34, 8):
        vehicle = drive(car(grip_mu=mu), 3.0, SpeedDemand(4.5), steering_rad)
        twist = vehicle.twist
        sideways = twist.lateral_mps + vehicle.settings.rear_axle_to_cg_m * twist.yaw_rate_radps
        lateral_mps2 = abs(twist.yaw_rate_radps) * math.hypot(twist.speed_mps, sideways)
        assert lateral_mps2 <= 1.01 * mu * G_MPS2
        best = max(best, lateral_mps2)
    assert best > 0.87 * mu * G_MPS2  # the rest pulls the turned front wheels against their own drag


def test_full_lock_at_speed_runs_wide_instead_of_spinning():
    vehicle = drive(car(), 3.0, SpeedDemand(4.0), 0.34)
    assert vehicle.speed_mps > 3.5
    assert vehicle.speed_mps / vehicle.yaw_rate_radps > 2.0 * 0.95  # v^2 / (mu g) = 2.04 m


@pytest.mark.parametrize("mu", [0.5, 0.8, 1.0])
@pytest.mark.parametrize("speed_mps", [1.0, 2.0, 4.0])
@pytest.mark.parametrize("step_s", [0.001, 0.005])
def test_full_braking_takes_v_squared_over_two_mu_g(mu, speed_mps, step_s):
    vehicle = car(speed_mps, grip_mu=mu, **INSTANT)
    expected_m = speed_mps**2 / (2 * mu * G_MPS2)
    assert stop(vehicle, BrakeDemand(LOCKING_A), step_s=step_s) == pytest.approx(expected_m, rel=0.03)


def test_gentle_braking_is_as_strong_as_its_current_and_the_drag():
    vehicle = car(3.0, **INSTANT)
    expected_m = 3.0**2 / (2 * (0.17 * 20 + 0.4))
    assert stop(vehicle, BrakeDemand(20.0)) == pytest.approx(expected_m, rel=0.02)


def test_locked_wheels_report_zero_while_the_car_slides_and_roll_again_when_released():
    vehicle = drive(car(3.0, **INSTANT), 0.1, BrakeDemand(LOCKING_A))
    assert vehicle.wheel_speed_mps == 0.0
    assert vehicle.speed_mps == pytest.approx(3.0 - 0.8 * G_MPS2 * 0.1, abs=0.1)
    assert vehicle.wheel_travel_m < 0.15 < vehicle.x_m
    drive(vehicle, 0.05, CoastDemand())
    assert vehicle.wheel_speed_mps == vehicle.speed_mps > 1.5


def test_locked_wheels_do_not_steer_but_rolling_ones_do():
    locked, rolling = car(3.0, **INSTANT), car(3.0, **INSTANT)
    for vehicle in (locked, rolling):
        drive(vehicle, 0.2, SpeedDemand(3.0))
    stop(locked, BrakeDemand(LOCKING_A), 0.34)
    stop(rolling, BrakeDemand(20.0), 0.34)
    assert abs(locked.yaw_rad) < 0.3 < rolling.yaw_rad


def test_braking_and_turning_share_the_grip():
    turning, braking = (drive(car(3.0), 1.0, SpeedDemand(3.0), 0.15) for _ in range(2))
    drive(turning, 0.1, SpeedDemand(3.0), 0.15)
    drive(braking, 0.1, BrakeDemand(42.0), 0.15)
    braked_mps2 = 0.17 * 42 + 0.4
    left_over_mps2 = math.sqrt((0.8 * G_MPS2) ** 2 - braked_mps2**2)
    sideways_mps2 = [vehicle.yaw_rate_radps * vehicle.speed_mps for vehicle in (braking, turning)]
    assert sideways_mps2[0] < 1.02 * left_over_mps2 < 3.0 < sideways_mps2[1]


@pytest.mark.parametrize("demand", [SpeedDemand(0.0), BrakeDemand(50.0), CoastDemand(), SpeedDemand(0.19)])
def test_zero_stays_exactly_zero_for_ten_seconds(demand):
    vehicle = drive(car(), 10.0, demand, 0.3)
    assert (vehicle.x_m, vehicle.y_m, vehicle.yaw_rad) == (0.0, 0.0, 0.0)
    assert vehicle.speed_mps == vehicle.wheel_speed_mps == vehicle.yaw_rate_radps == 0.0


@pytest.mark.parametrize("demand", [BrakeDemand(LOCKING_A), BrakeDemand(5.0), SpeedDemand(0.0), CoastDemand()])
@pytest.mark.parametrize("speed_mps", [-0.6, 0.3, 2.0])
def test_every_stop_ends_at_exactly_zero_and_stays(demand, speed_mps):
    vehicle = car(speed_mps)
    stop(vehicle, demand, 0.2)
    at = vehicle.pose
    drive(vehicle, 1.0, demand, -0.2)
    assert vehicle.pose == at


def test_speed_zero_is_no_brake():
    ramped = stop(car(2.0, **INSTANT), SpeedDemand(0.0))
    braked = stop(car(2.0, **INSTANT), BrakeDemand(LOCKING_A))
    assert ramped > 1.4 * braked


def test_speed_follows_the_ramp_and_settles_on_the_demand():
    vehicle = drive(car(**INSTANT), 0.3, SpeedDemand(3.0))
    assert vehicle.speed_mps == pytest.approx(5.4 * 0.3, rel=0.08)
    drive(vehicle, 2.0, SpeedDemand(3.0))
    assert vehicle.speed_mps == pytest.approx(3.0, abs=0.02)


def test_reverse_drives_backwards_along_the_same_circle():
    vehicle = drive(car(), 3.0, SpeedDemand(-0.5), 0.2)
    assert vehicle.speed_mps == pytest.approx(-0.5, abs=0.01)
    assert vehicle.speed_mps / vehicle.yaw_rate_radps == pytest.approx(0.33 / math.tan(0.2), rel=0.01)
    assert vehicle.x_m < -1.0
    assert vehicle.wheel_travel_m < -1.0


def test_forward_to_reverse_and_back():
    vehicle = drive(car(1.0), 2.0, SpeedDemand(-0.6))
    assert vehicle.speed_mps == pytest.approx(-0.6, abs=0.02)
    drive(vehicle, 2.0, SpeedDemand(0.8))
    assert vehicle.speed_mps == pytest.approx(0.8, abs=0.02)


def test_a_low_grip_floor_slows_the_start():
    assert drive(car(grip_mu=0.2), 0.5, SpeedDemand(4.0)).speed_mps <= 0.2 * G_MPS2 * 0.5


@pytest.mark.parametrize("delay_s", [0.0, 0.02, 0.06])
def test_commands_take_effect_after_their_delay(delay_s):
    vehicle = car(drive_delay_s=delay_s, steering_delay_s=delay_s)
    steps = 0
    while vehicle.servo_rad == 0.0:
        vehicle.step(0.001, SpeedDemand(1.0), 0.3)
        steps += 1
    assert steps == round(delay_s / 0.001) + 1
    braked = car(2.0, drive_delay_s=delay_s, drag_mps2=0.0)
    steps = 0
    while braked.speed_mps == 2.0:
        braked.step(0.001, BrakeDemand(10.0), 0.0)
        steps += 1
    assert steps == round(delay_s / 0.001) + 1


def test_a_short_command_is_delayed_not_lost():
    line = DelayLine(0.02, "rest")
    said = []
    for tick in range(8):
        line.put(tick * 0.005, "pulse" if tick == 1 else "rest")
        said.append(line.at(tick * 0.005))
    assert said == ["rest"] * 5 + ["pulse"] + ["rest"] * 2


def test_the_servo_slews_and_stops_at_its_ends_and_the_trim_comes_on_top():
    vehicle = car(trim_rad=0.03, **INSTANT)
    drive(vehicle, 0.05, CoastDemand(), 0.5)
    assert vehicle.servo_rad == pytest.approx(3.2 * 0.05)
    drive(vehicle, 0.5, CoastDemand(), 0.5)
    assert vehicle.servo_rad == pytest.approx(0.34)
    crooked = drive(car(trim_rad=0.03), 5.0, SpeedDemand(0.35), 0.0)
    assert crooked.yaw_rad > 0.1


@pytest.mark.parametrize(
    ("speed_mps", "steering_rad", "current_a"), [(1.0, 0.3, 20), (3.0, 0.15, 20), (2.0, 0.34, 100)]
)
def test_the_step_size_hardly_matters(speed_mps, steering_rad, current_a):
    ends = []
    for step_s in (0.001, 0.005):
        vehicle = drive(car(), 2.0, SpeedDemand(speed_mps), steering_rad, step_s)
        drive(vehicle, 0.5, BrakeDemand(current_a), steering_rad, step_s)
        ends.append(vehicle)
    fine, coarse = ends
    travelled_m = fine.wheel_travel_m
    assert math.hypot(fine.x_m - coarse.x_m, fine.y_m - coarse.y_m) < 0.02 * travelled_m
    assert coarse.wheel_travel_m == pytest.approx(travelled_m, rel=0.02)
    assert abs(math.remainder(fine.yaw_rad - coarse.yaw_rad, math.tau)) < 0.05


demands = st.one_of(
    st.builds(SpeedDemand, st.floats(-8, 8)), st.builds(BrakeDemand, st.floats(0, 200)), st.just(CoastDemand())
)


@given(
    commands=st.lists(st.tuples(demands, st.floats(-2, 2), st.integers(1, 80)), max_size=12),
    mu=st.floats(0.05, 1.5),
    speed_mps=st.floats(-3, 6),
    step_s=st.sampled_from([0.001, 0.0025, 0.005, 0.02]),
)
@settings(max_examples=60, deadline=None)
def test_any_commands_leave_it_sane_repeatable_and_within_its_energy(commands, mu, speed_mps, step_s):
    def run():
        vehicle = car(speed_mps, grip_mu=mu)
        fastest = abs(speed_mps)
        for demand, steering_rad, steps in commands:
            if isinstance(demand, SpeedDemand):
                fastest = max(fastest, abs(demand.mps))
            drive(vehicle, steps * step_s, demand, steering_rad, step_s)
        return vehicle, fastest

    vehicle, fastest = run()
    state = (*(vehicle.pose.x_m, vehicle.pose.y_m, vehicle.yaw_rad), vehicle.speed_mps, vehicle.yaw_rate_radps)
    assert all(map(math.isfinite, state))
    assert math.hypot(vehicle.speed_mps, vehicle.twist.lateral_mps) < 1.5 * fastest + 1.5
    assert abs(vehicle.servo_rad) <= 0.34
    again, _ = run()
    assert again.pose == vehicle.pose


def test_halt_and_place_forget_the_motion():
    vehicle = drive(car(), 1.0, SpeedDemand(2.0), 0.2)
    vehicle.halt()
    assert vehicle.speed_mps == vehicle.wheel_speed_mps == 0.0
    vehicle.place(Pose(1, 2, 3), speed_mps=1.0)
    vehicle.step(0.001, CoastDemand(), 0.0)
    assert vehicle.x_m == pytest.approx(1 + 0.001 * math.cos(3), abs=1e-5)
    assert vehicle.servo_rad == 0.0


def test_the_motor_current_has_the_sign_of_its_force():
    assert drive(car(), 0.2, SpeedDemand(3.0)).motor_current_a > 10
    assert drive(car(3.0), 0.2, BrakeDemand(12.0)).motor_current_a == pytest.approx(-12.0)
    assert drive(car(3.0), 0.2, CoastDemand()).motor_current_a == 0.0


@pytest.mark.parametrize("wrong", [{"grip_mu": 0}, {"mass_kg": math.inf}, {"wheels": 4}])
def test_settings_are_closed_and_checked(wrong):
    with pytest.raises(ValidationError):
        VehicleSettings(**wrong)
