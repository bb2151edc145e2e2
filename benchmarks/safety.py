"""Duration of perception and safety for one scan of 1081 beams. Run: python benchmarks/safety.py.

Microseconds: for every scan the least of several runs over the same scans (so that a busy machine does not count), of
these the median; scans of a corridor that ends in a corner (noise 0.02 m, 2 % wild beams). "eyes" is shared with the
follower; "window" is the learning of the lidar's window; "look" is the rest of the work per scan; "limit" is the first
query about a drive; "sum" is all of these; "again" is the same query at the next tick of the mux.
"""

import time

import numpy as np

from wallride.drivers.api import MotorState
from wallride.runtime import kernel
from wallride.runtime.control.perception.lidar_health import LidarHealth
from wallride.runtime.control.perception.view import View
from wallride.runtime.control.safety.swept import SweptGuard
from wallride.runtime.control.safety.swept_settings import SweptSettings
from wallride.runtime.control.vehicle import CarSettings
from wallride.sim.virtual.closed_loop import as_scan
from wallride.sim.world.beams import LidarSettings, scan
from wallride.sim.world.pose import Pose, Twist
from wallride.sim.world.worlds import load_world

SCANS = 200
RUNS = 15
COLUMNS = ("eyes", "window", "look", "limit", "sum", "again")


class TimedStop:
    """Model of the window, with a stopwatch."""

    def __init__(self, health: LidarHealth) -> None:
        self._health = health
        self.took_s = 0.0

    def __getattr__(self, name: str) -> object:
        return getattr(self._health, name)

    def update(self, view: View, motor: MotorState | None, *, scene_stands: bool) -> None:
        """Learn from one scan, and record the duration."""
        began_s = time.perf_counter()
        self._health.update(view, motor, scene_stands=scene_stands)
        self.took_s = time.perf_counter() - began_s


def main() -> None:
    """Print a line per speed."""
    print(kernel.state().words)  # WALLRIDE_COMPILED=0: in Python
    print(f"{'m/s':>4}" + "".join(f"{name:>8}" for name in COLUMNS) + f"   us, median of {SCANS} scans")
    for speed_mps in (1.0, 2.0, 3.0, 4.0):
        least_s = np.min([drive(speed_mps) for _ in range(RUNS)], axis=0)
        times_us = 1e6 * np.median(least_s, axis=0)
        print(f"{speed_mps:4.0f}" + "".join(f"{time_us:8.0f}" for time_us in times_us))


def drive(speed_mps: float) -> list[tuple[float, ...]]:
    """Return the seconds of one drive toward the corner, a row for each scan, in the order of the columns."""
    lidar, rng = LidarSettings(noise_std_m=0.02, outlier_share=0.02), np.random.default_rng(5)
    world = load_world("l_turn")
    guard = SweptGuard(SweptSettings(), CarSettings())
    health = TimedStop(guard.perception.health)
    guard.perception.health = health  # type: ignore[assignment]  # behaves like it
    took: list[tuple[float, ...]] = []
    for step in range(SCANS):
        at, now_s = Pose(4.0 * step / SCANS, rng.uniform(-0.1, 0.1), rng.uniform(-0.1, 0.1)), step * 0.025
        sweep = as_scan(scan(world, at, Twist(speed_mps), now_s, rng, lidar), lidar, now_s, step)
        motor = MotorState(now_s, speed_mps, step * speed_mps * 0.025, 0.05, 11.1, 0.0, 0.0, 30.0)
        times_s = [time.perf_counter()]
        guard.perception.views.see(sweep)
        times_s.append(time.perf_counter())
        assessment = guard.look(sweep, motor)
        times_s.append(time.perf_counter())
        _, memory = assessment.judge(speed_mps, 0.05, assessment.memory)
        times_s.append(time.perf_counter())
        assessment.commit(assessment.judge(speed_mps, 0.05, memory)[1])
        times_s.append(time.perf_counter())
        seen, looked, judged, again = np.diff(times_s)
        took.append((seen, health.took_s, looked - health.took_s, judged, seen + looked + judged, again))
    return took


if __name__ == "__main__":
    main()
