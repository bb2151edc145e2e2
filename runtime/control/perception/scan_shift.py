"""Scan matching over multiples of an assumed shift: forward as assumed, backward, none, farther, or another way.

A search over a few dozen shifts instead of an iteration, because the question is which of several far answers is right,
and an iteration that begins at one of them stays there. A point of the later scan, shifted, is compared with the range
that the earlier one has at its bearing (projective association, Blais and Levine 1995). Own parts of the car would vote
for "stands": only what is before the shoulders counts. Some ms, until it is confirmed; not for the hot
path.
"""

import math
from enum import Enum

import numpy as np

from wallride.drivers.api import Scan
from wallride.runtime.control.perception.geometry import Floats, points_m, sector

Shift = tuple[float, float, float]
"""Shift x_m, y_m, yaw_rad of base_link, in its earlier frame."""

SHARES = np.array([-1.5, -1.25, -1.0, -0.75, -0.5, 0.0, 0.25, 0.5, 0.75, 1.0, 1.25, 1.5, 1.75, 2.0, 2.5, 3.0, 3.5])
TURNS_RAD = np.radians([-12.0, -9.0, -6.0, -3.0, 0.0, 3.0, 6.0, 9.0, 12.0])
"""Added to the supposed heading: trim, slip and a servo that lags."""
BEFORE_RAD = math.radians(95)
MIN_RANGE_M, MAX_RANGE_M = 0.15, 10.0
POINTS = 150
ENOUGH_POINTS = 40
CAP_M = 0.1
"""Maximum misfit of one point: beyond it a point only counts as not fitting, because people walk and edges hide."""
TELLS_M, ENOUGH_TELL, ENOUGH_DIFFER = 0.05, 12, 8
"""Minimum difference, and minimum number, of informative points, among all answers and between two: a point on a wall
parallel to the motion fits at any shift."""
CLEARER_M, CLEARER_SHARE = 0.01, 1.2
"""Minimum difference and ratio by which every other answer must fit worse."""
WIDE_TURNS_RAD = np.radians([-6.0, -3.0, 0.0, 3.0, 6.0])
"""Of the comparison of directions, which has twice as many answers."""
LENGTHS = np.array([0.8, 1.15])
SLIPS_RAD = np.radians([-30.0, -15.0, 15.0, 30.0])
"""Directions that a car which slides still can have."""
ASIDES_RAD = np.radians([*range(-165, -44, 15), *range(45, 166, 15)])
"""Directions that only a lidar which is turned on the car can show."""
FITS_ASIDE_M = 0.06
"""Maximum misfit of a direction aside: noise of 2 cm has 0.03 to 0.05, and nothing that fits has 0.08."""


class Agreement(Enum):
    """How the scans' shift compares with the supposed one."""

    AGREES = "agrees"
    STANDS = "stands"
    OPPOSITE = "opposite"
    FARTHER = "farther"
    ASIDE = "aside"
    UNKNOWN = "unknown"


_ANSWERS = {
    Agreement.OPPOSITE: SHARES < 0,
    Agreement.STANDS: (SHARES >= 0) & (SHARES < 0.5),
    Agreement.AGREES: (SHARES >= 0.5) & (SHARES <= 2.0),
    Agreement.FARTHER: SHARES > 2.0,
}


def compare_shift(before: Scan, after: Scan, moved: Shift, lidar_m: complex) -> Agreement:
    """Return which answer fits clearly better than all others; UNKNOWN without one, as in a bare corridor.

    moved: base_link's shift between the scans as supposed. Both scans of one sensor, else UNKNOWN.
    """
    along = _compare_along(before, after, moved, lidar_m)
    fits = _directions(before, after, moved, lidar_m)
    if fits is None:
        return along
    ahead_m, opposite_m, aside_m = fits
    best_m = _best(np.concatenate([opposite_m, aside_m]))
    if best_m.mean() < FITS_ASIDE_M and _beats(best_m, ahead_m):
        is_opposite = along is Agreement.OPPOSITE and not _beats(_best(aside_m), opposite_m)
        return Agreement.OPPOSITE if is_opposite else Agreement.ASIDE
    confirms = along is Agreement.AGREES
    return Agreement.UNKNOWN if confirms and not _beats(_best(ahead_m), aside_m) else along


def _best(fits_m: Floats) -> Floats:
    best: Floats = fits_m[fits_m.mean(axis=1).argmin()]
    return best


def _beats(best_m: Floats, rivals_m: Floats) -> bool:
    """Return whether an answer fits clearly better than each rival (k, n), by the points where the two differ."""
    differ = np.abs(rivals_m - best_m) > TELLS_M
    count = differ.sum(axis=1)
    if count.min() < ENOUGH_DIFFER:
        return False
    of_best_m, of_rivals_m = (np.where(differ, off_m, 0.0).sum(axis=1) / count for off_m in (best_m, rivals_m))
    return bool((of_rivals_m > CLEARER_SHARE * of_best_m + CLEARER_M).all())


