"""Duration of wall estimation and of the ball follower for one scan of 1081 beams.

Run from the repository: `python benchmarks/wall_and_follow.py`.

Median of each of several runs in microseconds, after a warm-up, over the scans of a drive at 2 m/s along a corridor
that ends in a corner, weaving by 0.1 m (noise 0.02 m, 2 % wild beams). "eyes" is the perception that safety shares, so
it is timed apart and left out of "follow"; "wall line" is the vote of a scan without prior knowledge.
"""

import math
import statistics
import time

import numpy as np

from wallride.drivers.api import MotorState, Scan
from wallride.runtime import kernel
from wallride.runtime.control.perception.view import ViewCache
from wallride.runtime.control.vehicle import CarSettings
from wallride.runtime.control.wall_following.ball import BallFollower
from wallride.runtime.control.wall_following.ball_settings import BallSettings
from wallride.runtime.control.wall_following.followed_wall import side_view
from wallride.sim.virtual.closed_loop import as_scan
from wallride.sim.world.beams import LidarSettings, scan
from wallride.sim.world.pose import Pose, Twist
from wallride.sim.world.worlds import load_world

RUNS = 7
WAY_M = 6.5
STEP_M = 0.05
WEAVE_M, WEAVE_PER_M = 0.1, 1.0
SPEED_MPS = 2.0


def drive() -> list[tuple[Scan, MotorState]]:
    """Return the scans of a drive, and the motor state at each."""
    car, lidar = CarSettings(), LidarSettings(noise_std_m=0.02, outlier_share=0.02)
    world, rng = load_world("l_turn"), np.random.default_rng(5)
    seen = []
    for i in range(round(WAY_M / STEP_M)):
        way_m, at_s = i * STEP_M, i * STEP_M / SPEED_MPS
        phase = WEAVE_PER_M * way_m
        pose = Pose(way_m, WEAVE_M * math.sin(phase), math.atan(WEAVE_M * WEAVE_PER_M * math.cos(phase)))
        steering_rad = math.atan(-car.wheelbase_m * WEAVE_M * WEAVE_PER_M**2 * math.sin(phase))
        motor = MotorState(at_s, SPEED_MPS, way_m, steering_rad, 11.1, 0.0, 0.0, 30.0)
        seen.append((as_scan(scan(world, pose, Twist(SPEED_MPS), at_s, rng, lidar), lidar, at_s, i), motor))
    return seen


def main() -> None:
    """Print a line per part."""
    print(kernel.state().words)  # WALLRIDE_COMPILED=0: in Python
    car, sweeps = CarSettings(), drive()
    results: dict[str, list[float]] = {"eyes": [], "wall line": [], "follow (line and all)": []}
    for _ in range(RUNS + 1):
        eyes = ViewCache(car)
        follower = BallFollower(BallSettings(speed_mps=SPEED_MPS), car, eyes)
        took: dict[str, list[float]] = {name: [] for name in results}
        for sweep, motor in sweeps:
            start_s = time.perf_counter()
            view = eyes.see(sweep)
            took["eyes"].append(time.perf_counter() - start_s)
            seen = side_view(view, "left")
            start_s = time.perf_counter()
            seen.side.lines.find(seen.x_m, seen.y_m, seen.range_m, seen.solid)
            took["wall line"].append(time.perf_counter() - start_s)
            start_s = time.perf_counter()
            follower.follow(sweep, motor)
            took["follow (line and all)"].append(time.perf_counter() - start_s)
        for name, times_s in took.items():
            results[name].append(1e6 * statistics.median(times_s))
    for name, medians_us in results.items():
        print(f"{name:24s}" + "  ".join(f"{us:6.0f}" for us in medians_us[1:]) + "  us")


if __name__ == "__main__":
    main()
