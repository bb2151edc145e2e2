"""Whether the lidar goes on telling the truth along the drive: the scene against the wheels, and against itself.

Each CHECKS_EVERY_M a scan is compared with one that was taken BASE_M before:

* A scene that agreed with the wheels within the last AGREED_WITHIN_M, and now stands although they turn, is an old one.
* Walls that were near ahead do not vanish while the car approaches them, with one and the same far range in their
  place, or with ranges of which no two neighbours belong together: that is no view. (People who step aside leave a view
  of many ranges.)

And a scan that was seen before, to the bit, somewhere else, is played again. What stands from the first metre on is no
fault here: a car on a stand looks the same.

Of a slow lidar the driver takes the wheels' motion out of each turn, which makes a different scan of every showing of a
stored one, and few coarse beams leave a mean misfit of centimetres. So both turns get the same motion taken out, and
each point that fits one of the two, standing or moving, and not the other, has a vote.
"""

import math
from collections import OrderedDict, deque
from typing import Any

import numpy as np
import numpy.typing as npt

from wallride.drivers.api import Scan
from wallride.drivers.value import value
from wallride.runtime.control.perception.geometry import Floats, median, points_m, quantile, sector
from wallride.runtime.control.perception.odometry import OdometryState
from wallride.runtime.control.perception.scan_shift import Shift, misfits_m, votes

BASE_M = 0.25
CHECKS_EVERY_M = 0.08
KEEPS_EVERY_M = 0.05
MAX_AGE_S = 5.0
"""Maximum age of a scan to compare with: the surroundings change."""
AGREED_WITHIN_M = 1.0
SHARES = np.array([0.0, 0.6, 0.85, 1.1, 1.4])
TURNS_RAD = np.radians([-4.0, 0.0, 4.0])
SLIPS_RAD = np.radians([-16.0, -8.0, 0.0, 8.0, 16.0])
"""Added to the odometry's heading, which knows nothing of a car that slides."""
SURE_SHARES = np.array([0.0, 0.5, 0.7, 0.85, 1.0, 1.15, 1.3, 1.5, 1.8])
SURE_TURNS_RAD = np.radians(np.arange(-8.0, 8.1, 0.8))
CLEARER_M, CLEARER_SHARE = 0.01, 1.2
SURELY_CLEARER_M = 0.03
"""Minimum distance by which every motion must fit worse than none: a car's slip angle alone misses a wall by 2 cm."""
SAME_M = 0.015
"""Maximum mean misfit of a scene that stands."""
VOTED_BASES_M = (0.15, 0.25)
"""Ways back to the scans with which one of a slow lidar is compared, by votes of its points."""
MOVES_VOTES, STANDS_VOTES, AGAINST = 6, 30, 1.5
"""Minimum number of votes for a scene that moves, of one check, and for one that stands, in a sum over the checks since
(Page's CUSUM test), in which a vote for motion counts so much more."""
VOTED_WITHIN_M = 3.0
"""The same as AGREED_WITHIN_M, of a slow lidar: in a corridor few points have a vote, and the sum grows slowly."""
STANDS_CHECKS, VANISHED_CHECKS, REPEATED_SCANS = 2, 2, 2
"""Minimum number of consecutive witnesses."""
REMEMBERED_SCANS = 400
AHEAD_RAD = math.radians(45)
NEAR_M = 3.0
EVERY_RAD = math.radians(1.0)
ENOUGH_SHARE = 0.22
"""Interval of the bearings that are compared, and the minimum share of them ahead that must have been near, of any
lidar."""
FARTHER_M, FARTHER_SHARE = 0.5, 1.1
VANISHED_SHARE = 0.6
BLANK_SPREAD_M, BLANK_BEYOND_M, BLANK_STEP_M = 0.5, 25.0, 2.0
"""Maximum spread of the ranges, their minimum, or the minimum of the median step between neighbours, where they are no
view."""
BACK_SHARE, BACK_M = 0.5, 0.3
"""Share of what had vanished that is there again, and how near to its place, where the view is trusted again."""
LIVE_M = 0.1
STANDS_FOR_S = 1.0
STANDING_MPS = 0.05
REPEATED = "the lidar plays old scans: power-cycle it, check its cable"
STANDS = "the wheels turn and the scene stands: free the car; hold a hand before the lidar to show that it sees"
VANISHED = "walls ahead vanished: uncover or clean the lidar"
CHANGED_SHARE = {STANDS: 0.05, VANISHED: 0.5}
"""Minimum share of the view ahead that changes before a car that stands, where it is trusted again."""


