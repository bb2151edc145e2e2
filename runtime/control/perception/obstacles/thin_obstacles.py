"""Detection of obstacles too thin for three beams of one scan, by returns from the same place in several scans.

A single beam may be an outlier, so an object normally counts from three neighbouring beams on; a pole of 2 cm has them
only within 2.2 m, too late for a car at 4 m/s on a slippery floor. But a pole stands still: the one or two beams that
hit it farther out hit it again, while an outlier of the next scan is elsewhere. Nearer, when three or four beams hit it
and one of them is an outlier, it is known from the previous scans. (This is "M of N" confirmation as in radar tracking,
Blackman & Popoli 1999, section 6.2, with a track that is a place.)

Dirt on the window returns repeatedly as well, and while the car stands or creeps even from the same place: beams that
are known to be dirty do not count here, whatever their range.
"""

import cmath
import math
from typing import Any

import numpy as np

from wallride.drivers.accelerated import accelerated
from wallride.runtime.control.perception.geometry import NOWHERE, Places, places_m
from wallride.runtime.control.perception.odometry import OdometryState
from wallride.runtime.control.perception.view import View

SCANS = 5
"""Number of scans of the confirmation: a place counts with a return in this one and in all but one of those before."""
SAME_RANGE_M = 0.1
"""Maximum difference in range of one place: three times the noise of two distances, and 0.1 s of odometry error."""
SAME_ASIDE_M = 0.03
"""Maximum lateral difference of one place, as accurate as a beam's bearing: 0.25 degrees are 1 cm at 2.5 m."""
STANDS_OUT_M = 0.15
STANDS_OUT_BEAMS = 5
"""Distance in beams to the left and right at which a thin object is nearer by STANDS_OUT_M: each of five beams stands
out."""
AHEAD_RAD = math.radians(40)
FROM_M, WITHIN_M = 0.75, 5.0
"""Limits of the range. Nearer, six beams hit an object of 2 cm, of which three remain when any one is an outlier; of
five, with the middle one an outlier, two. Farther, the beams are wider apart than a pole."""
FORGOTTEN_S = 0.1
"""Maximum gap between scans of 40 Hz; after a longer one, returns cannot be associated with the same object."""
FINE_RAD = math.radians(0.3)
"""Angle between beams up to which three beams hit a pole of 2 cm nearer than FROM_M."""
BLIND_M = 0.1
"""Nearest distance of a sensor up to which beams FINE_RAD apart hit a pole before the car's bumper in every scan."""
HELD_WITHIN_M = 1.5
"""Range within which a confirmed thin obstacle is held: of a lidar whose beams are wider apart than FINE_RAD, or which
measures nothing nearer than BLIND_M."""
HELD_WITHOUT = 1
"""Number of scans in a row without a return from it after which it is no longer held."""


class ThinObstacles:
    """Tracks the thin candidates of the last scans, in the odometry frame.

    Of a lidar with wide beams, or one that is blind before the bumper, also what was confirmed.
    """

    def __init__(self) -> None:
        self._before: tuple[Places, ...] = ()
        self._stamp_s = -math.inf
        self._held_m = NOWHERE  # in the odometry frame
        self._without = np.empty(0, np.intp)

    def update(self, view: View, pose: OdometryState, stamp_s: float) -> Places:
        """Return the points, (k,) in base_link, of confirmed thin obstacles: of this scan and of the previous ones.

        So a pole hit by a single beam has the three points that an object needs.
        """
        before = () if stamp_s - self._stamp_s > FORGOTTEN_S + view.waits_s else self._before
        self._stamp_s = stamp_s
        thin_m, seen = find_thin_places(view, pose)
        self._before = (*before[2 - SCANS :], thin_m)
        there_m = None
        if len(before) == SCANS - 1 and seen.size:
            there_m = find_returning(seen, before, pose.x_m, pose.y_m, pose.yaw_rad)
        if abs(view.scan.angle_step_rad) > FINE_RAD or view.scan.range_min_m > BLIND_M:
            return self._hold(view, pose, NOWHERE if there_m is None else there_m)
        return NOWHERE if there_m is None else there_m

    def _hold(self, view: View, pose: OdometryState, confirmed_m: Places) -> Places:
        """Return what is confirmed now, and what was and still returns, (k,) in base_link.

        Nearer than FROM_M nothing is confirmed, because dirt reads as that; but where beams are wide apart, fewer than
        three hit a pole there, or two and an outlier, and a lidar that is blind there loses half of its returns.
        Any return from the place of a confirmed one is its return.
        """
        if not self._held_m.size and not confirmed_m.size:
            return NOWHERE  # as in most scans
        turned, at_m = cmath.rect(1.0, pose.yaw_rad), complex(pose.x_m, pose.y_m)
        held_m = (self._held_m - at_m) / turned
        near_m = places_m(view.x_m, view.y_m, (view.ranges_m < HELD_WITHIN_M + SAME_RANGE_M).nonzero()[0])
        returns = (np.abs(held_m[:, None] - near_m) < SAME_RANGE_M).any(axis=1)
        without = np.where(returns, 0, self._without + 1)
        kept = (without <= HELD_WITHOUT) & (np.abs(held_m - view.lidar_m) < HELD_WITHIN_M)
        newly_m = confirmed_m[np.abs(confirmed_m - view.lidar_m) < HELD_WITHIN_M]
        kept &= ~(np.abs(held_m[:, None] - newly_m) < SAME_RANGE_M).any(axis=1)  # the same thing, seen better
        self._held_m = np.concatenate([newly_m * turned + at_m, self._held_m[kept]])
        self._without = np.concatenate([np.zeros(newly_m.size, np.intp), without[kept]])
        return np.concatenate([confirmed_m, held_m[kept]])


