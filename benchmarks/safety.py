"""How long perception and safety take for one scan of 1081 beams. Run: python benchmarks/safety.py.

Median in microseconds, least of several runs, over scans of a corridor that ends in a corner (noise 0.02 m, 2 % wild
beams). "eyes" is shared with the follower; "look" is the rest of what is done once per scan; "limit" is the first
question about a drive; "again" is the same question at the next tick of the mux.
"""

import statistics
import time

import numpy as np

from drivers.api import MotorState
from runtime.car_settings import CarSettings
from runtime.control.perception import Eyes
from runtime.control.swept import SweptGuard
from runtime.control.swept_settings import SweptSettings
from sim.beams import LidarSettings, scan
from sim.closed_loop import as_scan
from sim.pose import Pose, Twist
from sim.worlds import load_world

SCANS = 200
RUNS = 7


def main() -> None:
    """Print a line per speed."""
    print(f"{'m/s':>4}{'eyes':>8}{'look':>8}{'limit':>8}{'sum':>8}{'again':>8}   us, median of {SCANS} scans")
    for speed_mps in (1.0, 2.0, 3.0, 4.0):
        runs = [drive(speed_mps) for _ in range(RUNS)]
        eyes, look, limit, total, again = (min(run[part] for run in runs) for part in range(5))
        print(f"{speed_mps:4.0f}{eyes:8.0f}{look:8.0f}{limit:8.0f}{total:8.0f}{again:8.0f}")


def drive(speed_mps: float) -> list[float]:
    """Return the medians of one drive toward the corner, in the order of the columns."""
    car, lidar, rng = CarSettings(), LidarSettings(noise_std_m=0.02, outlier_share=0.02), np.random.default_rng(5)
    world, eyes = load_world("l_turn"), Eyes(CarSettings())
    guard = SweptGuard(SweptSettings(), car, eyes)
    took: list[tuple[float, ...]] = []
    for step in range(SCANS):
        at, now_s = Pose(4.0 * step / SCANS, rng.uniform(-0.1, 0.1), rng.uniform(-0.1, 0.1)), step * 0.025
        sweep = as_scan(scan(world, at, Twist(speed_mps), now_s, rng, lidar), lidar, now_s, step)
        motor = MotorState(
            now_s, speed_mps, step * speed_mps * 0.025, 0.05, 11.1, 0.0, 0.0, 30.0, "", timed_out=False, killed=False
        )
        times_s = [time.perf_counter()]
        eyes.see(sweep)
        times_s.append(time.perf_counter())
        outlook = guard.look(sweep, motor)
        times_s.append(time.perf_counter())
        outlook.limit(speed_mps, 0.05)
        times_s.append(time.perf_counter())
        outlook.limit(speed_mps, 0.05)
        times_s.append(time.perf_counter())
        seen, looked, judged, again = np.diff(times_s)
        took.append((seen, looked, judged, seen + looked + judged, again))
    return [1e6 * statistics.median(part) for part in zip(*took, strict=True)]


if __name__ == "__main__":
    main()