@value(eq=False)
class _Kept:
    """An earlier scan, and where it was taken by odometry. way_m: driven until then."""

    scan: Scan
    pose: OdometryState
    way_m: float


class SceneAgreement:
    """Judges each scan, in order. doubt: reason why the lidar is not trusted, "" while it is."""

    def __init__(self, lidar_m: complex) -> None:
        self._lidar_m = lidar_m
        self._kept: deque[_Kept] = deque(maxlen=math.ceil(2 * BASE_M / KEEPS_EVERY_M))
        self._seen: OrderedDict[int, float] = OrderedDict()
        self._way_m = self._checked_m = 0.0
        self._distance_m: float | None = None
        self._agreed_m = -math.inf
        self._repeated = self._standing = self._vanished = 0
        self._votes = 0.0  # that it stands, less those against
        self._stood_since_s = math.nan
        self._before: _Kept | None = None  # what has vanished, and the view in which it has
        self._covered: Scan | None = None
        self.doubt = ""

    def learn(self, scan: Scan, samples: bytes, pose: OdometryState, distance_m: float) -> None:
        """Process one scan. samples: its ranges. pose, distance_m: of the wheels' odometry at that moment."""
        if self._distance_m is not None:
            self._way_m += abs(distance_m - self._distance_m)
        self._distance_m = distance_m
        stands = abs(pose.speed_mps) <= STANDING_MPS
        if not stands or math.isnan(self._stood_since_s):
            self._stood_since_s = scan.stamp_s if stands else math.nan
        if stands:
            self._agreed_m, self._standing, self._votes = -math.inf, 0, 0.0
        key = hash(samples)
        if key == next(reversed(self._seen), None):
            return  # one scan again and again has a check of its own
        self._look_for_repetition(key)
        now = _Kept(scan, pose, self._way_m)
        if self.doubt in {STANDS, VANISHED}:
            self._await_the_truth(now)
        elif self._way_m - self._checked_m >= CHECKS_EVERY_M:
            self._checked_m = self._way_m
            self._check(now)
        if not self._kept or self._way_m - self._kept[-1].way_m >= KEEPS_EVERY_M:
            self._kept.append(now)

    def forget(self) -> None:
        """Begin anew: the wheels' reports had a gap."""
        self._kept.clear()
        self._distance_m, self._agreed_m = None, -math.inf

    def _look_for_repetition(self, key: int) -> None:
        first_m = self._seen.setdefault(key, self._way_m)
        self._seen.move_to_end(key)
        if len(self._seen) > REMEMBERED_SCANS:
            self._seen.popitem(last=False)
        self._repeated = self._repeated + 1 if self._way_m - first_m >= BASE_M else 0
        if self._repeated >= REPEATED_SCANS:
            self.doubt = REPEATED
        elif not self._repeated and self.doubt == REPEATED:
            self.doubt = ""

    def _base(self, now: _Kept, way_m: float) -> _Kept | None:
        """Return the newest scan that was taken so far back."""
        base = next((one for one in reversed(self._kept) if now.way_m - one.way_m >= way_m), None)
        return base if base is not None and 0.0 <= now.scan.stamp_s - base.scan.stamp_s <= MAX_AGE_S else None

    def _check(self, now: _Kept) -> None:
        base = self._base(now, BASE_M)
        if base is None:
            return
        moved = _moved(base.pose, now.pose)
        self._vanished = self._vanished + 1 if _has_vanished(base, now, self._lidar_m) else 0
        if self._vanished >= VANISHED_CHECKS:
            self._doubt_view(base, now, VANISHED)
            return
        if now.scan.correction is not None:
            self._vote(base, now)
            return
        misfit_m = misfits_m(base.scan, now.scan, moved, self._lidar_m, SHARES, TURNS_RAD)
        if misfit_m is None:
            return
        still_m, moves_m = float(misfit_m[0]), float(misfit_m[1:].min())
        if still_m > CLEARER_SHARE * moves_m + CLEARER_M:
            self._agreed_m, self._standing = now.way_m, 0
        elif still_m < SAME_M and moves_m > CLEARER_SHARE * still_m + CLEARER_M and self._surely_stands(base, now):
            self._standing += 1
            if self._standing >= STANDS_CHECKS and now.way_m - self._agreed_m <= AGREED_WITHIN_M:
                self._doubt_view(base, now, STANDS)

    def _vote(self, base: _Kept, now: _Kept) -> None:
        """Ask the points of a slow lidar's scan whether the scene moves; about 2 ms."""
        stands = moves = 0
        for one in (self._base(now, way_m) for way_m in VOTED_BASES_M):
            if one is not None:
                moved = _moved(one.pose, now.pose)
                found = votes(one.scan, now.scan, moved, self._lidar_m, SHARES[1:], SURE_TURNS_RAD) or (0, 0)
                stands, moves = stands + found[0], moves + found[1]
        if moves >= MOVES_VOTES and moves > stands:
            self._agreed_m, self._standing, self._votes = now.way_m, 0, 0.0
            return
        self._votes = max(0.0, self._votes + stands - AGAINST * moves)
        self._standing = self._standing + 1 if self._votes else 0
        told = self._standing >= STANDS_CHECKS and self._votes >= STANDS_VOTES
        if told and now.way_m - self._agreed_m <= VOTED_WITHIN_M:
            self._doubt_view(base, now, STANDS)

    def _surely_stands(self, base: _Kept, now: _Kept) -> bool:
        """Return whether nothing but standing fits, among many more answers: a few ms, and seldom asked."""
        moved = _moved(base.pose, now.pose)
        misfit_m = misfits_m(base.scan, now.scan, moved, self._lidar_m, SURE_SHARES, SURE_TURNS_RAD)
        return misfit_m is not None and bool(misfit_m[1:].min() > CLEARER_SHARE * misfit_m[0] + SURELY_CLEARER_M)

    def _doubt_view(self, base: _Kept, now: _Kept, reason: str) -> None:
        self.doubt, self._before, self._covered = reason, base, now.scan
        self._standing = self._vanished = 0
        self._votes = 0.0

    def _await_the_truth(self, now: _Kept) -> None:
        """End the doubt where what was there is there again, or where the car stands and its view has changed."""
        before, covered = self._before, self._covered
        if before is None or covered is None or _is_loose(now.scan.ranges_m[sector(now.scan, -AHEAD_RAD, AHEAD_RAD)]):
            return
        if covered.correction is not None and not self._stood_since_s < now.scan.stamp_s:  # NaN is not smaller
            self._covered = now.scan  # the first at rest: another motion is taken out of turns in the drive
        stands = now.scan.stamp_s - self._stood_since_s >= STANDS_FOR_S  # NaN is not larger
        changed = stands and _changed_share(covered, now.scan) > CHANGED_SHARE[self.doubt]
        if changed or (self.doubt == VANISHED and _back_share(before, now, self._lidar_m) > BACK_SHARE):
            self._trust_again()

    def _trust_again(self) -> None:
        self.doubt, self._before, self._covered = "", None, None
        self._kept.clear()


