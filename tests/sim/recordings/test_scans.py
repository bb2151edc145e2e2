"""Scans, motion and side of recordings: how a car moved, against simulated truth and the ranges of real ones."""

import numpy as np
import pytest

from tests.sim.recordings.recorded_drives import LIDAR_M, arc_poses, real, recorded
from wallride.sim.recordings.scans import better_side, motion_of, scans_of
from wallride.sim.world.worlds import load_world


def test_a_straight_drive_is_followed_to_a_centimetre():
    motion = motion_of(recorded(arc_poses(60, 1.5)))
    assert motion.x_m[-1] == pytest.approx(59 * 0.0375, abs=0.01)
    assert abs(motion.y_m[-1]) < 0.01
    assert np.median(motion.speed_mps[10:-10]) == pytest.approx(1.5, rel=0.01)
    assert motion.way_m[-1] == pytest.approx(59 * 0.0375, rel=0.05)
    assert not motion.stands


def test_a_bend_is_followed():
    motion = motion_of(recorded(arc_poses(60, 1.0, -0.5)))
    assert motion.yaw_rad[-1] == pytest.approx(-0.5 * 59 * 0.025, abs=0.01)
    assert np.median(motion.yaw_rate_radps[10:-10]) == pytest.approx(-0.5, rel=0.03)
    rear = arc_poses(60, 1.0, -0.5)[-1].ahead(LIDAR_M)
    assert motion.x_m[-1] == pytest.approx(rear.x_m - LIDAR_M, abs=0.02)
    assert motion.y_m[-1] == pytest.approx(rear.y_m, abs=0.02)


def test_driving_back_is_negative_but_is_way():
    motion = motion_of(recorded(arc_poses(40, -1.0)))
    assert np.median(motion.speed_mps) == pytest.approx(-1.0, rel=0.02)
    assert motion.way_m[-1] == pytest.approx(39 * 0.025, rel=0.05)


def test_a_standing_car_stands_and_makes_no_way():
    motion = motion_of(recorded(arc_poses(80, 0.0)))
    assert motion.stands
    assert motion.way_m[-1] == 0.0
    assert np.abs(motion.speed_mps).max() < 0.1


def test_nothing_is_guessed_across_a_hole():
    """The car is somewhere else after it: that is neither way nor speed."""
    poses = arc_poses(30, 1.0) + arc_poses(30, 1.0, start=arc_poses(2, 60.0)[-1])
    stamps_s = [n * 0.025 + 14.0 * (n >= 30) for n in range(60)]
    motion = motion_of(recorded(poses, stamps_s=stamps_s))
    assert motion.way_m[-1] == pytest.approx(58 * 0.025, rel=0.05)
    assert np.abs(motion.speed_mps - 1.0).max() < 0.1


def test_stamps_that_run_back_are_no_motion():
    stamps_s = [n * 0.025 - 900.0 * (n % 2) for n in range(30)]
    motion = motion_of(recorded(arc_poses(30, 1.0), stamps_s=stamps_s))
    assert motion.way_m[-1] == 0.0
    assert not motion.speed_mps.any()


def test_a_real_car_comes_as_much_nearer_to_a_wall_ahead_as_its_range_says():
    recording = real("t14_inside_corner_1mps")
    motion = motion_of(recording)
    ahead_m = np.median(recording.ranges_m[:, 532:549], axis=1)
    straight = slice(205, 270)
    assert np.ptp(motion.yaw_rad[straight]) < 0.1
    nearer_m = ahead_m[straight][0] - ahead_m[straight][-1]
    assert motion.way_m[straight][-1] - motion.way_m[straight][0] == pytest.approx(nearer_m, rel=0.02)


def test_a_real_car_that_stood_ends_where_it_began():
    motion = motion_of(real("t1_standing_hall"))  # people walk about before it
    assert motion.stands
    assert abs(motion.x_m[-1]) < 0.02
    assert abs(motion.yaw_rad[-1]) < 0.005


def test_what_is_no_distance_is_handed_on_as_none():
    recording = recorded(arc_poses(2, 0.0))
    spoilt = recording.ranges_m.copy()
    spoilt[0, :4] = (65.533, 0.0, 0.006, np.inf)
    object.__setattr__(recording, "ranges_m", spoilt)
    scans = scans_of(recording)
    assert np.isnan(scans[0].ranges_m[:4]).all()
    assert scans[1].received_s - scans[1].stamp_s == pytest.approx(0.02)


def test_the_side_of_the_longer_wall_is_followed():
    assert better_side(recorded(arc_poses(20, 1.0))) == "left"
    mirrored = recorded(arc_poses(20, 1.0), world=load_world("inside_corner", side="right"))
    assert better_side(mirrored) == "right"
