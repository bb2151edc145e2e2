"""The speed profile: grip in bends, braking in time, and what is not seen is a corner."""

import math

import numpy as np
import pytest

from wallride.runtime.control.safety.swept_settings import SweptSettings
from wallride.runtime.control.vehicle import GRAVITY_MPS2
from wallride.runtime.control.wall_following.ball_path import RADII_M, BallPath
from wallride.runtime.control.wall_following.ball_settings import BallSettings
from wallride.runtime.control.wall_following.speed_profile import (
    BRAKE_SHARE,
    LATERAL_SHARE,
    MARGIN_M,
    NARROW_M,
    NARROW_SHARE,
    REACTION_S,
    ROOM_M,
    SHARPEST_PER_M,
    fastest_mps,
    mu_with_room,
    speed_limit_mps,
)

RADIUS_M = np.array(RADII_M)
YES = np.ones(RADIUS_M.shape, np.bool_)


def profile_mps(path, speed_mps, mu):
    return fastest_mps(path.radius_m, path.bearing_rad, path.meets, path.crosses, speed_mps, mu)


def path_of(bearing_rad, meets=YES, crosses=None):
    bearing_rad = np.broadcast_to(np.asarray(bearing_rad, float), RADIUS_M.shape)
    crosses = meets if crosses is None else crosses
    return BallPath(RADII_M, tuple(bearing_rad.tolist()), tuple(meets.tolist()), tuple(crosses.tolist()))


def kinked(turn_rad):
    """Straight on for 1.2 m, then at another heading, as far as circles of RADII_M cross it."""

    def bearing_rad(r_m):
        if r_m <= 1.2:
            return 0.0
        ahead_m = -1.2 * math.cos(turn_rad) + math.sqrt(r_m * r_m - (1.2 * math.sin(turn_rad)) ** 2)
        return math.atan2(ahead_m * math.sin(turn_rad), 1.2 + ahead_m * math.cos(turn_rad))

    return path_of([bearing_rad(r_m) for r_m in RADII_M])


def test_a_path_that_turns_back_is_driven_more_slowly_than_one_round_a_right_angle():
    right, back = (profile_mps(kinked(turn_rad), 2.0, 0.65) for turn_rad in (-math.pi / 2, -2.2))
    assert back < 0.95 * right


def stopping_to_corner_mps(way_m, mu, speed_mps):
    lateral, brake = LATERAL_SHARE * mu * GRAVITY_MPS2, BRAKE_SHARE * mu * GRAVITY_MPS2
    return math.sqrt(lateral / SHARPEST_PER_M + 2 * brake * max(way_m - MARGIN_M - REACTION_S * speed_mps, 0))


def test_the_steering_now_is_held_to_the_grip():
    limit = speed_limit_mps(math.atan(0.33 * 0.5), 0.33, 0.5)  # radius 2 m
    assert limit == pytest.approx(math.sqrt(0.75 * 0.5 * 9.81 * 2.0))
    assert speed_limit_mps(-0.34, 0.33, 0.5) == speed_limit_mps(0.34, 0.33, 0.5)
    assert speed_limit_mps(0.0, 0.33, 0.5) > 20


@pytest.mark.parametrize("mu", [0.5, 0.8])
def test_beyond_the_end_of_a_straight_path_a_corner_is_assumed(mu):
    assert profile_mps(path_of(0.0), 2.0, mu) == pytest.approx(stopping_to_corner_mps(3.0, mu, 2.0))


def test_the_path_ends_at_the_first_circle_that_the_wall_does_not_meet():
    meets = YES.copy()
    meets[5] = False  # 1.8 m; what lies behind does not count
    assert profile_mps(path_of(0.0, meets), 2.0, 0.5) == pytest.approx(stopping_to_corner_mps(1.5, 0.5, 2.0))


def test_without_any_path_the_corner_is_here():
    nothing = np.zeros(RADIUS_M.shape, np.bool_)
    assert profile_mps(path_of(0.0, nothing), 1.0, 0.5) == pytest.approx(stopping_to_corner_mps(0, 0.5, 1.0))


def test_circles_before_the_first_crossing_are_not_path():
    """A car that is 0.5 m too near has no crossing on the near circles; that is not a corner."""
    bearing = np.zeros(RADIUS_M.shape)
    bearing[:2] = -math.radians(85)
    crosses = YES.copy()
    crosses[:2] = False
    assert profile_mps(path_of(bearing, crosses=crosses), 2.0, 0.5) == pytest.approx(
        stopping_to_corner_mps(3.0, 0.5, 2.0)
    )


def test_a_steady_bend_is_driven_at_the_speed_of_its_radius():
    radius_m = 2.0
    path = path_of(np.arcsin(RADIUS_M / (2 * radius_m)))
    allowed = profile_mps(path, 1.5, 0.5)
    assert allowed == pytest.approx(math.sqrt(0.75 * 0.5 * 9.81 * radius_m), rel=0.15)
    assert allowed < profile_mps(path_of(0.0), 1.5, 0.5)


@pytest.mark.parametrize("sign", [-1, 1])
def test_a_corner_ahead_slows_the_car_in_time_and_to_either_side(sign):
    def corner_at(way_m):
        aside_m = np.sqrt(np.maximum(RADIUS_M**2 - way_m**2, 0))
        return path_of(sign * np.arctan2(aside_m, np.minimum(RADIUS_M, way_m)))

    near, middle, far = (profile_mps(corner_at(way_m), 2.0, 0.5) for way_m in (0.6, 1.2, 1.8))
    assert near < middle < far
    assert near == pytest.approx(stopping_to_corner_mps(0.6, 0.5, 2.0), rel=0.02)
    assert far <= stopping_to_corner_mps(1.8, 0.5, 2.0)


def test_faster_and_slippery_mean_earlier():
    assert profile_mps(path_of(0.0), 4.0, 0.5) < profile_mps(path_of(0.0), 1.0, 0.5)
    assert profile_mps(path_of(0.0), 2.0, 0.5) < profile_mps(path_of(0.0), 2.0, 0.8)


def test_who_has_less_room_to_run_wide_counts_on_less():
    assert mu_with_room(0.65, ROOM_M) == mu_with_room(0.65, 2.0) == 0.65
    assert mu_with_room(0.65, NARROW_M) == mu_with_room(0.65, 0.3) == pytest.approx(0.5, abs=0.005)
    assert mu_with_room(1.0, (ROOM_M + NARROW_M) / 2) == pytest.approx((1 + NARROW_SHARE) / 2)


def test_braking_is_so_gentle_that_safety_lets_it_pass():
    settings = SweptSettings()
    assert BRAKE_SHARE * BallSettings().assumed_mu < settings.graded_share * settings.grip_mu
