"""Path from above, among the walls seen by the lidar."""

import math

import numpy as np
import numpy.typing as npt

from wallride.sim.replay.figures import at_time, points
from wallride.sim.replay.run import RecordedRun
from wallride.sim.run_report.above import Above, from_above
from wallride.sim.run_report.shown import Shown
from wallride.sim.world.pose import Floats

TALLEST_PATH_PX = 620
MAP_EVERY_M = 0.5
MAX_MAP_SCANS = 120
FARTHEST_DOT_M = 12.0
BODY_M = 0.1


def track(shown: Shown, width: int) -> str:
    """Return the drawing; numbers are stops."""
    run, path = shown.run, shown.run.path
    dots_x_m, dots_y_m = _map(run)
    places = []
    for number, stop in enumerate(shown.found, 1):
        x_m, y_m = (at_time(path.time_s, column, stop.from_s) for column in (path.x_m, path.y_m))
        if math.isfinite(x_m):
            places.append((x_m, y_m, str(number)))
    return from_above(Above(dots_x_m, dots_y_m, path.x_m, path.y_m, places), width, tallest=TALLEST_PATH_PX)


def _map(run: RecordedRun) -> tuple[Floats, Floats]:
    """Return the points of a scan every half metre or so, placed by the odometry."""
    path, last, xs, ys = run.path, None, [], []
    every_m = max(MAP_EVERY_M, float(np.hypot(np.diff(path.x_m), np.diff(path.y_m)).sum()) / MAX_MAP_SCANS)
    for time_s, message in run.scans:
        x_m, y_m, yaw_rad = (at_time(path.time_s, column, time_s) for column in (path.x_m, path.y_m, path.yaw_rad))
        if not math.isfinite(x_m) or (last is not None and math.dist(last, (x_m, y_m)) < every_m):
            continue
        last = x_m, y_m
        seen_x_m, seen_y_m = points(message, run.settings.car)
        near = (np.hypot(seen_x_m, seen_y_m) < FARTHEST_DOT_M) & ~_on_itself(seen_x_m, seen_y_m, run)
        cos, sin = math.cos(yaw_rad), math.sin(yaw_rad)
        xs.append(x_m + cos * seen_x_m[near] - sin * seen_y_m[near])
        ys.append(y_m + sin * seen_x_m[near] + cos * seen_y_m[near])
    return (np.concatenate(xs), np.concatenate(ys)) if xs else (np.empty(0), np.empty(0))


def _on_itself(x_m: Floats, y_m: Floats, run: RecordedRun) -> npt.NDArray[np.bool_]:
    """Return the points that are the car's own body, or as near as dirt."""
    car = run.settings.car
    ahead, aside = x_m < car.front_m + BODY_M, np.abs(y_m) < car.half_width_m + BODY_M
    return ahead & aside & (x_m > -car.rear_m - BODY_M)