@accelerated
def find_returning(
    seen: Places, before: tuple[Places, ...], at_x_m: float, at_y_m: float, yaw_rad: float
) -> Places | None:
    """Return those places of `seen`, (k,) in base_link, that were seen before, and the earlier places; None for none.

    before: of each of the previous scans, in the odometry frame. at_x_m, at_y_m, yaw_rad: pose of base_link in it.
    """
    turned, at_m = cmath.rect(1.0, yaw_rad), complex(at_x_m, at_y_m)
    old = np.concatenate(before)
    off = old - (seen * turned + at_m)[:, None]
    if np.count_nonzero(np.abs(off) < SAME_RANGE_M + SAME_ASIDE_M) < SCANS - 2:
        return None  # as after most scans
    off *= (seen.conj() / (np.abs(seen) * turned))[:, None]  # the real part along the beam, the imaginary one aside
    same = (np.abs(off.real) < SAME_RANGE_M) & (np.abs(off.imag) < SAME_ASIDE_M)
    ends = np.cumsum([one.size for one in before])
    again = np.array([part.any(axis=1) for part in np.split(same, ends[:-1], axis=1)])
    there = np.count_nonzero(again, axis=0) >= SCANS - 2
    if not there.any():
        return None
    return np.concatenate([seen[there], (old[same[there].any(axis=0)] - at_m) / turned])


def _flat_thin(view: View, pose: OdometryState) -> tuple[Any, ...]:
    scan = view.scan
    return (
        view.x_m, view.y_m, view.solid, view.ranges_m, view.dirty, scan.angle_min_rad, scan.angle_step_rad, pose.x_m,
        pose.y_m, pose.yaw_rad,
    )  # fmt: skip


@accelerated(flat=_flat_thin)
def find_thin_places(view: View, pose: OdometryState) -> tuple[Places, Places]:
    """Return the places of beams ahead, within AHEAD_RAD, that are nearer than the beams to their left and right.

    First all of them, (k,) in the odometry frame, then in base_link those that do not count already, (j,), because
    fewer than three beams hit them. pose: of base_link in the odometry frame.
    """
    x_m, y_m, ranges_m, angle_step_rad = view.x_m, view.y_m, view.ranges_m, view.scan.angle_step_rad
    middle = round(-view.scan.angle_min_rad / angle_step_rad)
    half = round(AHEAD_RAD / abs(angle_step_rad))
    first = max(STANDS_OUT_BEAMS, middle - half)
    last = max(first, min(ranges_m.size - STANDS_OUT_BEAMS, middle + half + 1))
    around_m = ranges_m[first - STANDS_OUT_BEAMS : last + STANDS_OUT_BEAMS]
    here_m = ranges_m[first:last]
    hidden = around_m[2 * STANDS_OUT_BEAMS :] - here_m < STANDS_OUT_M  # NaN, no echo, counts as far
    hidden |= around_m[: -2 * STANDS_OUT_BEAMS] - here_m < STANDS_OUT_M
    thin = here_m < WITHIN_M
    thin &= here_m > FROM_M
    thin &= ~hidden
    if view.dirty is not None:
        thin &= ~view.dirty[first:last]
    index = thin.nonzero()[0] + first
    turned, at_m = cmath.rect(1.0, pose.yaw_rad), complex(pose.x_m, pose.y_m)
    return places_m(x_m, y_m, index) * turned + at_m, places_m(x_m, y_m, index[~view.solid.take(index)])