def _compare_along(before: Scan, after: Scan, moved: Shift, lidar_m: complex) -> Agreement:
    """Return the answer among multiples of the supposed shift."""
    misfit_m = misfits_m(before, after, moved, lidar_m)
    if misfit_m is None:
        return Agreement.UNKNOWN
    of = {answer: float(misfit_m[which].min()) for answer, which in _ANSWERS.items()}
    best = min(of, key=lambda answer: of[answer])
    limit_m = CLEARER_SHARE * of[best] + CLEARER_M
    clear = all(rival_m > limit_m for answer, rival_m in of.items() if answer is not best)
    return best if clear else Agreement.UNKNOWN


def _directions(before: Scan, after: Scan, moved: Shift, lidar_m: complex) -> tuple[Floats, Floats, Floats] | None:
    """Return the misfits of each point, (answers, n), ahead, opposite and aside, over the whole field of view."""
    along = np.stack(_lidar_shifts(moved, lidar_m, SHARES, WIDE_TURNS_RAD))
    slips, asides = (_turned(moved, lidar_m, ways_rad) for ways_rad in (SLIPS_RAD, ASIDES_RAD))
    shifts = np.concatenate([along, slips, asides], axis=1)
    fits_m = _fits_m(before, after, (shifts[0], shifts[1], shifts[2]), slice(None), WIDE_TURNS_RAD.size)
    if fits_m is None:
        return None
    along_m, slips_m, asides_m = np.split(fits_m, np.cumsum([SHARES.size, LENGTHS.size * SLIPS_RAD.size]))
    return np.concatenate([along_m[SHARES >= 0.0], slips_m]), along_m[SHARES < 0.0], asides_m


def _turned(moved: Shift, lidar_m: complex, ways_rad: Floats) -> Floats:
    """Return the lidar's shifts (3, k) in other directions than the wheels', as a lidar that is turned shows them."""
    x_m, y_m, yaw_rad = (
        np.tile(part, ways_rad.size) for part in _lidar_shifts(moved, lidar_m, LENGTHS, WIDE_TURNS_RAD)
    )
    shift_m = (x_m + 1j * y_m) * np.repeat(np.exp(1j * ways_rad), LENGTHS.size * WIDE_TURNS_RAD.size)
    return np.stack([shift_m.real, shift_m.imag, yaw_rad])


def misfits_m(
    before: Scan, after: Scan, moved: Shift, lidar_m: complex, shares: Floats = SHARES, turns_rad: Floats = TURNS_RAD
) -> Floats | None:
    """Return the mean distance between the scans at each of the shares, (shares,), at the best turn.

    None where too few points are seen, or the scans are not of one kind.
    """
    ahead = sector(after, -BEFORE_RAD, BEFORE_RAD)
    fits_m = _fits_m(before, after, _lidar_shifts(moved, lidar_m, shares, turns_rad), ahead, turns_rad.size)
    if fits_m is None:
        return None
    tells = np.ptp(fits_m, axis=0) > TELLS_M
    if np.count_nonzero(tells) < ENOUGH_TELL:
        return None
    misfit_m: Floats = fits_m[:, tells].mean(axis=1)
    return misfit_m


def _fits_m(before: Scan, after: Scan, shifts: tuple[Floats, Floats, Floats], part: slice, turns: int) -> Floats | None:
    """Return the distance of each point from the earlier scan, (answers, n), at the best turn of each answer."""
    beams = before.ranges_m.shape[0]
    if after.ranges_m.shape[0] != beams or after.angle_min_rad != before.angle_min_rad:
        return None
    first, last, _ = part.indices(beams)
    part = slice(first, last, max(1, (last - first) // POINTS))
    range_m = after.ranges_m[part]
    seen = (range_m > MIN_RANGE_M) & (range_m < MAX_RANGE_M)
    points = points_m(after, part)[:, seen]
    if points.shape[1] < ENOUGH_POINTS:
        return None
    x_m, y_m, yaw_rad = shifts
    cos, sin = np.cos(yaw_rad)[:, None], np.sin(yaw_rad)[:, None]
    shifted_x_m = cos * points[0] - sin * points[1] + x_m[:, None]
    shifted_y_m = sin * points[0] + cos * points[1] + y_m[:, None]
    bearing_rad = np.arctan2(shifted_y_m, shifted_x_m) - before.angle_min_rad
    place = np.where(bearing_rad < 0.0, bearing_rad + math.tau, bearing_rad) / before.angle_step_rad
    index = np.floor(place).astype(np.intp)
    known = (index >= 0) & (index < beams - 1)
    index[~known] = 0
    # Between two beams a wall's 1 / range is straight; the nearest beam's range instead would favour no shift at all.
    nearness = 1.0 / before.ranges_m.astype(np.float64)
    first_m, share = nearness[index], place - index
    there_m = 1.0 / (first_m + share * (nearness[index + 1] - first_m))
    off_m = np.abs(np.hypot(shifted_x_m, shifted_y_m) - there_m)
    off_m = np.where(known & (off_m < CAP_M), off_m, CAP_M)  # NaN is not smaller
    by_turn_m = off_m.reshape(-1, turns, off_m.shape[1])
    turn = by_turn_m.mean(axis=2).argmin(axis=1)
    fits_m: Floats = by_turn_m[np.arange(turn.size), turn]
    return fits_m


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
