"""Sectors of 2.5 degrees that group the beams in front of the shoulders: the state of each, scan after scan.

A sector sees when three beams in ten agree with their neighbours; the places of the full sectors of the last scan,
transformed by odometry, determine which sectors are expected to see.
"""

import cmath
import math
from typing import Any

import numpy as np

from wallride.drivers.accelerated import accelerated
from wallride.drivers.api import Scan
from wallride.drivers.value import value
from wallride.runtime.control.perception.geometry import Booleans, Bytes, Floats, Places
from wallride.runtime.control.perception.view import LEARNT_DIRT_NEARER_THAN_M, View
from wallride.runtime.control.vehicle import CarSettings

AHEAD_RAD = math.radians(60)
ASIDE_RAD = math.radians(105)
"""Maximum bearing of the sectors: silence ahead is judged by its borders."""
SECTOR_RAD = math.radians(2.5)
ON_LIDAR_SPARE_M = 0.03
"""Tolerance around the outline: a cover at its edge returns from both sides of it."""
ON_LIDAR_GAP_BEAMS = 3
SEES_SHARE, FULL_SHARE, SILENT_SHARE = 0.3, 0.8, 0.15
SAME_THING_M, SAME_THING_SHARE = 0.15, 0.12
"""Tolerance, plus its share of the range, within which neighbouring beams agree: a wall at a grazing angle does, an
outlier does not."""
BESIDE_SECTORS = 0.3
"""Tolerance beside two neighbours that have seen: a sector whose middle lies between them is expected to see."""
MAX_BETWEEN_SECTORS = 2.1
"""Maximum distance of transformed neighbours, tolerances included: 1.5 sectors without; farther apart is a gap."""

SEEN, DEPTH, GONE, UNPROVEN, MISSING, BLIND = range(6)
"""States of a sector. GONE: depth since this scan; MISSING: unproven since this scan, where an echo was expected."""


@value(eq=False)
class Sectors:
    """Grouping of the beams of one kind of lidar: first beam, beams per sector, count, bearing of the first sector."""

    first: int
    beams: int
    count: int
    first_rad: float
    width_rad: float

    def bearing_rad(self, sector: int) -> float:
        """Return the bearing of a sector's middle."""
        return self.first_rad + sector * self.width_rad

    def ahead(self) -> slice:
        """Return the sectors within AHEAD_RAD."""
        first = max(0, math.ceil((-AHEAD_RAD - self.first_rad) / self.width_rad))
        last = min(self.count - 1, math.floor((AHEAD_RAD - self.first_rad) / self.width_rad))
        return slice(first, last + 1)


