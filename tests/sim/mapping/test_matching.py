"""Keyframes and the edges between them: what the scene tells, and what it hides."""

import math

import numpy as np
import pytest

from wallride.runtime.control.perception.geometry import beam_ages_s, bearings_rad, directions
from wallride.sim.mapping.closing import close_lap
from wallride.sim.mapping.keyframes import in_one_moment, keyframes, trusted_ranges_m
from wallride.sim.mapping.lap_record import LapRecord, record_of_log
from wallride.sim.mapping.matching import Matcher
from wallride.sim.mapping.odometry_path import LearntCar, LidarPath, gyro_bias_radps, odometry_path
from wallride.sim.mapping.pose_graph import Origin, between
from wallride.sim.replay.drive_log import read_log
from wallride.sim.world.beams import LidarSettings
from wallride.sim.world.worlds import load_world

KIND = (math.radians(-135.0), math.radians(0.25), 1081)
STEP_M = 0.3


def frames_along(world_name, *, at_m=0.0, noise_m=0.01, seed=0):
    """Return two keyframes STEP_M apart, taken standing."""
    world, rng = load_world(world_name), np.random.default_rng(seed)
    bearings = np.array(bearings_rad(*KIND))
    ranges_m = [world.cast(x_m, 0.0, bearings) + rng.normal(0.0, noise_m, KIND[2]) for x_m in (at_m, at_m + STEP_M)]
    record = LapRecord(
        "two places", KIND, 0.0, np.array([0.0, 1.0]), trusted_ranges_m(np.array(ranges_m, dtype=np.float32))
    )
    path = LidarPath(record.scan_s, np.array([[0.0, 0.0, 0.0], [STEP_M, 0.0, 0.0]]))
    return keyframes(record, path)


def laid_over(frames, guess, origin):
    return Matcher(frames, KIND).laid_over(np.array([0]), np.array([1]), guess[None], origin)[0]


@pytest.mark.parametrize("origin", [Origin.NEIGHBOUR, Origin.LOOP])
@pytest.mark.parametrize("seed", range(4))
def test_a_corridor_hides_the_direction_along_it(origin, seed):
    guess = np.array([STEP_M + 0.1, 0.05, 0.02])
    edge = laid_over(frames_along("corridor", at_m=25.0, seed=seed), guess, origin)
    assert not edge.full
    assert edge.shift == pytest.approx([guess[0], 0.0, 0.0], abs=0.01)
    along = edge.information[0, 0] / edge.information[1, 1]
    assert along < 1e-3, "the noise of the normals invents information along the corridor"


def test_a_corner_determines_all_directions():
    guess = np.array([STEP_M + 0.1, 0.05, 0.02])
    edge = laid_over(frames_along("loop"), guess, Origin.LOOP)
    assert edge.full
    assert edge.shift == pytest.approx([STEP_M, 0.0, 0.0], abs=0.005)
    assert edge.share > 0.95


def test_places_that_do_not_look_alike_have_no_edge():
    here, there = frames_along("loop")[0], frames_along("u_turn", at_m=4.0)[0]
    assert laid_over([here, there], np.zeros(3), Origin.LOOP) is None


def test_a_place_after_a_blind_one_is_laid_over_one_before_that():
    """Of seven places 0.3 m apart the fourth has no points: it fits none, and the fifth does not fit it."""
    world, rng, time_s = load_world("loop"), np.random.default_rng(0), np.arange(7.0)
    bearings = np.array(bearings_rad(*KIND))
    ranges_m = np.array([world.cast(x_m, 0.0, bearings) for x_m in STEP_M * time_s])
    ranges_m += rng.normal(0.0, 0.01, ranges_m.shape)
    ranges_m[3] = np.nan
    reports = np.column_stack([time_s, STEP_M * time_s, np.full(7, STEP_M), np.zeros(7)])
    lap = close_lap(LapRecord("blind", KIND, 0.0, time_s, ranges_m.astype(np.float32), reports))
    matched = {edge.after for edge in lap.edges if edge.origin is Origin.NEIGHBOUR}
    assert matched == {1, 2, 4, 5, 6}
    assert lap.poses[-1, 0] == pytest.approx(6 * STEP_M, abs=0.02)


