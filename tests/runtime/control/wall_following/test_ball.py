"""The rolling-ball follower: whole drives, and the car without a wall."""

import math
from dataclasses import replace

import numpy as np
import pytest

from tests.runtime.control.wall_following.ball_scenes import MOTOR, follower, scan_in, scan_of
from wallride.runtime.control.wall_following.no_wall_policy import FADE_PER_SCAN, Lost
from wallride.sim.car.vehicle import VehicleSettings
from wallride.sim.lab.courses.walls import case_of
from wallride.sim.lab.limits import limit_m
from wallride.sim.virtual.closed_loop import Case, drive
from wallride.sim.world.beams import LidarSettings
from wallride.sim.world.worlds import load_world

NOTHING_M = np.full(1081, np.nan, np.float32)


def test_slow_fades_the_last_steering_and_says_so():
    law = follower(speed_mps=3.0)
    steered = law.follow(scan_in("straight", y_m=-0.1), None).drive.steering_rad
    for number in (1, 2, 3):
        answer = law.follow(scan_of(NOTHING_M, number), MOTOR)
        assert answer.drive.steering_rad == pytest.approx(steered * (1 - FADE_PER_SCAN) ** number)
        assert answer.drive.speed_mps == 0.5
        assert answer.reason.startswith("no wall")
        assert math.isnan(answer.distance_m)
        assert math.isnan(answer.error_m)


def test_a_slow_wish_is_not_sped_up_by_losing_the_wall():
    assert follower(speed_mps=0.3).follow(scan_of(NOTHING_M), MOTOR).drive.speed_mps == 0.3


def test_stop_asks_for_a_stop():
    assert follower(no_wall="stop").follow(scan_of(NOTHING_M), MOTOR).drive is None


@pytest.mark.parametrize(("side", "sign"), [("left", 1), ("right", -1)])
def test_search_turns_towards_the_wanted_side_for_so_many_metres(side, sign):
    law = follower(no_wall="search", side=side, search_at_most_m=1.0)
    moving = replace(MOTOR, speed_mps=0.5)
    answers = [law.follow(scan_of(NOTHING_M, number), moving) for number in range(100)]
    assert answers[0].drive.speed_mps == 0.5
    assert 0.1 < sign * answers[0].drive.steering_rad < 0.34
    searched = [answer.drive is not None for answer in answers]
    assert sum(searched) == pytest.approx(1.0 / (0.5 * 0.025), abs=2)
    assert not any(searched[85:])
    assert "given up" in answers[-1].reason


def test_a_found_wall_ends_the_search_and_the_next_one_is_as_long():
    lost = Lost("search", 0.5, 1.0, 0.18)
    assert lost.drive(0.9)[0] is not None
    lost.found(0.1)
    assert lost.drive(0.9)[0] is not None
    assert lost.drive(0.2)[0] is None


def driven(name, speed_mps, mu=0.8, side="left", way_m=9.0, start=None, seed=1, noise_m=0.02, rolling=True, **car):
    lidar = LidarSettings(noise_std_m=noise_m, outlier_share=0.02)
    world = load_world(name, side=side)
    case = Case(
        world, start or world.start, speed_mps if rolling else 0.0, side=side, distance_m=way_m, duration_s=40.0,
        vehicle=VehicleSettings(grip_mu=mu, **car), lidar=lidar, seed=seed,
        truth=load_world("straight", side=side) if name == "doorway" else None,
    )  # fmt: skip
    run = drive(case, follower(speed_mps=speed_mps, side=side), None)
    assert run.contact is None
    assert run.distance_m >= way_m
    return run


@pytest.mark.parametrize("speed_mps", [1.0, 3.0])
def test_it_settles_on_the_wanted_distance_and_stays_within_a_centimetre(speed_mps):
    start = load_world("straight").start_at(distance_m=0.5, toward_wall_rad=math.radians(20))
    error_m = driven("straight", speed_mps, start=start).error_m
    assert np.abs(error_m[80:]).max() < 0.05
    assert np.abs(error_m[-30:]).max() < 0.01


