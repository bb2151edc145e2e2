"""Borders of silence, beam by beam: a border that is stationary in the world while the car moves is not a cover's.

A cover is fixed to the lidar: whatever emerges from it, its border keeps its bearing. The end of a wall keeps its
place: its bearing changes as odometry predicts. Sectors resolve a change of 2.5 degrees, beams a much smaller one.
"""

import cmath
import math
from collections import deque
from collections.abc import Iterable

import numpy as np

from wallride.drivers.value import value
from wallride.runtime.control.perception.geometry import Booleans, Floats, Places
from wallride.runtime.control.perception.odometry import OdometryState
from wallride.runtime.control.perception.view import View
from wallride.runtime.control.perception.visibility.lidar_sectors import Sectors, linked

STAYS_FOR_M = 0.25
STAYS_FOR_BEAMS = 3.0
"""Minimum distance moved, and minimum expected change of the bearing of a stationary border, to be judged."""
MIN_SCANS = 5
STAYS_SHARE = (0.6, 2.0)
"""Accepted shares of the change expected of a stationary border; the bearing of one moving with the car is constant.
Bearings are whole beams, so the share is coarse."""
STRAYS_BEAMS = 1.0
"""Maximum scatter (RMS) of the bearing of a border that can be tracked; quantization to whole beams alone is 0.3."""
SAME_BORDER_RAD = math.radians(2.5)
FADES_WITHIN_S = 1.0
FADES_NEARER_THAN_M = 8.0
FADES_BETWEEN_SECTORS = 4.2
"""Maximum distance of neighbours on one wall, which separate within a second; on two objects they are farther apart."""
FADES_STRAIGHT_RAD = 0.1
"""Maximum change of heading within that time: walls farther away fade by themselves at a grazing angle, as do dark ones
from which the car turns, and the heading of a car that slides through a bend and back is wrong."""
BESIDE_RAD = math.radians(5)
"""Maximum angle between the first beam that sees and the middle of the last silent sector: a barely seeing sector may
lie between them."""


@value(eq=False)
class Border:
    """One end of a silence: the first beam that sees. step: 1 for the left end, -1 for the right one."""

    step: int
    bearing_rad: float
    range_m: float


def find_border(view: View, sectors: Sectors, first: int, last: int, step: int) -> Border | None:
    """Return the border within sectors first to last: the first of them (step 1), or the last (step -1), is silent."""
    part = slice(sectors.first + first * sectors.beams, sectors.first + (last + 1) * sectors.beams)
    found = np.flatnonzero(linked(view, part))
    if not found.size:
        return None
    beam = part.start + int(found[0 if step > 0 else -1])
    return Border(step, float(view.bearing_rad[beam]), float(view.ranges_m[beam]))


class _BorderTrack:
    """Tracks one border over the scans: its expected bearing if stationary where first seen, and its measured one."""

    def __init__(self, border: Border, pose: OdometryState, lidar_m: complex) -> None:
        self.border, self.stays = border, False
        self._begin, self._lidar_m = pose, lidar_m
        at = lidar_m + cmath.rect(border.range_m, border.bearing_rad)
        self._odom_m = complex(pose.x_m, pose.y_m) + at * cmath.rect(1.0, pose.yaw_rad)
        self._bearing_rad = border.bearing_rad
        self._should_rad: list[float] = [0.0]
        self._is_rad: list[float] = [0.0]

    def add(self, border: Border, pose: OdometryState, beam_rad: float) -> None:
        """Add the border of the present scan."""
        self.border = border
        off = (self._odom_m - complex(pose.x_m, pose.y_m)) * cmath.rect(1.0, -pose.yaw_rad) - self._lidar_m
        self._should_rad.append(math.remainder(cmath.phase(off) - self._bearing_rad, math.tau))
        self._is_rad.append(border.bearing_rad - self._bearing_rad)
        way_m = math.hypot(pose.x_m - self._begin.x_m, pose.y_m - self._begin.y_m)
        if way_m >= STAYS_FOR_M and len(self._is_rad) >= MIN_SCANS:
            self.stays = _stays(np.array(self._should_rad), np.array(self._is_rad), beam_rad)


