"""Along whole drives, and through nonsense, the twins answer what the Python answers."""

import math

import numpy as np
import pytest
from hypothesis import HealthCheck, example, given, settings
from hypothesis import strategies as st

from tests.runtime.kernel.sameness import Drive, ranges
from tests.tiers import slow
from wallride.sim.virtual.closed_loop import as_scan
from wallride.sim.world.beams import LidarSettings, scan
from wallride.sim.world.pose import Pose, Twist
from wallride.sim.world.worlds import load_world


@pytest.mark.parametrize(
    ("world", "side"),
    [
        *(("l_turn", "left"), ("corridor", "right"), ("doorway", "left"), ("outside_corner", "right")),
        *slow(("l_turn", "right"), ("corridor", "left"), ("doorway", "right"), ("outside_corner", "left")),
        *(("straight", "left"), *slow(("straight", "right"))),
    ],
)
def test_a_drive_gets_the_same_answers(compared, world, side):
    rng = np.random.default_rng(3)
    lidar = LidarSettings(noise_std_m=0.02, outlier_share=0.02, dirty_sectors=((-96.0, -93.0, 0.3), (40.0, 41.0, 0.2)))
    drive, geometry = Drive(side), load_world(world, side=side)
    for step in range(40):
        at_s = 0.025 * step
        pose = Pose(0.14 * step, rng.uniform(-0.1, 0.1), rng.uniform(-0.2, 0.2))
        drive.see(as_scan(scan(geometry, pose, Twist(2.0), at_s, rng, lidar), lidar, at_s, step))
    hot = {
        "view_scan", "find_small_clusters", "find_thin_places", "solid_places", "any_nearer", "sweep_arc",
        "find_followed_wall", "predict_motion",
    }  # fmt: skip
    assert {name for name in hot if compared[name] < 30} == set()
    assert compared["roll_ball"] == compared["drive_along_ball"] > 7  # where there is a wall


@settings(
    max_examples=25, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture, HealthCheck.too_slow]
)
@given(
    side=st.sampled_from(["left", "right"]), seed=st.integers(0, 2**32), speed_mps=st.floats(-0.5, 4.0),
    steering_rad=st.floats(-0.34, 0.34),
)  # fmt: skip
@example(side="left", seed=124336124, speed_mps=0.0, steering_rad=0.0)  # a place exactly at the edge of the view
def test_nonsense_gets_the_same_answers(compared, side, seed, speed_mps, steering_rad):
    drive = Drive(side)
    for scan_number in range(7):  # the same room again and again, so that things are seen again
        drive.see_ranges(ranges(seed + scan_number // 5), speed_mps=speed_mps, steering_rad=steering_rad)


@pytest.mark.parametrize("beams", [1, 2, 5])
def test_hardly_any_beam_gets_the_same_answers(compared, beams):
    drive = Drive()
    for ranges_m in (np.full(beams, 1.0), np.full(beams, math.nan), np.full(beams, 0.1)):
        drive.see_ranges(ranges_m)
