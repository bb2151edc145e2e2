"""Whether the scene moves as the wheels say, all along the drive: each scan against one taken a quarter metre back.

Most scans agree at the first look (0.1 ms each CHECKS_EVERY_M); a search over all answers follows only where one does
not. A scan that fits no motion is compared with those of the last metres: a lidar may repeat old scans.
"""

import math
from collections import deque
from dataclasses import dataclass

import numpy as np

from drivers.api import Scan
from runtime.control.perception.odometry import OdometryState
from runtime.control.perception.scan_shift import (
    ALL,
    AS_SUPPOSED_RAD,
    FIRST,
    SECOND,
    Agreement,
    Fits,
    Shift,
    best_fits,
    fits,
)

BASE_M = 0.25
CHECKS_EVERY_M = 0.06
KEEPS_EVERY_M = 0.02
MAX_KEPT = 200
CHECK_WITHIN_S = 5.0
"""Maximum age of a scan to compare with: the surroundings change."""
EVERY_BEAM = 8
SAME_M, SAME_SHARE = 0.05, 0.97
"""Difference of equal ranges, and minimum share of equal ones in a scan that is seen again."""


@dataclass(frozen=True, slots=True, eq=False)
class _Kept:
    """An earlier scan, and where it was taken by odometry. way_m: driven until then."""

    scan: Scan
    at_m: complex
    yaw_rad: float
    way_m: float


class SceneAgreement:
    """Answers for each scan, in order, where the scene is due to be compared with the wheels."""

    def __init__(self, lidar_m: complex) -> None:
        self._lidar_m = lidar_m
        self._kept: deque[_Kept] = deque(maxlen=MAX_KEPT)
        self._way_m = 0.0
        self._last: complex | None = None
        self._checked_m = self._searched_m = 0.0
        self._contradicts = False

    def forget(self) -> None:
        """Begin anew: for gaps."""
        self._kept.clear()
        self._last = None

    def learn(self, scan: Scan, pose: OdometryState, *, confirmed: bool) -> Agreement | None:
        """Process one scan; None where no comparison is due or possible.

        confirmed: whether the two have agreed before; until then every answer is looked for each BASE_M.
        """
        at_m = complex(pose.x_m, pose.y_m)
        if self._last is not None:
            self._way_m += abs(at_m - self._last)
        self._last = at_m
        kept = self._kept
        if kept and kept[-1].scan.ranges_m.shape != scan.ranges_m.shape:
            kept.clear()
        while kept and not 0.0 <= scan.stamp_s - kept[0].scan.stamp_s < CHECK_WITHIN_S:
            kept.popleft()
        found = None
        if self._way_m - self._checked_m >= CHECKS_EVERY_M:
            found = self._check(_Kept(scan, at_m, pose.yaw_rad, self._way_m), confirmed)
        if not kept or self._way_m - kept[-1].way_m >= KEEPS_EVERY_M:
            kept.append(_Kept(scan, at_m, pose.yaw_rad, self._way_m))
        return found

    def _check(self, now: _Kept, confirmed: bool) -> Agreement | None:  # noqa: FBT001 - as of learn
        base = next((one for one in reversed(self._kept) if abs(now.at_m - one.at_m) >= BASE_M), None)
        if base is None:
            return None
        self._checked_m = now.way_m
        pair = base.scan, now.scan, _moved(base, now), self._lidar_m
        found = fits(*pair, FIRST, AS_SUPPOSED_RAD)
        if found is None:
            return Agreement.UNKNOWN
        answer = _answer(found)
        searches = not confirmed and (self._contradicts or now.way_m - self._searched_m >= BASE_M)
        for answers in (SECOND, ALL):
            explained = answer is not Agreement.STANDS and found.agree and not searches
            if answer is Agreement.AGREES or explained:
                break
            found = best_fits(*pair, answers) or found
            answer = _answer(found)
        else:
            self._searched_m = now.way_m
            if answer is Agreement.UNKNOWN and found.fit_nowhere and self._is_repeated(now):
                answer = Agreement.STANDS
        self._contradicts = answer not in {Agreement.AGREES, Agreement.UNKNOWN}
        return answer

    def _is_repeated(self, now: _Kept) -> bool:
        """Return whether this scan was taken somewhere else before, and not here."""
        earlier = [one for one in self._kept if now.way_m - one.way_m >= BASE_M and abs(now.at_m - one.at_m) >= BASE_M]
        if not earlier:
            return False
        here_m = now.scan.ranges_m[::EVERY_BEAM]
        there_m = np.stack([one.scan.ranges_m[::EVERY_BEAM] for one in earlier])
        same = np.count_nonzero(np.abs(there_m - here_m) < SAME_M, axis=1)
        return bool(same.max() >= SAME_SHARE * np.count_nonzero(here_m == here_m))


def _answer(found: Fits) -> Agreement:
    """Return the answer of the whole view, unless what is ahead stands still."""
    return Agreement.STANDS if found.answer(ahead=True) is Agreement.STANDS else found.answer()


def _moved(start: _Kept, end: _Kept) -> Shift:
    """Return the shift of base_link from one place to another, in the frame of the first."""
    off = (end.at_m - start.at_m) * complex(math.cos(start.yaw_rad), -math.sin(start.yaw_rad))
    return off.real, off.imag, math.remainder(end.yaw_rad - start.yaw_rad, math.tau)
