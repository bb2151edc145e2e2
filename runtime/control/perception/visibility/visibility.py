"""Visibility ahead of the lidar and its blind areas: missing echoes and returns from the car itself are not free space.

The beams in front of the car's shoulders are grouped in sectors of 2.5 degrees. A sector without returns is *depth*
where that is explained: it had returns a moment ago and the surface has moved elsewhere (every wall point of the last
scan is transformed by odometry), or the wall beside it leads out of range. It is *blind* where walls in range, seen in
the last scan, are missing over 15 degrees at once, or where the edge of the silence moves with the car although walls
emerge from it. Everything else is *unproven*, as all silence is at the start, until the next echo.

`unknown_regions` turns this into regions that the car's outline must not reach. Reasons:
`docs/decisions/0015-visibility.md`.
"""

import cmath
import math

import numpy as np

from wallride.drivers.api import Scan
from wallride.runtime.control.perception.geometry import NOWHERE, Booleans, Bytes, Floats, Places
from wallride.runtime.control.perception.odometry import OdometryState
from wallride.runtime.control.perception.view import View
from wallride.runtime.control.perception.visibility.lidar_sectors import (
    BLIND,
    DEPTH,
    GONE,
    MISSING,
    SECTOR_RAD,
    SEEN,
    UNPROVEN,
    Sectors,
    next_seen,
    runs,
    sectors_of,
    watch_sectors,
)
from wallride.runtime.control.perception.visibility.silence_borders import Border, Borders, Fading, find_border
from wallride.runtime.control.perception.visibility.unknown_regions import SectorView, Unknown, find_unknown
from wallride.runtime.control.vehicle import CarSettings

ON_LIDAR_RAD = math.radians(3)
"""Minimum width of a row of returns from within the outline that counts as an object on the lidar: no part of a car is
in front of its shoulders."""
EXPECTED_WITHIN_M = 12.0
EXPECTED_SHARE = 0.9
"""Share of the sensor's own range beyond which no echo is expected."""
LATEST_S = 0.15
"""Maximum time between two scans of 40 Hz for which echoes are expected: after more, people have moved and odometry
drifted."""
DOUBTED_SECTORS, SILENCED_SECTORS, BLIND_SECTORS, COVERED_SECTORS = 2, 5, 6, 12
"""Numbers of sectors missing at once that make the sectors between them doubted, or blind; the largest is a cover. Real
halls lose up to 25 degrees at once, for a scan or two: dark walls seen at a grazing angle, panes."""
REMEMBERS_S = 0.04
"""Time for which the last echoes remain valid where the lidar becomes blind, unless it is covered."""
GRAZING_SECTORS = 1.5
"""Distance by which the wall beside the silence is extrapolated into it."""
FIXED_FOR_M = 0.25
FIXED_SECTORS = 2
FADED_SECTORS, FADED_BLIND_SECTORS = 4, 8
"""Numbers of sectors of one silence with walls a second ago that make it doubted, or blind: a growing cover.
Only where the silence includes the heading: to the side, a real dirty window hides up to 13 of them."""
FADES_EVERY_S = 0.09
BLIND_MISSING_SECTORS = 3
"""Minimum number of unexpectedly silent sectors among them: silent beams are often beside depth."""
MAX_LOST = 256


