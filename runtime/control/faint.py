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
from collections import deque

import numpy as np
import numpy.typing as npt

from runtime.control.geometry import NOWHERE, Places, places_m
from runtime.control.odometry import Pose
from runtime.control.perception import View

SCANS = 5
"""A place counts when it returned in this scan and in all but one of the SCANS - 1 before."""
SAME_RANGE_M = 0.1
"""Three times the noise of two distances, and how far the odometry may err within 0.1 s."""
SAME_ASIDE_M = 0.03
"""Aside a beam is as good as its bearing: 0.25 degrees are 1 cm at 2.5 m."""
STANDS_OUT_M = 0.15
STANDS_OUT_BEAMS = 4
"""A thin thing is so much nearer than the beams so many places to its left and right."""
AHEAD_RAD = math.radians(40)
FROM_M, WITHIN_M = 1.0, 5.0
"""Nearer, three beams meet a thing of 1.3 cm; farther, the beams are wider apart than a pole."""
FORGOTTEN_S = 0.1
"""After a silence nobody knows whether a return is the second of the same thing."""


class Faint:
    """Small state: what stood out thinly in the last scans, in the odometry frame."""

    def __init__(self) -> None:
        self._before: deque[Places] = deque(maxlen=SCANS - 1)
        self._stamp_s = -math.inf

    def update(self, view: View, pose: Pose, stamp_s: float) -> Places:
        """Return the points, (k,) in base_link, of what keeps returning: this scan's, and where it was seen before.

        So a pole that one beam meets has the three points of a thing.
        """
        if stamp_s - self._stamp_s > FORGOTTEN_S:
            self._before.clear()
        self._stamp_s = stamp_s
        turned, at_m = cmath.rect(1.0, pose.yaw_rad), complex(pose.x_m, pose.y_m)
        thin = _thin(view)
        before = tuple(self._before)
        self._before.append(places_m(view.x_m, view.y_m, thin) * turned + at_m)
        # What three beams meet counts already; the others are asked whether they were seen before.
        lonely = thin[~view.solid.take(thin)]
        seen = places_m(view.x_m, view.y_m, lonely)
        if len(before) < SCANS - 1 or not seen.size:
            return NOWHERE
        old = np.concatenate(before)
        off = old - (seen * turned + at_m)[:, None]
        if np.count_nonzero(np.abs(off) < SAME_RANGE_M + SAME_ASIDE_M) < SCANS - 2:
            return NOWHERE  # as after most scans
        off *= (seen.conj() / (np.abs(seen) * turned))[:, None]  # the real part along the beam, the imaginary one aside
        same = (np.abs(off.real) < SAME_RANGE_M) & (np.abs(off.imag) < SAME_ASIDE_M)
        ends = np.cumsum([one.size for one in before])
        again = np.array([part.any(axis=1) for part in np.split(same, ends[:-1], axis=1)])
        there = np.count_nonzero(again, axis=0) >= SCANS - 2
        if not there.any():
            return NOWHERE
        return np.concatenate([seen[there], (old[same[there].any(axis=0)] - at_m) / turned])


def _thin(view: View) -> npt.NDArray[np.intp]:
    """Return the indices (k,) of the beams ahead that stand out, nearer than what is to their left and right."""
    middle = round(-view.scan.angle_min_rad / view.scan.angle_step_rad)
    half = round(AHEAD_RAD / abs(view.scan.angle_step_rad))
    first = max(STANDS_OUT_BEAMS, middle - half)
    last = max(first, min(view.ranges_m.size - STANDS_OUT_BEAMS, middle + half + 1))
    around_m = view.ranges_m[first - STANDS_OUT_BEAMS : last + STANDS_OUT_BEAMS]
    ranges_m = view.ranges_m[first:last]
    hidden = around_m[2 * STANDS_OUT_BEAMS :] - ranges_m < STANDS_OUT_M  # NaN, no echo, counts as far
    hidden |= around_m[: -2 * STANDS_OUT_BEAMS] - ranges_m < STANDS_OUT_M
    thin = ranges_m < WITHIN_M
    thin &= ranges_m > FROM_M
    thin &= ~hidden
    if view.dirty is not None:
        thin &= ~view.dirty[first:last]
    return thin.nonzero()[0] + first
