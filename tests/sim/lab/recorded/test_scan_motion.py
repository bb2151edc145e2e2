"""How a car moved, read off its own scans, against the truth of simulated ones and the ranges of real ones."""

import numpy as np
import pytest

from tests.sim.lab.recorded_drives import LIDAR_M, arc_poses, real, recorded
from wallride.sim.lab.recorded.scan_motion import motion_of


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
