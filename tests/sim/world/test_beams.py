"""The reported scan: exact when nothing is wrong, and wrong in the ways the real sensor is."""

import math

import numpy as np
import pytest
from pydantic import ValidationError

from wallride.sim.world.beams import NO_RETURN_MM, SELF_RETURN_BEAMS, LidarSettings, scan, true_ranges_m
from wallride.sim.world.pose import Pose, Twist
from wallride.sim.world.worlds import load_world

LOOP = load_world("loop")
PERFECT = LidarSettings(noise_std_m=0.0)
STANDING = Twist()


def take(settings=PERFECT, *, world=LOOP, pose=None, twist=STANDING, seed=0):
    return scan(world, pose or world.start, twist, 0.0, np.random.default_rng(seed), settings)


def test_a_perfect_scan_in_the_loop():
    ranges_mm = take()
    assert ranges_mm.shape == (1081,)
    assert ranges_mm.dtype == np.int64
    assert ranges_mm[540] == 9000 - 270  # ahead, the lidar 0.27 m before the axle
    assert ranges_mm[540 + 360] == 1000  # left, the outer wall
    assert ranges_mm[540 - 360] == 1000  # right, the inner wall
    assert ranges_mm[0] == round(1000 * math.sqrt(2))  # right rear: the sweep begins there


def test_no_return_is_a_finite_number_beyond_the_range():
    ranges_mm = take(world=load_world("inside_corner"))
    assert ranges_mm[0] == NO_RETURN_MM
    assert take(LidarSettings(noise_std_m=0.0, range_max_m=5.0))[540] == NO_RETURN_MM
    assert not ((ranges_mm > 30_000) & (ranges_mm != NO_RETURN_MM)).any()


def test_one_seed_one_scan():
    settings = LidarSettings(noise_std_m=0.02, outlier_share=0.1, dropout_share=0.1, self_returns=True)
    np.testing.assert_array_equal(take(settings, seed=7), take(settings, seed=7))
    assert (take(settings, seed=7) != take(settings, seed=8)).any()


def test_noise_has_the_spread_it_was_given_and_no_bias():
    rng = np.random.default_rng(1)
    settings = LidarSettings(noise_std_m=0.03)
    scans_mm = [scan(LOOP, LOOP.start, STANDING, 0.0, rng, settings) for _ in range(50)]
    errors_m = np.array(scans_mm) / 1000 - true_ranges_m(LOOP, LOOP.start, STANDING, settings)
    assert errors_m.mean() == pytest.approx(0.0, abs=0.001)
    assert errors_m.std() == pytest.approx(0.03, rel=0.03)


def test_dropouts_and_outliers_come_in_their_shares():
    dropped = take(LidarSettings(noise_std_m=0.0, dropout_share=0.2), seed=3)
    assert (dropped == NO_RETURN_MM).mean() == pytest.approx(0.2, abs=0.05)
    wild = take(LidarSettings(noise_std_m=0.0, outlier_share=0.3), seed=3)
    assert (wild != take()).mean() == pytest.approx(0.3, abs=0.05)
    assert wild.max() <= 10_000


def test_dirt_hides_what_is_behind_it_and_only_there():
    dirty = take(LidarSettings(noise_std_m=0.0, dirty_sectors=((10.0, 12.0, 0.08), (-30.0, -29.0, 0.2))))
    clean = take()
    changed = dirty != clean
    assert changed.sum() == 9 + 5
    assert set(dirty[changed]) == {80, 200}
    assert (dirty[540 + 40 : 540 + 49] == 80).all()


def test_the_car_sees_itself_at_the_right_rear():
    ranges_mm = take(LidarSettings(self_returns=True))
    assert ((ranges_mm[:SELF_RETURN_BEAMS] >= 30) & (ranges_mm[:SELF_RETURN_BEAMS] <= 150)).all()
    assert ranges_mm[SELF_RETURN_BEAMS:].min() > 900


def test_sweep_time_of_a_ust_10lx():
    assert LidarSettings().sweep_s == pytest.approx(0.01875)


def test_skew_when_driving_straight_shifts_early_beams_back():
    moving = take(twist=Twist(speed_mps=4.0))
    ahead_ago_s = 0.01875 / 2
    assert moving[540] == pytest.approx(8730 + 4000 * ahead_ago_s, abs=1)
    assert moving[1080] == take()[1080]  # the last beam is measured now
    np.testing.assert_array_equal(take(LidarSettings(noise_std_m=0.0, motion_skew=False), twist=Twist(4.0)), take())


@pytest.mark.parametrize("twist", [Twist(2.0, 1.5), Twist(-0.5, -0.3), Twist(3.0, -2.0, 0.4)])
def test_skew_equals_a_lidar_that_is_moved_beam_by_beam(twist):
    end = LOOP.start
    skewed = true_ranges_m(LOOP, end, twist, PERFECT)
    for beam in range(0, 1081, 90):
        pose, steps = end, 400
        dt_s = PERFECT.sweep_s * (1 - beam / 1080) / steps
        for _ in range(steps):
            middle = Pose(pose.x_m, pose.y_m, pose.yaw_rad - twist.yaw_rate_radps * dt_s / 2)
            back = middle.ahead(-twist.speed_mps * dt_s, -twist.lateral_mps * dt_s)
            pose = Pose(back.x_m, back.y_m, pose.yaw_rad - twist.yaw_rate_radps * dt_s)
        lidar = pose.ahead(0.27)
        expected = LOOP.cast(lidar.x_m, lidar.y_m, np.array([pose.yaw_rad + math.radians(-135 + beam / 4)]))[0]
        assert skewed[beam] == pytest.approx(expected, abs=2e-5)


@pytest.mark.parametrize(
    "wrong",
    [{"beams": 1}, {"noise_std_m": -0.1}, {"dropout_share": 1.5}, {"first_deg": 10, "last_deg": 5}, {"colour": 1}],
)
def test_settings_are_closed_and_checked(wrong):
    with pytest.raises(ValidationError):
        LidarSettings(**wrong)


def test_a_scan_without_a_time_is_refused():
    with pytest.raises(ValueError, match="finite time"):
        scan(LOOP, LOOP.start, STANDING, math.nan, np.random.default_rng(0))
