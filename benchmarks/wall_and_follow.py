"""How long wall estimation and the ball follower take for one scan of 1081 beams.

Run from the repository: `python benchmarks/wall_and_follow.py`.

Median of each of several runs in microseconds, after a warm-up, over scans of a corridor that ends in a corner (noise
0.02 m, 2 % wild beams). "eyes" is the perception that safety shares, so it is timed apart and left out of "follow".
"""

import statistics
import time

import numpy as np

from drivers.api import MotorState
from runtime.car_settings import CarSettings
from runtime.control.ball import BallFollower
from runtime.control.ball_settings import BallSettings
from runtime.control.my_wall import side_view
from runtime.control.perception import Eyes
from sim.beams import LidarSettings, scan
from sim.closed_loop import as_scan
from sim.pose import Pose, Twist
from sim.worlds import load_world

SCANS = 200
RUNS = 7


def main() -> None:
    """Print a line per part."""
    car, lidar = CarSettings(), LidarSettings(noise_std_m=0.02, outlier_share=0.02)
    world, rng = load_world("l_turn"), np.random.default_rng(5)
    places = [Pose(6.5 * i / SCANS, rng.uniform(-0.1, 0.1), rng.uniform(-0.1, 0.1)) for i in range(SCANS)]
    sweeps = [
        as_scan(scan(world, at, Twist(2.0), i * 0.025, rng, lidar), lidar, i * 0.025, i) for i, at in enumerate(places)
    ]
    motor = MotorState(0.0, 2.0, 0.0, 0.05, 11.1, 0.0, 0.0, 30.0, "", timed_out=False, killed=False)
    results: dict[str, list[float]] = {"eyes": [], "wall line": [], "follow (line and all)": []}
    for _ in range(RUNS + 1):
        eyes = Eyes(car)
        follower = BallFollower(BallSettings(speed_mps=2.0), car, eyes)
        took: dict[str, list[float]] = {name: [] for name in results}
        for sweep in sweeps:
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
