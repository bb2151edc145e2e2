"""Scan matching over multiples of an assumed shift.

A search over a few dozen shifts instead of an iteration, because the question is which of several far answers is right,
and an iteration that begins at one of them stays there. A point of the later scan, shifted, is compared with the range
that the earlier one has at its bearing (projective association, Blais and Levine 1995). Own parts of the car would vote
for "stands": only what is before the shoulders counts. About 0.5 ms; not for the hot path.
"""

import math

import numpy as np

from wallride.drivers.api import Correction, Scan
from wallride.runtime.control.perception.geometry import Floats, points_m, sector
from wallride.runtime.control.perception.scan_displacement import places_anew

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
    if before.correction is not None and after.correction is not None:
        beam = np.arange(float(ahead.start), ahead.stop, ahead.step)[seen]
        motions = before.correction, after.correction
        points = _seen_by_share(motions, points, beam, beams, shares).repeat(turns_rad.size, axis=1)
    shifted_x_m = cos * points[0] - sin * points[1] + x_m[:, None]
    shifted_y_m = sin * points[0] + cos * points[1] + y_m[:, None]
    off_m = _off_m(before, shifted_x_m, shifted_y_m)
    by_turn_m = off_m.reshape(shares.size, turns_rad.size, -1)
    turn = by_turn_m.mean(axis=2).argmin(axis=1)
    fits_m = by_turn_m[np.arange(shares.size), turn]
    tells = np.ptp(fits_m, axis=0) > TELLS_M
    if np.count_nonzero(tells) < ENOUGH_TELL:
        return None
    misfit_m: Floats = fits_m[:, tells].mean(axis=1)
    return misfit_m


def _off_m(before: Scan, shifted_x_m: Floats, shifted_y_m: Floats) -> Floats:
    """Return how far points of a later scan are from the earlier one along its beams, of their shape; CAP_M at most."""
    place = (np.arctan2(shifted_y_m, shifted_x_m) - before.angle_min_rad) / before.angle_step_rad
    index = np.floor(place).astype(np.intp)
    known = (index >= 0) & (index < before.ranges_m.shape[0] - 1)
    index[~known] = 0
    # Between two beams a wall's 1 / range is straight; the nearest beam's range instead would favour no shift at all.
    nearness = 1.0 / before.ranges_m.astype(np.float64)
    first, share = nearness[index], place - index
    there_m = 1.0 / (first + share * (nearness[index + 1] - first))
    off_m = np.abs(np.hypot(shifted_x_m, shifted_y_m) - there_m)
    capped_m: Floats = np.where(known & (off_m < CAP_M), off_m, CAP_M)  # NaN is not smaller
    return capped_m


def _seen_by_share(
    motions: tuple[Correction, Correction], points: Floats, beam: Floats, beams: int, shares: Floats
) -> Floats:
    """Return points (2, n) of the later scan by each of the shares, (2, shares, n). motions: taken out of each.

    The driver of a slow lidar takes the wheels' motion out of a turn. Where only a share of it is true, what is wrong
    is alike in both scans but for the change of that motion, so this is taken out by its share only: a turn that the
    lidar shows again fits itself, however the wheels moved.
    """
    was, done = motions
    places = points[0] + 1j * points[1]
    seen = np.array([places_anew(places, beam, beams, done, _between(was, done, share))[0] for share in shares])
    return np.stack((seen.real, seen.imag))


def _between(was: Correction, done: Correction, share: float) -> Correction:
    """Return the motion that is this share of the way from one to another."""
    return Correction(
        was.x_mps + share * (done.x_mps - was.x_mps),
        was.y_mps + share * (done.y_mps - was.y_mps),
        was.yaw_rate_radps + share * (done.yaw_rate_radps - was.yaw_rate_radps),
        done.ray_s,
    )


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