def test_points_are_put_where_a_standing_lidar_sees_them():
    """A wall 2 m ahead, seen while the lidar drives at it and turns: each beam from a pose of its own."""
    share = np.linspace(0.0, 1.0, KIND[2])
    poses = np.column_stack([0.1 * share, 0.02 * share, 0.08 * share])
    bearings = KIND[0] + KIND[1] * np.arange(KIND[2]) + poses[:, 2]
    ranges_m = np.where(np.cos(bearings) > 0.1, (2.0 - poses[:, 0]) / np.cos(bearings), np.nan)
    points_m = np.array(directions(*KIND)) * ranges_m
    seen = in_one_moment(points_m[:, None], poses[-1:], poses[None])[0][:, 0]
    turned = np.cos(0.08) * seen[0] - np.sin(0.08) * seen[1] + 0.1
    assert turned[np.isfinite(turned)] == pytest.approx(2.0)


def test_a_gyro_with_a_bias_gives_the_circle_that_wrong_steering_hides():
    time_s = np.arange(0.0, 10.0, 0.02)
    speed_mps = np.where(time_s < 2.0, 0.0, 1.0)
    way_m = np.cumsum(speed_mps) * 0.02
    reports = np.column_stack([time_s, way_m, speed_mps, np.full(time_s.size, 0.3)])
    gyro = np.column_stack([time_s, 0.5 * speed_mps + 0.02])
    record = LapRecord("circle", KIND, 0.0, time_s, np.zeros((time_s.size, 1), np.float32), reports, gyro)
    path = odometry_path(record, LearntCar(slip_s2pm=0.0))
    yaw_rad = 0.5 * way_m[-1]
    end = np.array([2.0 * math.sin(yaw_rad), 2.0 * (1.0 - math.cos(yaw_rad)), yaw_rad])
    assert path.at(time_s[-1:])[0] == pytest.approx(end, abs=0.03)
    assert between(path.poses[0], path.poses[50]) == pytest.approx(np.zeros(3), abs=1e-3)


def test_wheels_that_lock_in_a_bend_do_not_count_as_a_standing_gyro():
    time_s = np.arange(0.0, 10.0, 0.02)
    stands, locks = time_s < 2.0, (time_s > 5.0) & (time_s < 5.5)
    reports = np.column_stack([time_s, time_s, np.where(stands | locks, 0.0, 3.0), np.zeros(time_s.size)])
    gyro = np.column_stack([time_s, np.where(stands, 0.01, 1.21)])
    record = LapRecord("bend", KIND, 0.0, time_s, np.zeros((time_s.size, 1), np.float32), reports, gyro)
    assert gyro_bias_radps(record) == pytest.approx(0.01)


def test_a_car_slides_on_while_a_full_brake_locks_its_wheels():
    """From 4 m/s, 0.2 s of locked wheels: they report no way, and the car goes 0.7 m."""
    time_s = np.arange(0.0, 1.0, 0.02)
    locked = (time_s > 0.4) & (time_s < 0.6)
    speed_mps = np.where(time_s < 0.6, np.where(locked, 0.0, 4.0), 3.0)
    way_m = np.cumsum(speed_mps) * 0.02
    reports = np.column_stack([time_s, way_m, speed_mps, np.zeros(time_s.size)])
    path = odometry_path(LapRecord("brake", KIND, 0.0, time_s, np.zeros((0, 1), np.float32), reports), LearntCar())
    ends_m = np.diff(path.at(np.array([0.4, 0.6]))[:, 0])
    assert ends_m == pytest.approx(0.7, abs=0.06)


def test_the_sweep_of_a_recorded_scan_is_the_drivers(dead_end):
    assert record_of_log(read_log(dead_end)).ray_s == pytest.approx(LidarSettings().ray_s)


@pytest.mark.parametrize("ray_s", [1e-5, -1e-5, 0.0])
def test_the_last_beam_that_was_sent_has_the_age_0(ray_s):
    ages_s = beam_ages_s(ray_s, 11, np.arange(11.0))
    assert ages_s.min() == 0.0
    assert np.argmin(ages_s) == (10 if ray_s > 0.0 else 0)
    assert ages_s.max() == pytest.approx(10 * abs(ray_s))
