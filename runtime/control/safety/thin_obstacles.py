"""Things too thin for three beams of one scan: what returns from the same place scan after scan is there.

A single beam may be wild, so a thing normally counts from three neighbouring beams on; a pole of 2 cm has them only
within 2.2 m, too late for a car at 4 m/s on a slippery floor. But a pole stands still: the one or two beams that meet
it farther out meet it again, while a wild beam of the next scan is somewhere else. Nearer, when three or four beams
meet it and one of them is wild, it is known from the scans before. (The idea is that of "M of N"
confirmation in radar tracking, Blackman & Popoli 1999, section 6.2, with a track that is a place.)

Dirt on the window returns again and again as well, and while the car stands or creeps even from the same place: beams
that are known to be dirty do not count here, however far they read.
"""

import cmath
import math

import numpy as np

from drivers.twin import twin
from runtime.control.perception.geometry import NOWHERE, Booleans, Floats, Places, places_m
from runtime.control.perception.odometry import OdometryState
from runtime.control.perception.view import View

SCANS = 5
"""A place counts when it returned in this scan and in all but one of the SCANS - 1 before."""
SAME_RANGE_M = 0.1
"""Three times the noise of two distances, and how far the odometry may err within 0.1 s."""
SAME_ASIDE_M = 0.03
"""Aside a beam is as good as its bearing: 0.25 degrees are 1 cm at 2.5 m."""
STANDS_OUT_M = 0.15
STANDS_OUT_BEAMS = 5
"""A thin thing is so much nearer than the beams so many places to its left and right: each of five beams stands out."""
AHEAD_RAD = math.radians(40)
FROM_M, WITHIN_M = 0.75, 5.0
"""Nearer, six beams meet a thing of 2 cm, of which three are left when any one is wild; of five, the middle one wild,
two. Farther, the beams are wider apart than a pole."""
FORGOTTEN_S = 0.1
"""After a silence it is unknown whether a return is the second of the same thing."""


class ThinObstacles:
    """Small state: what stood out thinly in the last scans, in the odometry frame."""

    def __init__(self) -> None:
        self._before: tuple[Places, ...] = ()
        self._stamp_s = -math.inf

    def update(self, view: View, pose: OdometryState, stamp_s: float) -> Places:
        """Return the points, (k,) in base_link, of what keeps returning: this scan's, and where it was seen before.

        So a pole that one beam meets has the three points of a thing.
        """
        before = () if stamp_s - self._stamp_s > FORGOTTEN_S else self._before
        self._stamp_s = stamp_s
        scan, x_m, y_m, yaw_rad = view.scan, pose.x_m, pose.y_m, pose.yaw_rad
        thin_m, seen = find_thin_places(
            view.x_m, view.y_m, view.solid, view.ranges_m, view.dirty, scan.angle_min_rad, scan.angle_step_rad,
            x_m, y_m, yaw_rad,
        )  # fmt: skip
        self._before = (*before[2 - SCANS :], thin_m)
        if len(before) < SCANS - 1 or not seen.size:
            return NOWHERE
        there_m = find_returning(seen, before, x_m, y_m, yaw_rad)
        return NOWHERE if there_m is None else there_m


@twin
def find_returning(
    seen: Places, before: tuple[Places, ...], at_x_m: float, at_y_m: float, yaw_rad: float
) -> Places | None:
    """Return which of the places seen, (k,) in base_link, were seen before, and those seen before; None for none.

    before: of each of the scans before, in the odometry frame. at_x_m, at_y_m, yaw_rad: where base_link is in it.
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


@twin
def find_thin_places(  # flat arguments, as its twin in C wants them
    x_m: Floats,
    y_m: Floats,
    solid: Booleans,
    ranges_m: Floats,
    dirty: Booleans | None,
    angle_min_rad: float,
    angle_step_rad: float,
    at_x_m: float,
    at_y_m: float,
    yaw_rad: float,
) -> tuple[Places, Places]:
    """Return the places of beams ahead, within AHEAD_RAD, that are nearer than what is left and right of them.

    First all of them, (k,) in the odometry frame, then in base_link those that do not count already, (j,), because
    fewer than three beams meet them. x_m to dirty: of a View, (beams,). at_x_m, at_y_m, yaw_rad: where base_link is in
    the odometry frame.
    """
    middle = round(-angle_min_rad / angle_step_rad)
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
    if dirty is not None:
        thin &= ~dirty[first:last]
    index = thin.nonzero()[0] + first
    turned, at_m = cmath.rect(1.0, yaw_rad), complex(at_x_m, at_y_m)
    return places_m(x_m, y_m, index) * turned + at_m, places_m(x_m, y_m, index[~solid.take(index)])
