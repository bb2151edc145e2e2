"""Path from above, among the walls seen by the lidar."""

import itertools
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
MAX_MAP_SCANS, MIN_MAP_SCANS = 120, 30
MAX_PIECES = 30
LONG_S, SHORT_S = 90.0, 2.0
FARTHEST_DOT_M = 12.0
BODY_M = 0.1


def track(shown: Shown, width: int) -> str:
    """Return the drawing; numbers are stops.

    Of several laps, or parts of a long drive whose path drifts, each has its own: one drawing of all would show every
    wall several times. The page's script shows the one at the cursor.
    """
    pieces = spans(shown)
    if len(pieces) == 1:
        return _drawing(shown, width, pieces[0][1:], MAX_MAP_SCANS)
    scans = max(MIN_MAP_SCANS, MAX_MAP_SCANS // len(pieces))
    parts = "".join(
        f'<div class="lap" data-from="{from_s:.3f}" data-until="{until_s:.3f}"><h3>{title}</h3>'
        f"{_drawing(shown, width, (from_s, until_s), scans)}</div>"
        for title, from_s, until_s in pieces
    )
    return f'<div class="laps">{parts}</div>'


def spans(shown: Shown) -> list[tuple[str, float, float]]:
    """Return title, beginning and end [s] of each lap, or of parts of equal length of a long drive without laps."""
    until_s, ends_s = shown.run.duration_s, list(shown.laps_s)[: MAX_PIECES - 1]
    if len(ends_s) > 1:
        whole = [("", 0.0), *((f"lap {number}", end_s) for number, end_s in enumerate(ends_s, 1))]
        found = [(title, began_s, end_s) for (_, began_s), (title, end_s) in itertools.pairwise(whole)]
        return [*found, *([("after the last lap", ends_s[-1], until_s)] if until_s - ends_s[-1] > SHORT_S else [])]
    count = min(MAX_PIECES, math.ceil(until_s / LONG_S))
    if count < 2 or not shown.run.path.drifts:
        return [("", 0.0, math.inf)]
    length_s = until_s / count
    return [(f"part {n + 1} of {count}", n * length_s, (n + 1) * length_s) for n in range(count)]


def _drawing(shown: Shown, width: int, span_s: tuple[float, float], scans: int) -> str:
    run, path, (from_s, until_s) = shown.run, shown.run.path, span_s
    inside = (path.time_s >= from_s) & (path.time_s <= until_s)
    dots_x_m, dots_y_m = _map(run, span_s, scans)
    places = []
    for number, stop in enumerate(shown.found, 1):
        x_m, y_m = (at_time(path.time_s, column, stop.from_s) for column in (path.x_m, path.y_m))
        if math.isfinite(x_m) and from_s <= stop.from_s <= until_s:
            places.append((x_m, y_m, str(number)))
    view = Above(dots_x_m, dots_y_m, path.x_m[inside], path.y_m[inside], places)
    return from_above(view, width, tallest=TALLEST_PATH_PX)


def _map(run: RecordedRun, span_s: tuple[float, float], most: int) -> tuple[Floats, Floats]:
    """Return the points of a scan every half metre or so of a span, placed by the odometry; of `most` scans."""
    path, last, xs, ys = run.path, None, [], []
    inside = (path.time_s >= span_s[0]) & (path.time_s <= span_s[1])
    way_m = float(np.hypot(np.diff(path.x_m[inside]), np.diff(path.y_m[inside])).sum())
    every_m = max(MAP_EVERY_M, way_m / most)
    for time_s, message in run.scans:
        if not span_s[0] <= time_s <= span_s[1]:
            continue
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