class Visibility:
    """Tracks the visibility state of each sector and the places seen in the last scan.

    on_lidar: whether an object is on the lidar. suspicious: whether a sector ahead is unproven, missing or blind.
    """

    def __init__(self, car: CarSettings) -> None:
        self._car = car
        self._kind: tuple[float, float, int] | None = None
        self._bearing_rad: Floats | None = None
        """The array of the last view: one for all scans of a lidar."""
        self._sectors = Sectors(0, 1, 0, 0.0, SECTOR_RAD)
        self._state: Bytes = np.empty(0, np.int8)
        self._blind_s: Floats = np.empty(0)
        self._doubted: Booleans = np.empty(0, np.bool_)
        self._seen: Places = NOWHERE
        self._held: Places = NOWHERE
        self._pose = OdometryState()
        self._stamp_s = -math.inf
        self._before: tuple[OdometryState, Bytes] | None = None
        self._lidar_m = car.lidar_m
        self._borders = Borders(self._lidar_m)
        self._fading = Fading(self._lidar_m)
        self._fades_s = -math.inf
        self._view: View | None = None
        self._lost_m: Places = NOWHERE
        self.on_lidar = False
        self.suspicious = False

    @property
    def sectors(self) -> Sectors:
        """Return the sectors of the lidar in use."""
        return self._sectors

    @property
    def states(self) -> Bytes:
        """Return the state of each sector, from the right to the left."""
        return self._state

    def look(self, view: View, pose: OdometryState) -> None:
        """Update from one scan; pose: base_link in the odometry frame."""
        scan, car = view.scan, self._car
        if view.bearing_rad is not self._bearing_rad:
            self._meet(view)
        sectors, last, self._view = self._sectors, self._pose, view
        if not sectors.count:
            return
        fresh = 0.0 <= scan.stamp_s - self._stamp_s <= LATEST_S + view.waits_s
        moved = cmath.rect(1.0, -last.yaw_rad) * complex(pose.x_m - last.x_m, pose.y_m - last.y_m)
        turned_rad = math.remainder(pose.yaw_rad - last.yaw_rad, math.tau)
        self._pose, self._stamp_s, held = pose, scan.stamp_s, self._held
        self._state, self._seen, self._held, row, suspects, gone = watch_sectors(
            view, sectors, (self._state, held), (moved, turned_rad), car,
            min(EXPECTED_WITHIN_M, EXPECTED_SHARE * scan.range_max_m) if fresh else 0.0,
        )  # fmt: skip
        self.on_lidar = row * abs(scan.angle_step_rad) >= ON_LIDAR_RAD
        if suspects or gone >= SILENCED_SECTORS:
            self._judge()
            self._remember((held - moved) * cmath.rect(1.0, -turned_rad))
            suspects = int(np.count_nonzero(self._state[sectors.ahead()] >= UNPROVEN))
        self.suspicious = suspects > 0
        self._lost_m = self._lost_m[self._known(self._lost_here_m()) >= UNPROVEN] if suspects else NOWHERE

    def _lost_here_m(self) -> Places:
        """Return the places that were seen before and are missing now, (k,), base_link."""
        pose = self._pose
        return (self._lost_m - complex(pose.x_m, pose.y_m)) * cmath.rect(1.0, -pose.yaw_rad)

    def _meet(self, view: View) -> None:
        """Begin anew where another kind of lidar took this scan."""
        scan, self._bearing_rad = view.scan, view.bearing_rad
        kind = scan.angle_min_rad, scan.angle_step_rad, view.ranges_m.size
        if kind != self._kind:
            self._begin(scan, kind)

    def _begin(self, scan: Scan, kind: tuple[float, float, int]) -> None:
        self._kind, self._sectors = kind, sectors_of(scan)
        self._state = np.full(self._sectors.count, UNPROVEN, np.int8)
        self._blind_s = np.full(self._sectors.count, -math.inf)
        self._doubted = np.zeros(self._sectors.count, np.bool_)
        self._seen = self._held = np.full(self._sectors.count, complex(math.nan, math.nan), np.complex128)
        self._stamp_s, self._before, self._lost_m = -math.inf, None, NOWHERE
        self._borders = Borders(self._lidar_m)
        self._fading, self._fades_s = Fading(self._lidar_m), -math.inf
        self.on_lidar = self.suspicious = False

    def _remember(self, before_m: Places) -> None:
        """Store the places of the previous scan, (n,), base_link, that are missing now: they are assumed present."""
        if not np.any(self._state >= MISSING):
            return
        missing = before_m[self._known(before_m) >= MISSING]
        if missing.size:
            odom_m = missing * cmath.rect(1.0, self._pose.yaw_rad) + complex(self._pose.x_m, self._pose.y_m)
            self._lost_m = np.concatenate([self._lost_m, odom_m])[-MAX_LOST:]

    def _known(self, places_m: Places) -> Bytes:
        """Return the states of the sectors that contain the places (k,), base_link; SEEN beyond them."""
        off = places_m - self._lidar_m
        sector = np.rint((np.angle(off) - self._sectors.first_rad) / self._sectors.width_rad)
        inside = (sector >= 0) & (sector < self._state.size)  # NaN is not
        known = np.full(off.size, SEEN, np.int8)
        known[inside] = self._state[sector[inside].astype(np.intp)]
        return known

    def _judge(self) -> None:
        """Classify silence as blind where many sectors are missing at once, as depth where its borders prove it."""
        state, silent = self._state, self._state > SEEN
        self._doubted &= silent
        told = state.tobytes()  # its counts are several times as fast as numpy's on a hundred sectors
        for first, last in runs(silent):
            part = told[first : last + 1]
            missing = part.count(MISSING)
            at_once = missing + part.count(GONE)
            if missing >= DOUBTED_SECTORS or at_once >= SILENCED_SECTORS:
                places = [place for place, one in enumerate(part, first) if one in (MISSING, GONE)]
                blind = at_once >= (BLIND_SECTORS if missing >= BLIND_MISSING_SECTORS else BLIND_SECTORS + 1)
                self._doubt(places[0], places[-1], blind=blind)
            elif (missing or UNPROVEN in part) and self._is_depth(first, last):
                run = state[first : last + 1]
                run[((run == UNPROVEN) | (run == MISSING)) & ~self._doubted[first : last + 1]] = DEPTH

    def _doubt(self, first: int, last: int, *, blind: bool) -> None:
        """Mark sectors that have become silent at once: only echoes prove them again."""
        fresh = self._state[first : last + 1] != BLIND
        self._state[first : last + 1][fresh] = BLIND if blind else MISSING
        covered = last - first + 1 >= COVERED_SECTORS
        self._blind_s[first : last + 1][fresh] = -math.inf if covered else self._stamp_s
        self._doubted[first : last + 1] = True

    def _is_depth(self, first: int, last: int) -> bool:
        """Return whether no border of a silent run, right or left, indicates a cover and at least one depth."""
        right, left = self._leads_out(first, -1), self._leads_out(last, 1)
        return (right or left) is True and right is not False and left is not False

    def _leads_out(self, end: int, step: int) -> bool | None:
        """Return whether the silence that ends at this sector is depth; None where nothing borders it.

        It is depth where the sector was explained, where the border is stationary in the world while the car moves, or
        where the line of the wall outside leads out of range.
        """
        if self._is_explained(end, step) or self._borders.stays(step, self._sectors.bearing_rad(end)):
            return True
        beside = next_seen(self._seen, end, step)
        if beside is None:
            return None
        outer = next_seen(self._seen, beside, step)
        if outer is None:
            return False
        at, way = self._seen[beside] - self._lidar_m, self._seen[beside] - self._seen[outer]
        inward_rad = self._sectors.bearing_rad(beside) - step * GRAZING_SECTORS * self._sectors.width_rad
        return not crosses_within(complex(at), complex(way), inward_rad, EXPECTED_WITHIN_M)

    def _is_explained(self, end: int, step: int) -> bool:
        """Return whether the outermost two sectors of a silence are explained.

        One alone is not: a sector that a cover hides in part flickers, and its echoes have then moved next door.
        """
        part = self._state[max(0, end - 1) : end + 1] if step > 0 else self._state[end : end + 2]
        return all(one in (SEEN, DEPTH, GONE) for one in part.tolist())

    def learn(self) -> None:
        """Compare with the silence at an earlier pose: walls that emerge from a silence that moves with the car."""
        view, self._view = self._view, None
        self._borders.update(
            self._unproven_borders(view) if view is not None and self.suspicious else (), self._pose, self._beam_rad()
        )
        if view is not None and not 0.0 <= self._stamp_s - self._fades_s < FADES_EVERY_S:
            self._fades_s = self._stamp_s
            self._doubt_what_fades()
        if not self.suspicious:
            self._before = None
            return
        if self._before is None:
            self._before = self._pose, self._state.copy()
            return
        pose, state = self._before
        if math.hypot(self._pose.x_m - pose.x_m, self._pose.y_m - pose.y_m) < FIXED_FOR_M:
            return
        for first, last in runs(self._state >= UNPROVEN):
            if self._goes_along(pose, state, first, last):
                self._state[first : last + 1] = BLIND
                self._blind_s[first : last + 1] = -math.inf
        if not np.array_equal(state >= UNPROVEN, self._state >= UNPROVEN):
            self._before = self._pose, self._state.copy()

    def _doubt_what_fades(self) -> None:
        """Doubt the silence straight ahead where it gradually covers walls that were seen a second ago."""
        missing = self._fading.missing(self._held, self._pose, self._stamp_s, self._sectors)
        ahead = self._sectors.ahead()
        missing[: ahead.start] = missing[ahead.stop :] = False
        for first, last in runs(self._state > SEEN):
            faded = np.flatnonzero(missing[first : last + 1])
            if first <= self._state.size // 2 <= last and faded.size >= FADED_SECTORS:
                blind = faded.size >= FADED_BLIND_SECTORS
                self._doubt(first + int(faded[0]), first + int(faded[-1]), blind=blind)

    def _unproven_borders(self, view: View) -> list[Border]:
        """Return the borders, beam by beam, of every silence that is unproven only because it was so at the start."""
        sectors, state, found = self._sectors, self._state, []
        for first, last in runs(state > SEEN):
            part = state[first : last + 1]
            if self._doubted[first : last + 1].any() or np.any(part == BLIND) or np.all(part < UNPROVEN):
                continue
            right, left = next_seen(self._seen, first, -1), next_seen(self._seen, last, 1)
            if right is not None:
                found.append(find_border(view, sectors, right, first, -1))
            if left is not None:
                found.append(find_border(view, sectors, last, left, 1))
        return [border for border in found if border is not None]

    def _beam_rad(self) -> float:
        return self._sectors.width_rad / self._sectors.beams

    def _goes_along(self, pose: OdometryState, state: Bytes, first: int, last: int) -> bool:
        """Return whether the places seen now beside this silence were within the same silence from the earlier pose."""
        if not np.all(state[first : last + 1] >= UNPROVEN):
            return False
        beside = [end for end in (next_seen(self._seen, first, -1), next_seen(self._seen, last, 1)) if end is not None]
        turned = cmath.rect(1.0, self._pose.yaw_rad - pose.yaw_rad)
        moved = cmath.rect(1.0, -pose.yaw_rad) * complex(self._pose.x_m - pose.x_m, self._pose.y_m - pose.y_m)
        for end in beside:
            off = complex(self._seen[end]) * turned + moved - self._lidar_m
            if abs(off) < EXPECTED_WITHIN_M / 2:
                sector = (cmath.phase(off) - self._sectors.first_rad) / self._sectors.width_rad
                if first + FIXED_SECTORS - 0.5 <= sector <= last - FIXED_SECTORS + 0.5:
                    return True
        return False

    def unknown(self) -> Unknown:
        """Return the borders of the unknown regions; called only while `suspicious`."""
        blind = (self._state == BLIND) & (self._stamp_s - self._blind_s > REMEMBERS_S)
        sight = SectorView(
            self._sectors, self._state, self._seen, blind, self._doubted, self._lidar_m, self._car.front_m
        )
        return find_unknown(sight, self._lost_here_m())


def crosses_within(at: complex, way: complex, bearing_rad: float, within_m: float) -> bool:
    """Return whether the line through `at` along `way` meets the beam of that bearing nearer than within_m."""
    beam = cmath.rect(1.0, bearing_rad)
    parallel = (way.conjugate() * beam).imag
    if not parallel:
        return False
    range_m = (way.conjugate() * at).imag / parallel
    return 0.0 < range_m < within_m