@pytest.mark.parametrize(
    ("name", "speed_mps", "mu", "way_m", "mean_m"),
    [
        ("inside_corner", 1.0, 0.8, 12.0, 0.03),
        ("inside_corner", 4.0, 0.5, 12.0, 0.12),
        ("outside_corner", 4.0, 0.8, 12.0, 0.02),
        ("doorway", 3.0, 0.8, 12.0, 0.006),
        ("u_turn", 4.0, 0.8, 17.0, 0.05),
        ("u_turn_inner", 2.0, 0.8, 14.0, 0.02),
        ("curved", 2.0, 0.8, 20.0, 0.015),
    ],
)
def test_it_gets_round_without_a_corner_rule(name, speed_mps, mu, way_m, mean_m):
    run = driven(name, speed_mps, mu, side="right" if speed_mps > 2 else "left", way_m=way_m, rolling=False)
    assert np.abs(run.error_m).mean() < mean_m


@pytest.mark.parametrize("side", ["left", "right"])
def test_a_badly_centred_steering_is_learnt_away(side):
    error_m = driven("straight", 2.0, way_m=12.0, trim_rad=0.03, side=side).error_m
    assert np.abs(error_m[-80:]).max() < 0.005


def test_more_noise_does_not_move_the_car():
    error_m = driven("straight", 2.0, way_m=16.0, noise_m=0.05).error_m
    assert abs(error_m[-120:].mean()) < 0.01


@pytest.mark.parametrize("speed_mps", [1.0, 2.0, 3.0])
@pytest.mark.parametrize("name", ["t2", "t4"])
def test_the_way_to_the_wall_is_nearly_the_shortest_there_is(name, speed_mps):
    run = drive(case_of(name, speed_mps, 0.8, "left", 1), follower(speed_mps=speed_mps), None)
    assert np.abs(run.error_m).mean() < 1.2 * limit_m(name, speed_mps, 0.8)


def test_the_loop_is_driven_fast_on_a_good_floor_and_without_contact_on_a_slippery_one():
    world = load_world("loop")
    assert world.lap is not None
    for mu in (0.8, 0.5):
        case = Case(world, distance_m=1.6 * world.lap.length_m, vehicle=VehicleSettings(grip_mu=mu), seed=3)
        run = drive(case, follower(speed_mps=4.0), None)
        assert run.contact is None
        if mu == 0.8:
            assert np.abs(run.error_m).mean() < 0.04
            late = run.time_s > 2.0
            assert run.speed_mps[late, 0].mean() > world.lap.length_m / 9.6


@pytest.mark.parametrize("name", ["t2", "t4", "t5"])
def test_a_rough_car_follows_nearly_as_well_as_a_clean_one(name):
    clean, rough = (
        np.abs(drive(case_of(name + how, 2.0, 0.8, "right", 1), follower(speed_mps=2.0, side="right"), None).error_m)
        for how in ("", " rough")
    )
    assert rough.mean() < 1.4 * clean.mean()
    assert rough[-30:].mean() < 0.015


@pytest.mark.parametrize("side", ["left", "right"])
def test_the_line_it_tells_of_is_where_the_car_is_now_even_before_a_corner(side):
    """The wall is at 1 m; the error is that of the wall ahead, which is nearer, and of where the car will soon be."""
    moving = replace(MOTOR, speed_mps=3.0)
    told = follower(side=side).follow(scan_in("inside_corner", x_m=7.3, yaw_rad=0.1, side=side), moving)
    sign = 1 if side == "left" else -1
    assert told.line_m == pytest.approx(1.0, abs=0.02)
    assert told.angle_rad == pytest.approx(-sign * 0.1, abs=0.02)
    assert told.distance_m < 0.9