def _has_vanished(base: _Kept, now: _Kept, lidar_m: complex) -> bool:
    """Return whether a blank is seen beyond most of what was near ahead, whichever way the car has turned."""
    for slip_rad in SLIPS_RAD:
        there_m, here_m = _expected(base, now, lidar_m, slip_rad)
        if there_m.size * _every(now.scan) * now.scan.angle_step_rad < ENOUGH_SHARE * 2.0 * AHEAD_RAD:
            return False
        beyond = here_m > FARTHER_SHARE * there_m + FARTHER_M  # NaN is not larger
        if np.mean(beyond) <= VANISHED_SHARE or not _is_blank(here_m[beyond]):
            return False
    return True


def _is_blank(ranges_m: Floats) -> bool:
    low_m, high_m = quantile(ranges_m, 0.1), quantile(ranges_m, 0.9)
    return bool(high_m - low_m < BLANK_SPREAD_M or low_m > BLANK_BEYOND_M) or _is_loose(ranges_m)


def _is_loose(ranges_m: npt.NDArray[np.floating[Any]]) -> bool:
    """Return whether no two neighbours among these ranges, NaN where there is none, belong together."""
    steps_m = np.abs(np.diff(ranges_m[np.isfinite(ranges_m)]))
    return bool(steps_m.size > 0 and median(steps_m) > BLANK_STEP_M)