def _stays(should_rad: Floats, is_rad: Floats, beam_rad: float) -> bool:
    """Return whether the bearings (n,) have changed as expected of a stationary border."""
    should, seen = should_rad - should_rad.mean(), is_rad - is_rad.mean()
    if np.ptp(should_rad) < STAYS_FOR_BEAMS * beam_rad:
        return False
    share = float(should @ seen / (should @ should))
    strays_rad = float(np.sqrt(np.mean((seen - share * should) ** 2)))
    return STAYS_SHARE[0] <= share <= STAYS_SHARE[1] and strays_rad <= STRAYS_BEAMS * beam_rad


class Borders:
    """Tracks the borders of all silences that can be proven, from scan to scan."""

    def __init__(self, lidar_m: complex) -> None:
        self._lidar_m = lidar_m
        self._tracks: list[_BorderTrack] = []

    def update(self, borders: Iterable[Border], pose: OdometryState, beam_rad: float) -> None:
        """Update from the borders of one more scan; a border that is no longer seen is dropped."""
        old, self._tracks = self._tracks, []
        for border in borders:
            near = [
                track
                for track in old
                if track.border.step == border.step
                and abs(track.border.bearing_rad - border.bearing_rad) <= SAME_BORDER_RAD
            ]
            if near:
                near[0].add(border, pose, beam_rad)
            self._tracks.append(near[0] if near else _BorderTrack(border, pose, self._lidar_m))

    def stays(self, step: int, bearing_rad: float) -> bool:
        """Return whether the border beside a silent sector, with its middle at this bearing, is stationary."""
        return any(
            track.stays and track.border.step == step and abs(track.border.bearing_rad - bearing_rad) <= BESIDE_RAD
            for track in self._tracks
        )


class Fading:
    """Detects walls that have gradually become silent within a second: a growing cover has no sudden edge.

    From scan to scan nothing is missing: a fading sector no longer fills the gap between its neighbours.
    """

    def __init__(self, lidar_m: complex) -> None:
        self._lidar_m = lidar_m
        self._views: deque[tuple[float, complex, Places]] = deque()

    def missing(self, held: Places, pose: OdometryState, stamp_s: float, sectors: Sectors) -> Booleans:
        """Return the sectors (n,) in which the places seen a second ago are expected.

        held: (n,), base_link, a place that each full sector sees now, NaN for none.
        """
        turned = cmath.rect(1.0, pose.yaw_rad)
        at_m = complex(pose.x_m, pose.y_m)
        self._views.append((stamp_s, turned, held * turned + at_m))
        while stamp_s - self._views[0][0] > FADES_WITHIN_S or stamp_s < self._views[0][0]:
            self._views.popleft()
        if any(abs(cmath.phase(turned * then.conjugate())) > FADES_STRAIGHT_RAD for _, then, _ in self._views):
            return np.zeros(sectors.count, np.bool_)
        _, _, places = self._views[0]
        off = (places - at_m) * turned.conjugate() - self._lidar_m
        place = (np.angle(off) - sectors.first_rad) / sectors.width_rad
        place[~(np.abs(off) < FADES_NEARER_THAN_M)] = math.nan
        right, left = np.minimum(place[:-1], place[1:]), np.maximum(place[:-1], place[1:])
        between = left - right <= FADES_BETWEEN_SECTORS
        first, last = np.ceil(right[between]), np.floor(left[between])
        there = np.zeros(sectors.count, np.bool_)
        for step in range(math.ceil(FADES_BETWEEN_SECTORS)):
            index = (first + step)[(first + step <= last) & (first + step >= 0) & (first + step < sectors.count)]
            there[index.astype(np.intp)] = True
        return there