def sectors_of(scan: Scan) -> Sectors:
    """Return the sectors of the lidar that took a scan; count is 0 where it does not look ahead."""
    step_rad, total = abs(scan.angle_step_rad), scan.ranges_m.shape[0]
    beams = max(1, round(SECTOR_RAD / step_rad))
    middle = round(-scan.angle_min_rad / scan.angle_step_rad) - beams // 2
    half = min(int(ASIDE_RAD / (beams * step_rad)), middle // beams, (total - middle - beams) // beams)
    if half < 1 or scan.angle_step_rad <= 0:
        return Sectors(0, 1, 0, 0.0, SECTOR_RAD)
    first = middle - half * beams
    first_rad = scan.angle_min_rad + scan.angle_step_rad * (first + (beams - 1) / 2)
    return Sectors(first, beams, 2 * half + 1, first_rad, beams * scan.angle_step_rad)


def runs(which: Booleans) -> list[tuple[int, int]]:
    """Return (first, last) of every run of True in (n,)."""
    told, found = which.tobytes() + b"\0", []  # on a hundred flags several times as fast as numpy's own way
    first = told.find(1)
    while first >= 0:
        end = told.find(0, first)
        found.append((first, end - 1))
        first = told.find(1, end)
    return found


def next_seen(seen: Places, sector: int, step: int) -> int | None:
    """Return the next sector, to the left (step 1) or right (-1) of one, that sees something in this scan."""
    sector += step
    while 0 <= sector < seen.size:
        if seen[sector] == seen[sector]:  # no NaN
            return sector
        sector += step
    return None


Watched = tuple[Bytes, Places]
"""State of each sector and the places held by the full ones, (n,) each, as `watch_sectors` returns them."""
Motion = tuple[complex, float]
"""How the car has moved [m, x + iy] and turned [rad] since the scan before, in base_link of that."""


def _flat_sectors(
    view: View, sectors: Sectors, before: Watched, motion: Motion, car: CarSettings, within_m: float
) -> tuple[Any, ...]:
    moved_m, turned_rad = motion
    return (
        view.ranges_m, view.x_m, view.y_m, view.no_echo, view.own, view.dirty, *before, sectors.first, sectors.beams,
        sectors.first_rad, sectors.width_rad, view.lidar_m.real, view.lidar_m.imag, car.front_m, car.half_width_m,
        within_m, moved_m.real, moved_m.imag, turned_rad,
    )  # fmt: skip


@accelerated(flat=_flat_sectors)
def watch_sectors(
    view: View, sectors: Sectors, before: Watched, motion: Motion, car: CarSettings, within_m: float
) -> tuple[Bytes, Places, Places, int, int, int]:
    """Return the state of each sector after one more scan.

    state, (n,); a place that each sector sees, and only of the full ones, (n,), base_link, NaN for none; the longest
    row of beams that return from on the lidar; how many sectors ahead are unproven or blind; how many
    have become silent since the previous scan.

    before: what this has returned for the scan before. within_m: how far anything is expected to be seen; 0: nothing
    is.
    """
    (state, held), (moved_m, turned_rad) = before, motion
    first, beams, first_rad, width_rad = sectors.first, sectors.beams, sectors.first_rad, sectors.width_rad
    ranges_m, x_m, y_m = view.ranges_m, view.x_m, view.y_m
    count, part = state.size, slice(first, first + state.size * beams)
    links = linked(view, part).reshape(count, beams)
    seeing = np.count_nonzero(links, axis=1)
    off_middle = np.abs(np.arange(beams) * 2 - (beams - 1))
    pick = np.where(links, off_middle, 2 * beams).argmin(axis=1) + np.arange(count) * beams + first
    sees = seeing >= max(2.0, SEES_SHARE * beams)
    nothing = complex(math.nan, math.nan)
    seen = np.where(sees, x_m[pick] + 1j * y_m[pick], nothing)
    new_held = np.where(sees & (seeing >= FULL_SHARE * beams), seen, nothing)
    off = (held - moved_m) * cmath.rect(1.0, -turned_rad) - view.lidar_m
    place = np.where(np.abs(off) < within_m, (np.angle(off) - first_rad) / width_rad, math.nan)
    silent = ~sees & (seeing <= SILENT_SHARE * beams)
    new_state = np.where((state == MISSING) | (state == GONE), state - 1, state).astype(np.int8)
    new_state[silent & (state == SEEN)] = GONE
    new_state[silent & _expected(place, count) & (state != BLIND)] = MISSING
    new_state[sees] = SEEN
    bearing_rad = first_rad + width_rad * np.arange(count)
    suspects = np.count_nonzero((new_state >= UNPROVEN) & (np.abs(bearing_rad) <= AHEAD_RAD))
    gone = np.count_nonzero((new_state == GONE) | (new_state == MISSING))
    near = np.zeros(ranges_m.size, np.bool_)
    near[part] = x_m[part] <= car.front_m + ON_LIDAR_SPARE_M
    near[part] &= np.abs(y_m[part]) <= car.half_width_m + ON_LIDAR_SPARE_M
    near[part] &= np.repeat(np.abs(bearing_rad) <= AHEAD_RAD, beams)
    return new_state, seen, new_held, row_on_lidar(near, view.own), int(suspects), int(gone)


def linked(view: View, part: slice) -> Booleans:
    """Return which beams of a part, (k,), return what a neighbour returns too: no own parts, no dirt."""
    range_m, echo = view.ranges_m[part], ~(view.no_echo[part] | view.own[part])
    if view.dirty is not None:
        echo &= ~(view.dirty[part] & (range_m < LEARNT_DIRT_NEARER_THAN_M))
    agree = echo[1:] & echo[:-1]
    agree &= np.abs(range_m[1:] - range_m[:-1]) <= SAME_THING_M + SAME_THING_SHARE * range_m[:-1]
    linked = np.zeros(range_m.size, np.bool_)
    linked[1:] |= agree
    linked[:-1] |= agree
    return linked


def _expected(place: Floats, count: int) -> Booleans:
    """Return in which sectors, (count,), something is due, by the places, (n,), of neighbours; NaN for none."""
    right, left = place[:-1] - BESIDE_SECTORS, place[1:] + BESIDE_SECTORS
    between = (left > right) & (left - right <= MAX_BETWEEN_SECTORS)
    right, left = np.ceil(right[between]), left[between]
    expected = np.zeros(count, np.bool_)
    for step in range(3):
        there = right[(right + step <= left) & (right + step >= 0) & (right + step < count)] + step
        expected[there.astype(np.intp)] = True
    return expected


def row_on_lidar(near: Booleans, own: Booleans) -> int:
    """Return the length of the longest run of near beams of which a third are within the outline; both (beams,)."""
    index = np.flatnonzero(near)
    if not index.size:
        return 0
    cut = np.flatnonzero(np.diff(index) > ON_LIDAR_GAP_BEAMS)
    firsts, lasts = index[[0, *(cut + 1)]], index[[*cut, -1]]
    longest = 0
    for begin, end in zip(firsts.tolist(), lasts.tolist(), strict=True):
        if 3 * np.count_nonzero(own[begin : end + 1]) >= end - begin + 1:
            longest = max(longest, end - begin + 1)
    return longest
