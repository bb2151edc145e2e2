"""Error of the follower's first distance with respect to the world, in spite of returns of the car's own parts.

The wall's line alone is no truth: a box before the wall is nearer, a wall that begins ahead of the axle is farther away
than its line, and in clutter a line is chance. So a distance is right that is the line's, or that of the nearest thing
of the world beside the car or anywhere. Own parts and dirt are distinguished from the world by hindsight, from the
whole recording. A car that never moved gives no such evidence; its pictures have to be inspected.
"""

import math

import numpy as np

from benchmarks.lab.recorded.replay import JudgedScan, Replay
from wallride.runtime.control.perception.view import ViewCache
from wallride.runtime.control.vehicle import CarSettings
from wallride.runtime.control.wall_following.followed_wall import SIDE_FROM_RAD, SIDE_TO_RAD, side_view
from wallride.sim.recordings.scans import wall_line


def first_offsets_m(done: Replay) -> tuple[float, float]:
    """Return the first distance less the wall's line's, and less that of the nearest candidate; NaN without a wall."""
    first = next((judged for judged in done.judged if math.isfinite(judged.distance_m)), None)
    if first is None:
        return math.nan, math.nan
    line_m = first.line.distance_m if first.line is not None else math.nan
    offsets_m = [first.distance_m - truth_m for truth_m in _truths_m(first, done) if math.isfinite(truth_m)]
    return first.distance_m - line_m, min(offsets_m, key=abs, default=math.nan)


def _truths_m(judged: JudgedScan, done: Replay) -> tuple[float, float, float]:
    """Return the distance of the wall's line, of the nearest thing beside the car, and of the nearest anywhere."""
    eyes = ViewCache(CarSettings())
    eyes.ignore(done.parts)
    view = eyes.see(judged.scan)
    line, seen = wall_line(view, done.side), side_view(view, done.side)
    bearing_rad = seen.side.bearing_rad
    beside = seen.solid & (bearing_rad >= SIDE_FROM_RAD) & (bearing_rad <= SIDE_TO_RAD)
    away_m = np.hypot(seen.x_m, seen.y_m)
    return (
        line.distance_m if line is not None else math.nan,
        float(away_m[beside].min(initial=math.inf)),
        float(away_m[seen.solid].min(initial=math.inf)),
    )
