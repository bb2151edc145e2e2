"""What a source has kept of its promises, by odometry: it decides whether the next one is believed, and how widely.

A promise is compared with where the car was then driven, and with the promise of the next scan. A source that left its
own path, or took it back, is judged by its arc until it has kept promises for a while again.
"""

import math
from typing import NamedTuple

import numpy as np

from wallride.runtime.control.perception.geometry import Places, beside_path_m
from wallride.runtime.control.perception.motion.own_motion import DrivenPlace

REMEMBERED_S = 0.3
"""Time for which a promise is compared with the way driven: the odometry of longer ways errs itself."""
GAP_S = 0.15
"""Longest time between two promises of one series."""
KEPT_S, KEPT_WAY_M = 0.5, 1.0
"""Time and way over which a source has to keep its promises before they are believed."""
LEAST_MARGIN_M = 0.05
"""Least margin beside a promised path, whatever the source says of itself: noise of the scan and of the odometry."""
SPARE_M = 0.01
ODOMETRY_SHARE = 0.08
"""Error aside over the way driven, of the odometry at most 0.045, and of sources that correct errors: with 0.05 `line`
left its path on 10 scans of 4 laps, with 0.08 on none."""
FADES_S = 3.0
"""Time constant with which an error measured once is forgotten."""
AGREES_M, AGREES_RAD, TURN_ERROR_RADPM = 0.06, 0.05, 0.10
"""How far a new promise may be beside an earlier one: noise of the pose, of its heading, and the odometry's turn, which
errs by the metre: by 0.06 in 99 % of cases, with grip, tyres or servo other than assumed."""
SHIFT_M = 0.10
"""How much farther a pose that is corrected at once may shift a path: the margin is wider by that, and so covers both
paths. Beyond it the path was taken back."""

LEFT = "it left its path"
TAKEN_BACK = "it took its path back"


class Given(NamedTuple):
    """A promise as it was given here. path_m: (n,), in its frame. margin_m: to each side."""

    here: DrivenPlace
    path_m: Places
    margin_m: float


class PromiseRecord(NamedTuple):
    """A value, of which each judgement of a scan returns the next.

    given: the last promises. stamp_s: that of the last scan. since_s: stamp at which the series that was kept begins.
    kept_m: way driven since. off_m: largest distance from a promise, fading. refused: how many promises were not
    believed. reason: why the last one was not, "" where it was.
    """

    given: tuple[Given, ...] = ()
    stamp_s: float = -math.inf
    since_s: float = math.inf
    kept_m: float = 0.0
    off_m: float = 0.0
    refused: int = 0
    reason: str = ""

    @property
    def words(self) -> tuple[str, ...]:
        """Why the last promise was not believed, in a sentence for the user; nothing where it was."""
        return (f"the promised path is not believed: {self.reason} ({self.refused} times)",) if self.reason else ()

    def margin_m(self, said_m: float) -> float:
        """Return the margin for a source that says this of itself."""
        return max(said_m, LEAST_MARGIN_M, self.off_m + SPARE_M)

    def trusts(self, here: DrivenPlace) -> bool:
        """Whether promises have been kept for long enough."""
        return here.stamp_s - self.since_s >= KEPT_S and self.kept_m >= KEPT_WAY_M

    def refusing(self, reason: str) -> "PromiseRecord":
        """Return the record after a promise that is not believed."""
        return self._replace(refused=self.refused + 1, reason=reason)

    def restarted(self, here: DrivenPlace, reason: str) -> "PromiseRecord":
        """Return the record of a source that has to keep promises anew."""
        return PromiseRecord(stamp_s=here.stamp_s, off_m=self.off_m, refused=self.refused + 1, reason=reason)

    def corrected(self, before: DrivenPlace) -> "PromiseRecord":
        """Return the record with the last promise at the place that its own scan has corrected."""
        if not self.given or self.given[-1].here.stamp_s != before.stamp_s or self.given[-1].here == before:
            return self
        last = self.given[-1]
        path_m = before.in_frame_m(last.here.in_base_m(last.path_m))
        return self._replace(given=(*self.given[:-1], last._replace(here=before, path_m=path_m)))

    def after(self, here: DrivenPlace, path_m: Places, said_m: float) -> "PromiseRecord":
        """Return the record after the promise of a new scan; path_m: (n,), in its frame."""
        given = tuple(one for one in self.given if here.stamp_s - one.here.stamp_s <= REMEMBERED_S)
        if not given or here.stamp_s - given[-1].here.stamp_s > GAP_S:
            new = Given(here, path_m, self.margin_m(said_m))
            return self._replace(given=(new,), stamp_s=here.stamp_s, since_s=here.stamp_s, kept_m=0.0, reason="")
        now_m = [_kept_m(here, one) for one in given]
        off_m = max(*now_m, self.off_m * math.exp((self.stamp_s - here.stamp_s) / FADES_S))
        if any(off > one.margin_m for off, one in zip(now_m, given, strict=True)):
            return self.restarted(here, LEFT)._replace(off_m=off_m)
        shift_m = max(_shift_m(here, path_m, one) for one in (given[0], given[-1]))
        if shift_m > SHIFT_M:
            return self.restarted(here, TAKEN_BACK)._replace(off_m=off_m)
        if shift_m > 0.0:
            off_m = max(off_m, LEAST_MARGIN_M + shift_m)
            given = tuple(one._replace(margin_m=max(one.margin_m, off_m + SPARE_M)) for one in given)
        new = Given(here, path_m, self._replace(off_m=off_m).margin_m(said_m))
        kept_m = self.kept_m + abs(here.way_m - given[-1].here.way_m)
        return self._replace(given=(*given, new), stamp_s=here.stamp_s, kept_m=kept_m, off_m=off_m, reason="")


NO_PROMISES = PromiseRecord()


def _kept_m(here: DrivenPlace, given: Given) -> float:
    """Return how far the car is beside an earlier promise, less what the odometry may err."""
    off_m = float(beside_path_m(np.array([here.at_m]), given.path_m)[0])
    return max(0.0, off_m - ODOMETRY_SHARE * abs(here.way_m - given.here.way_m))


def _shift_m(here: DrivenPlace, path_m: Places, given: Given) -> float:
    """Return how far a new path is beside an earlier one, as far as both reach, less what pose and odometry may err."""
    apart_m = beside_path_m(path_m, given.path_m)
    way_m = abs(here.way_m - given.here.way_m)
    known_m = AGREES_M + ODOMETRY_SHARE * way_m
    angle_rad = AGREES_RAD + TURN_ERROR_RADPM * way_m
    return float((apart_m - known_m - angle_rad * np.abs(path_m - here.at_m)).max())