def _back_share(base: _Kept, now: _Kept, lidar_m: complex) -> float:
    there_m, here_m = _expected(base, now, lidar_m)
    return float(np.mean(np.abs(here_m - there_m) < BACK_M)) if there_m.size else 0.0


def _changed_share(covered: Scan, now: Scan) -> float:
    if covered.ranges_m.shape != now.ranges_m.shape:
        return 1.0
    ahead = sector(now, -AHEAD_RAD, AHEAD_RAD)
    low_m = high_m = covered.ranges_m
    if covered.correction is not None:  # a sample may be in the next beam at the next turn
        three_m = [np.roll(covered.ranges_m, by) for by in (-1, 0, 1)]
        low_m, high_m = np.fmin.reduce(three_m), np.fmax.reduce(three_m)
    off_m = np.maximum(now.ranges_m - high_m, low_m - now.ranges_m)[ahead]
    return float(np.mean(off_m > LIVE_M)) if off_m.size else 0.0  # NaN is not larger


def _expected(base: _Kept, now: _Kept, lidar_m: complex, slip_rad: float = 0.0) -> tuple[Floats, Floats]:
    """Return the ranges (k,) at which near points of an earlier scan are due now, ahead, and those measured there."""
    part = sector(base.scan, -AHEAD_RAD, AHEAD_RAD)
    part = slice(part.start, part.stop, _every(base.scan))
    range_m = base.scan.ranges_m[part]
    points = points_m(base.scan, part)[:, range_m < NEAR_M]  # NaN is not smaller
    x_m, y_m, yaw_rad = _moved(base.pose, now.pose)
    yaw_rad += slip_rad
    seen = (points[0] + 1j * points[1] + lidar_m - complex(x_m, y_m)) * complex(
        math.cos(yaw_rad), -math.sin(yaw_rad)
    ) - lidar_m
    place = np.rint((np.angle(seen) - now.scan.angle_min_rad) / now.scan.angle_step_rad).astype(np.intp)
    ahead = (np.abs(np.angle(seen)) < AHEAD_RAD) & (place >= 0) & (place < now.scan.ranges_m.size)
    return np.abs(seen[ahead]), now.scan.ranges_m[place[ahead]]


def _every(scan: Scan) -> int:
    """Return the interval of the beams that are compared."""
    return max(1, round(EVERY_RAD / scan.angle_step_rad))


def _moved(start: OdometryState, end: OdometryState) -> Shift:
    """Return the shift of base_link from one pose to another, in the frame of the first."""
    off = complex(end.x_m - start.x_m, end.y_m - start.y_m) * complex(math.cos(start.yaw_rad), -math.sin(start.yaw_rad))
    return off.real, off.imag, math.remainder(end.yaw_rad - start.yaw_rad, math.tau)
