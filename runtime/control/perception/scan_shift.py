"""Scan matching over multiples of an assumed shift.

A search over a few dozen shifts instead of an iteration, because the question is which of several far answers is right,
and an iteration that begins at one of them stays there. A point of the later scan, shifted, is compared with the range
that the earlier one has at its bearing (projective association, Blais and Levine 1995). Own parts of the car would vote
for "stands": only what is before the shoulders counts. About 0.5 ms; not for the hot path.
"""

import math

import numpy as np

from wallride.drivers.api import Scan
from wallride.runtime.control.perception.geometry import Floats, points_m, sector

Shift = tuple[float, float, float]
"""Shift x_m, y_m, yaw_rad of base_link, in its earlier frame."""

BEFORE_RAD = math.radians(95)
MIN_RANGE_M, MAX_RANGE_M = 0.15, 10.0
POINTS = 150
ENOUGH_POINTS = 40
CAP_M = 0.1
"""Maximum misfit of one point: beyond it a point only counts as not fitting, because people walk and edges hide."""
TELLS_M, ENOUGH_TELL = 0.05, 12
"""Minimum difference, and minimum number, of informative points: a point on a wall parallel to the motion fits at any
shift."""


def misfits_m(
    before: Scan, after: Scan, moved: Shift, lidar_m: complex, shares: Floats, turns_rad: Floats
) -> Floats | None:
    """Return the mean distance between the scans at each of the shares, (shares,), at the best turn.

    moved: base_link's shift between the scans as supposed. turns_rad: added to the supposed heading: slip, a servo that
    lags. None where too few points are seen, or the scans are not of one kind.
    """
    beams = before.ranges_m.shape[0]
    if after.ranges_m.shape[0] != beams or after.angle_min_rad != before.angle_min_rad:
        return None
    ahead = sector(after, -BEFORE_RAD, BEFORE_RAD)
    ahead = slice(ahead.start, ahead.stop, max(1, (ahead.stop - ahead.start) // POINTS))
    range_m = after.ranges_m[ahead]
    seen = (range_m > MIN_RANGE_M) & (range_m < MAX_RANGE_M)
    points = points_m(after, ahead)[:, seen]
    if points.shape[1] < ENOUGH_POINTS:
        return None
    x_m, y_m, yaw_rad = _lidar_shifts(moved, lidar_m, shares, turns_rad)
    cos, sin = np.cos(yaw_rad)[:, None], np.sin(yaw_rad)[:, None]
    shifted_x_m = cos * points[0] - sin * points[1] + x_m[:, None]
    shifted_y_m = sin * points[0] + cos * points[1] + y_m[:, None]
    place = (np.arctan2(shifted_y_m, shifted_x_m) - before.angle_min_rad) / before.angle_step_rad
    index = np.floor(place).astype(np.intp)
    known = (index >= 0) & (index < beams - 1)
    index[~known] = 0
    # Between two beams a wall's 1 / range is straight; the nearest beam's range instead would favour no shift at all.
    nearness = 1.0 / before.ranges_m.astype(np.float64)
    first, share = nearness[index], place - index
    there_m = 1.0 / (first + share * (nearness[index + 1] - first))
    off_m = np.abs(np.hypot(shifted_x_m, shifted_y_m) - there_m)
    off_m = np.where(known & (off_m < CAP_M), off_m, CAP_M)  # NaN is not smaller
    by_turn_m = off_m.reshape(shares.size, turns_rad.size, -1)
    turn = by_turn_m.mean(axis=2).argmin(axis=1)
    fits_m = by_turn_m[np.arange(shares.size), turn]
    tells = np.ptp(fits_m, axis=0) > TELLS_M
    if np.count_nonzero(tells) < ENOUGH_TELL:
        return None
    misfit_m: Floats = fits_m[:, tells].mean(axis=1)
    return misfit_m


def _lidar_shifts(moved: Shift, lidar_m: complex, shares: Floats, turns_rad: Floats) -> tuple[Floats, Floats, Floats]:
    """Return x_m, y_m and yaw_rad of the lidar for every share and turn, (shares x turns,).

    The share s of an arc: along it s times, aside s^2 times, turned s times.
    """
    turn_rad = np.tile(turns_rad, shares.size)
    share = np.repeat(shares, turns_rad.size)
    yaw_rad = share * moved[2] + turn_rad
    x_m = share * moved[0] + lidar_m.real * (np.cos(yaw_rad) - 1.0) - lidar_m.imag * np.sin(yaw_rad)
    y_m = share * share * moved[1] + lidar_m.real * np.sin(yaw_rad) + lidar_m.imag * (np.cos(yaw_rad) - 1.0)
    return x_m, y_m, yaw_rad
