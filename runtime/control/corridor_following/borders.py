"""The two borders of the way on in one scan, and how far it is seen. Wall on the left.

What a scan sees is a star around the lidar. The only ways out of it are the gaps between neighbouring returns. So each
gap divides the returns, in the order of the beams, into a left and a right border. Returns beyond REACH_M are left out:
where a corridor goes on beyond it, that is a gap as well.
"""

from typing import Final, NamedTuple

import numpy as np

from wallride.drivers.value import value
from wallride.runtime.control.perception.geometry import Floats, Places
from wallride.runtime.control.wall_following.followed_wall import SideView

REACH_M: Final = 9.0
WIDE_GAP_M, KEPT_GAP_M, LEAST_GAP_M = 1.6, 1.2, 0.9
"""Least width of a gap: what `ball` takes for the end of its wall; where the way leads through; where no other is."""
COARSE: Final = 3.0
"""A gap that is not this much wider than the spacing of the returns beside it is a wall seen along it."""
COARSE_BEAMS: Final = 4
"""Number of beams from which a gap is one whatever the spacing beside it is."""
THINNED_TO_M: Final = 0.08
BEHIND_RAD: Final = 1.9
"""Bearing from which a gap on the free side lies behind the car."""
LEAST_RETURNS: Final = 5


@value(eq=False)
class CourseReturns:
    """The returns of a scan within reach, in the order of WallSide: places_m (n,) in base_link, bearing_rad (n,).

    gaps: indices (k,) of the returns after which there is a gap, those from the followed wall on, in order.
    kept: those of at least KEPT_GAP_M: one that the way led through may be measured less wide for some scans.
    sight_rad, sight_m: (m,) bearings from the lidar, rising, and how far is seen there.
    """

    places_m: Places
    gaps: tuple[int, ...]
    kept: tuple[int, ...]
    lidar_m: complex
    sight_rad: Floats
    sight_m: Floats

    def sees(self, places_m: Places) -> Floats:
        """Return by how much farther than places (k,) is seen in their direction, (k,); negative for hidden ones."""
        there = places_m - self.lidar_m
        spare_m: Floats = np.interp(np.angle(there), self.sight_rad, self.sight_m) - np.abs(there)
        return spare_m


class CourseBorders(NamedTuple):
    """The returns on both sides of a gap, thinned, (n,) and (m,) in base_link."""

    left_m: Places
    right_m: Places


def returns_of(seen: SideView, lidar_m: complex) -> CourseReturns | None:
    """Return what a scan has within reach; None where there is no wall beside the car."""
    index = np.flatnonzero(seen.solid & (seen.range_m < REACH_M))
    beside = seen.side.beside
    first, last = (int(np.searchsorted(index, end)) for end in (beside.start, beside.stop))
    if index.size < LEAST_RETURNS or last <= first:
        return None
    places_m = seen.x_m[index] + 1j * seen.y_m[index]
    nearest = first + int(seen.range_m[index[first:last]].argmin())
    step_m = np.abs(np.diff(places_m))
    beside_m = np.maximum(np.concatenate([step_m[:1], step_m[:-1]]), np.concatenate([step_m[1:], step_m[-1:]]))
    apart = (step_m > LEAST_GAP_M) & ((step_m > COARSE * beside_m) | (np.diff(index) > COARSE_BEAMS))
    apart[:nearest] = False
    apart &= seen.side.bearing_rad[index[1:]] > -BEHIND_RAD
    gaps = np.flatnonzero(apart)
    wide, kept = gaps[step_m[gaps] > WIDE_GAP_M], gaps[step_m[gaps] > KEPT_GAP_M]
    echo = np.flatnonzero(seen.solid)[::-1]
    return CourseReturns(
        places_m, tuple((wide if wide.size else gaps).tolist()), tuple(kept.tolist()), lidar_m,
        seen.side.bearing_rad[echo], np.minimum(seen.range_m[echo], REACH_M),
    )  # fmt: skip


def borders_at(returns: CourseReturns, gap: int) -> CourseBorders:
    """Return the borders of the way through a gap."""
    return CourseBorders(_thinned(returns.places_m[: gap + 1]), _thinned(returns.places_m[gap + 1 :]))


def _thinned(places_m: Places) -> Places:
    """Return places (n,) thinned to one per THINNED_TO_M, and the first and the last one."""
    way_m = np.abs(np.diff(places_m)).cumsum()
    cell = (way_m / THINNED_TO_M).astype(np.intp)
    keep = np.ones(places_m.size, np.bool_)
    if cell.size > 1:
        keep[1:-1] = cell[1:] != cell[:-1]
    return places_m[keep]


def leads_through(returns: CourseReturns, gap: int, way_m: Places, course: Places) -> bool:
    """Whether a way (n,) with its directions (n,) leads through a gap: one end on its left, the other on its right."""
    ends_m = returns.places_m[gap : gap + 2]
    nearest = np.abs(way_m[:, None] - ends_m).argmin(axis=0)
    left, right = ((ends_m - way_m[nearest]) * course[nearest].conj()).imag
    return bool(left > 0.0 > right)
