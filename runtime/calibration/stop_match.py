"""Motion of the lidar between two standstills, to millimetres: averaged scans, surfaces as lines through many beams."""

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from wallride.runtime.calibration.scan_motion import Kind, ReferenceScan, Shift, lay_over, motion_of_scans
from wallride.runtime.calibration.trace import Stop, Trace, median_ranges_m
from wallride.runtime.control.perception.geometry import Booleans, Floats, directions

REACH = 8
"""Number of beams on each side of a surface's middle beam."""
MAX_MISSING = 4
MAX_WIDTH_M, MAX_BEND_M = 0.6, 0.02
GUESS_WEIGHT = 0.01
POINT_STD_M = 0.03
"""Standard deviation of one point's distance to a surface; neighbours share most of their error, hence so much."""
MIN_RANGE_M, MAX_RANGE_M = 0.3, 12.0
MIN_SHARE, UNTOLD_M = 0.02, 1.0
"""Least information along one direction as a share of that across it; below it noise in the normals of parallel walls
is all there is (0.004 in a bare corridor, 0.35 in a room), and the motion along them has this standard deviation."""
FLOOR_M, FLOOR_RAD = 0.0015, 0.0007
"""Standard deviations that no averaging undercuts: tyres give, and floors are not level."""


@dataclass(frozen=True, slots=True)
class MeasuredShift:
    """Motion of the lidar in its earlier frame, with standard deviations [m, m, rad]; infinite where nothing tells."""

    shift: Shift
    std: Shift


def measure_shift(trace: Trace, before: Stop, after: Stop, ignored: Booleans | None = None) -> MeasuredShift | None:
    """Return the motion between two stops; None where the scans between them are missing.

    ignored: (beams,), beams that see the car itself.
    """
    way = trace.between(before.to_s - 0.1, after.from_s + 0.1)
    if len(way.scan_s) < 2:
        return None
    ranges_m = _without(way.ranges_m.astype(np.float64), ignored)
    chain = motion_of_scans(way.scan_s, ranges_m, trace.kind, MAX_RANGE_M)
    guess = np.array([chain.x_m[-1], chain.y_m[-1], chain.yaw_rad[-1]])
    return match_stops(trace.kind, _usable(before, ignored), _usable(after, ignored), guess)


def tells_way(kind: Kind, scans_m: npt.NDArray[np.floating[Any]]) -> bool:
    """Return whether scans (n, beams) of a standing car would tell how far it goes ahead."""
    standing_m = _usable(Stop(0.0, 0.0, 0.0, median_ranges_m(scans_m)), None)
    return match_stops(kind, standing_m, standing_m, np.zeros(3)).std[0] < UNTOLD_M / 2


def match_stops(kind: Kind, before_m: Floats, after_m: Floats, guess: Floats) -> MeasuredShift:
    """Return the motion between two averaged scans, (beams,) each. guess: within 0.2 m of it, (3,)."""
    rays = directions(*kind)
    forth, information = lay_over(
        surfaces(rays * before_m), surfaces(rays * after_m).points_m, guess, kind, GUESS_WEIGHT
    )
    back, _ = lay_over(
        surfaces(rays * after_m), surfaces(rays * before_m).points_m, _inverse(forth), kind, GUESS_WEIGHT
    )
    both = (forth + _inverse(back)) / 2  # either direction sees surfaces that the other does not
    variance = np.diag(np.linalg.pinv(information + 1e-6 * np.eye(3))) * POINT_STD_M**2
    floor = np.array([FLOOR_M, FLOOR_M, FLOOR_RAD])
    untold = np.append(_untold_m(information[:2, :2]), 0.0)
    std = np.sqrt(variance + floor**2 + untold**2 + ((forth - both) ** 2))
    return MeasuredShift(_shift(both), _shift(std))


def _untold_m(information: Floats) -> Floats:
    """Return the standard deviation of what parallel walls do not tell, (2,) x and y; zeros where all is told."""
    (least, most), axes = np.linalg.eigh(information)
    untold_m: Floats = np.abs(axes[:, 0]) * (UNTOLD_M if least < MIN_SHARE * most else 0.0)
    return untold_m


def surfaces(points_m: Floats, reach: int = REACH, max_bend_m: float = MAX_BEND_M) -> ReferenceScan:
    """Return lines through the points of 2 * reach + 1 neighbouring beams: their middles and normals.

    points_m: (2, ..., beams). Total least squares in a sliding window. max_bend_m: standard deviation from a line.
    """
    known = np.isfinite(points_m[0])
    x_m, y_m = np.where(known, points_m, 0.0)
    count = window_sums(known.astype(float), reach)
    with np.errstate(invalid="ignore", divide="ignore"):
        mean_x, mean_y = window_sums(x_m, reach) / count, window_sums(y_m, reach) / count
        xx, yy = window_sums(x_m * x_m, reach) / count - mean_x**2, window_sums(y_m * y_m, reach) / count - mean_y**2
        xy = window_sums(x_m * y_m, reach) / count - mean_x * mean_y
    angle_rad = 0.5 * np.arctan2(2.0 * xy, xx - yy)  # of the line
    half, root = (xx + yy) / 2, np.hypot((xx - yy) / 2, xy)
    bend_m, width_m = np.sqrt(np.maximum(half - root, 0.0)), np.sqrt(12.0 * np.maximum(half + root, 0.0))
    most_missing = MAX_MISSING * reach // REACH
    usable = known & (count >= 2 * reach + 1 - most_missing) & (bend_m < max_bend_m) & (width_m < MAX_WIDTH_M)
    middles = np.where(usable, np.stack([mean_x, mean_y]), np.nan)
    return ReferenceScan(middles, np.stack([-np.sin(angle_rad), np.cos(angle_rad)]), usable)


def window_sums(values: Floats, reach: int) -> Floats:
    """Return the sums over the window of each beam, (..., beams)."""
    before, after = (np.zeros((*values.shape[:-1], count)) for count in (reach + 1, reach))
    total: Floats = np.cumsum(np.concatenate([before, values, after], axis=-1), axis=-1)
    return total[..., 2 * reach + 1 :] - total[..., : -2 * reach - 1]


def _usable(stop: Stop, ignored: Booleans | None) -> Floats:
    ranges_m = _without(stop.ranges_m, ignored)
    with np.errstate(invalid="ignore"):
        return np.where((ranges_m >= MIN_RANGE_M) & (ranges_m <= MAX_RANGE_M), ranges_m, np.nan)


def _without(ranges_m: Floats, ignored: Booleans | None) -> Floats:
    return ranges_m if ignored is None else np.where(ignored, np.nan, ranges_m)


def _inverse(shift: Floats) -> Floats:
    cos, sin = math.cos(shift[2]), math.sin(shift[2])
    return np.array([-cos * shift[0] - sin * shift[1], sin * shift[0] - cos * shift[1], -shift[2]])


def _shift(values: Floats) -> Shift:
    return float(values[0]), float(values[1]), float(values[2])
