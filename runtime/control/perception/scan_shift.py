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
from wallride.runtime.control.perception.scan_displacement import places_anew

Shift = tuple[float, float, float]
"""Shift x_m, y_m, yaw_rad of base_link, in its earlier frame."""

BEFORE_RAD = math.radians(95)
MIN_RANGE_M, MAX_RANGE_M = 0.15, 10.0
POINTS = 150
ENOUGH_POINTS = 40
CAP_M = 0.1
"""Maximum misfit of one point: beyond it a point only counts as not fitting, because people walk and edges hide."""
HOLE_RAD = math.radians(1.1)
"""Maximum hole in the earlier scan that is bridged. Beams that are lost now and then, as in dust, would else be misfits
wherever a point meets them, and a stored scan with such beams would not stand."""
FITS_M, FITS_NOT_M = 0.03, 0.09
"""Maximum misfit of a point that votes for a motion, and minimum misfit of the same point in the other one."""
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
    seen = _points(before, after)
    if seen is None:
        return None
    off_m = _off_m(before, *_shifted(seen[0], moved, lidar_m, shares, turns_rad))
    by_turn_m = off_m.reshape(shares.size, turns_rad.size, -1)
    turn = by_turn_m.mean(axis=2).argmin(axis=1)
    fits_m = by_turn_m[np.arange(shares.size), turn]
    tells = np.ptp(fits_m, axis=0) > TELLS_M
    if np.count_nonzero(tells) < ENOUGH_TELL:
        return None
    misfit_m: Floats = fits_m[:, tells].mean(axis=1)
    return misfit_m


def votes(
    before: Scan, after: Scan, moved: Shift, lidar_m: complex, shares: Floats, turns_rad: Floats
) -> tuple[int, int] | None:
    """Return how many points fit only where the scene stands, and how many only where it moves, by its best share.

    For a lidar whose driver takes the wheels' motion out of its turns, which makes a different scan of every showing of
    a stored one: it stands where the same motion is taken out of both. None as of `misfits_m`, or without a correction.

    A sample lies up to half a beam beside its beam's direction, as in the turn before where head and samples are in
    step: on walls along the way that is decimetres, which fit a scene that stands and no other. Points with steps so
    large to the next beams have no vote.
    """
    seen, done, wanted = _points(before, after), after.correction, before.correction
    if seen is None or done is None or wanted is None:
        return None
    points, beam = seen
    places_m, _ = places_anew(points[0] + 1j * points[1], beam, after.ranges_m.size, done, wanted)
    still_m = _off_m(before, places_m.real, places_m.imag)
    turning = _shifted(points, moved, lidar_m, shares, turns_rad)
    straight = _shifted(points, (moved[0], 0.0, 0.0), lidar_m, shares, np.zeros(1))  # the heading at which all stands
    moving_m = _off_m(before, *(np.concatenate(both) for both in zip(turning, straight, strict=True)))
    exact = _steps_m(after)[beam.astype(np.intp)] < FITS_NOT_M
    stands = np.count_nonzero((still_m < FITS_M) & (moving_m > FITS_NOT_M) & exact, axis=1)
    moves = np.count_nonzero((still_m > FITS_NOT_M) & (moving_m < FITS_M) & exact, axis=1)
    best = int(np.argmax(moves - stands))
    return int(stands[best]), int(moves[best])


def _steps_m(scan: Scan) -> Floats:
    """Return how far each range is from the nearer of its neighbours', (beams,): along the surface that it is on."""
    steps_m = np.pad(np.abs(np.diff(scan.ranges_m.astype(np.float64))), 1, constant_values=np.nan)
    nearer_m: Floats = np.fmin(steps_m[:-1], steps_m[1:])
    return nearer_m


def _points(before: Scan, after: Scan) -> tuple[Floats, Floats] | None:
    """Return the points of a scan that count, (2, n), and their beams; None: too few, or scans of different kinds."""
    beams = before.ranges_m.shape[0]
    if after.ranges_m.shape[0] != beams or after.angle_min_rad != before.angle_min_rad:
        return None
    ahead = sector(after, -BEFORE_RAD, BEFORE_RAD)
    ahead = slice(ahead.start, ahead.stop, max(1, (ahead.stop - ahead.start) // POINTS))
    range_m = after.ranges_m[ahead]
    seen = (range_m > MIN_RANGE_M) & (range_m < MAX_RANGE_M)
    if np.count_nonzero(seen) < ENOUGH_POINTS:
        return None
    return points_m(after, ahead)[:, seen], np.arange(float(beams))[ahead][seen]


def _off_m(before: Scan, x_m: Floats, y_m: Floats) -> Floats:
    """Return how far points, of any shape, are from the earlier scan's surface along their rays; CAP_M at most."""
    place = (np.arctan2(y_m, x_m) - before.angle_min_rad) / before.angle_step_rad
    index = np.floor(place).astype(np.intp)
    known = (index >= 0) & (index < before.ranges_m.shape[0] - 1)
    index[~known] = 0
    nearness = _nearness(before)
    first, share = nearness[index], place - index
    there_m = 1.0 / (first + share * (nearness[index + 1] - first))
    off_m = np.abs(np.hypot(x_m, y_m) - there_m)
    return np.where(known & (off_m < CAP_M), off_m, CAP_M)  # NaN is not smaller


def _nearness(scan: Scan) -> Floats:
    """Return 1 / range of all beams, (beams,), NaN in holes wider than HOLE_RAD.

    Between two beams a wall's 1 / range is straight; the nearest beam's range instead would favour no shift at all.
    """
    nearness = 1.0 / scan.ranges_m.astype(np.float64)
    is_seen = np.isfinite(nearness)
    seen, lost = is_seen.nonzero()[0], (~is_seen).nonzero()[0]
    if not lost.size or seen.size < 2:
        return nearness
    lost = lost[(lost > seen[0]) & (lost < seen[-1])]
    after = np.searchsorted(seen, lost)
    narrow = lost[(seen[after] - seen[after - 1]) * scan.angle_step_rad <= HOLE_RAD]
    nearness[narrow] = np.interp(narrow, seen, nearness[seen])
    return nearness


def _shifted(
    points: Floats, moved: Shift, lidar_m: complex, shares: Floats, turns_rad: Floats
) -> tuple[Floats, Floats]:
    """Return x_m and y_m of points (2, n), shifted by every share and turn, (shares x turns, n)."""
    x_m, y_m, yaw_rad = _lidar_shifts(moved, lidar_m, shares, turns_rad)
    cos, sin = np.cos(yaw_rad)[:, None], np.sin(yaw_rad)[:, None]
    return cos * points[0] - sin * points[1] + x_m[:, None], sin * points[0] + cos * points[1] + y_m[:, None]


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
