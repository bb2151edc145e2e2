"""The bundle adjustment, on scans whose places are known."""

import math

import numpy as np
import pytest

from wallride.runtime.control.perception.geometry import bearings_rad
from wallride.sim.mapping.bundle import adjusted
from wallride.sim.mapping.lap_record import LapRecord
from wallride.sim.mapping.odometry_path import LidarPath
from wallride.sim.mapping.pose_graph import Edge, Origin, between, placed
from wallride.sim.world.worlds import load_world

KIND = (math.radians(-135.0), math.radians(0.25), 1081)
STEP_M, NOISE_M = 0.1, 0.02
EVERY = 3
"""Each third scan is a keyframe."""


def record_along(world_name, poses, *, sticks_out_m=0.0):
    """Return scans taken standing at poses. sticks_out_m: how much nearer walls on the left seem to grazing beams."""
    world, rng = load_world(world_name), np.random.default_rng(5)
    bearings = np.array(bearings_rad(*KIND))
    ranges_m = np.array([np.minimum(world.cast(x_m, y_m, bearings + yaw_rad), 30.0) for x_m, y_m, yaw_rad in poses])
    grazing = np.abs(np.gradient(ranges_m, KIND[1], axis=1)) / ranges_m
    ranges_m -= sticks_out_m * np.minimum(grazing, 2.0) * (bearings > 0.0)
    ranges_m += rng.normal(0.0, NOISE_M, ranges_m.shape)
    return LapRecord("known", KIND, 0.0, np.arange(float(len(poses))), ranges_m.astype(np.float32))


def adjusted_by(record, true, error):
    """Return the keyframes' true poses and the adjusted ones, by an odometry of which each step has an error."""
    shifts = [between(one, two) + error for one, two in zip(true[:-1:EVERY], true[EVERY::EVERY], strict=True)]
    told = [true[0]]
    for shift in shifts:
        told.append(placed(told[-1], shift))
    times_s, std = record.scan_s[::EVERY], np.array([0.004, 0.01, 0.003])
    edges = [Edge(at, at + 1, shift, np.diag(std**-2), Origin.ODOMETRY) for at, shift in enumerate(shifts)]
    poses, _ = adjusted(record, LidarPath(times_s, np.array(told)), times_s, np.array(told), edges)
    return true[::EVERY], np.array(told), poses


@pytest.mark.parametrize("sticks_out_m", [0.0, 0.02])
def test_scans_put_the_poses_right_that_the_odometry_has_drifted_from(sticks_out_m):
    x_m = STEP_M * np.arange(25)
    true = np.column_stack([x_m, np.zeros(25), 0.02 * np.sin(x_m)])
    record = record_along("loop", true, sticks_out_m=sticks_out_m)
    true, told, poses = adjusted_by(record, true, np.array([0.004, 0.004, 0.003]))
    assert np.hypot(*(told - true)[-1, :2]) > 0.05
    assert np.abs(poses - true)[:, :2].max() < 0.012
    assert np.abs(poses - true)[:, 2].max() < 0.005


def test_along_a_corridor_the_way_is_the_odometrys():
    true = np.column_stack([25.0 + STEP_M * np.arange(25), np.zeros((25, 2))])
    true, told, poses = adjusted_by(record_along("corridor", true), true, np.array([0.004, 0.004, 0.003]))
    assert poses[-1, 0] == pytest.approx(25.0 + np.hypot(*(told[-1] - told[0])[:2]), abs=0.01)
    assert np.abs(poses - true)[:, 1].max() < 0.012
