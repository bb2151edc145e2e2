"""What the lidar is known to see ahead, and where it is blind: silence and returns from the car itself are not "free".

The beams before the shoulders are taken together in sectors of 2.5 degrees. A sector that returns nothing is *depth*
where that is explained: it has seen a moment ago and what it saw has gone elsewhere (every wall point of the last scan
is carried along by odometry), or the wall beside it leads out of range. It is *blind* where walls in range, seen in the
last scan, are missing over 15 degrees at once, or where the edge of the silence goes along with the car although walls
come out of it. Everything else is *unproven*, as all silence is at the start: the next echo proves it.

The answer is two sets of points that the car's outline must not reach: the frontier of what is known (a wall across the
way would show beside an unproven sector as far as that sector's neighbours see; nothing shows in a blind one), and,
softer, where a person could stand in an unproven sector. Thresholds: `docs/decisions/0015-visibility.md`.
"""

import cmath
import math

import numpy as np

from drivers.api import Scan
from drivers.twin import twin
from drivers.value import value
from runtime.control.perception.geometry import NOWHERE, Booleans, Bytes, Floats, Places
from runtime.control.perception.odometry import Pose
from runtime.control.perception.view import LEARNT_DIRT_NEARER_THAN_M, View
from runtime.control.safety.footprint import ENOUGH_POINTS
from runtime.control.vehicle import CarSettings

AHEAD_RAD = math.radians(60)
ASIDE_RAD = math.radians(105)
"""Sectors reach so far aside, because silence ahead is judged by what borders it."""
SECTOR_RAD = math.radians(2.5)
ON_LIDAR_RAD = math.radians(3)
"""No part of a car is before its shoulders: a row of returns from within the outline is something on the lidar."""
ON_LIDAR_SPARE_M = 0.03
"""A cover at the outline's edge returns from both sides of it."""
ON_LIDAR_GAP_BEAMS = 3
SEES_SHARE, FULL_SHARE, SILENT_SHARE = 0.3, 0.8, 0.15
SAME_THING_M, SAME_THING_SHARE = 0.15, 0.12
"""Neighbouring beams agree within this plus this share of the range: a wall met at a grazing angle, no wild beam."""
EXPECTED_WITHIN_M = 12.0
EXPECTED_SHARE = 0.9
"""Of the sensor's own range: nothing is expected beyond."""
BESIDE_SECTORS = 0.3
"""A sector is expected to see whose middle lies between two neighbours that have seen, or so far beside."""
MOST_BETWEEN_SECTORS = 2.1
"""Neighbours that come to lie farther apart than 1.5 sectors were the edges of a gap."""
LATEST_S = 0.15
"""After a longer silence nothing is expected: people have moved, and the odometry has drifted."""
DOUBTED_SECTORS, SILENCED_SECTORS, BLIND_SECTORS, COVERED_SECTORS = 3, 5, 6, 12
"""So much missing at once leaves unproven, or blind, everything between; the most is a cover. Real halls lose up to 25
degrees at once, for a scan or two: dark walls seen at a grazing angle, panes."""
REMEMBERS_S = 0.04
"""So long what was seen is still known where the lidar fell blind, unless it is covered."""
GRAZING_SECTORS = 1.5
"""The wall beside the silence is continued so far into it."""
FIXED_FOR_M = 0.25
FIXED_SECTORS = 2
HIDES_M, HIDES_SIDE_M, HIDES_PERSON_M = 0.1, 0.2, 0.3
"""What may hide in a gap: a leg in a blind one; half a person in a doubted one; a person in another unproven one."""
NARROW_SECTORS = 2
"""A narrower unproven gap hides no person within reach."""
CRAWL_MPS = 0.5
MOST_LOST = 256
EDGE_STEP_M = 0.05
EDGE_WITHIN_M = 2.0

SEEN, DEPTH, GONE, UNPROVEN, MISSING, BLIND = range(6)
"""What is known of a sector. GONE: depth since this scan; MISSING: unproven since this scan, for something expected."""


@value(eq=False)
class Sectors:
    """How the beams of one kind of lidar are put together: first beam, beams each, how many, bearing of the first."""

    first: int
    beams: int
    count: int
    first_rad: float
    width_rad: float

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


@value(eq=False)
class Unknown:
    """Where unknown begins, (k,) in base_link. hard: never to be reached. soft: to be approached at a crawl only.

    blind: whether the lidar is known to be blind there.
    """

    hard: Places
    soft: Places
    blind: bool


class Visibility:
    """Small state: what is known of each sector, and what the last scan saw.

    on_lidar: whether something is on the lidar. suspicious: whether anything ahead is not known to be seen.
    """

    def __init__(self, car: CarSettings) -> None:
        self._car = car
        self._kind: tuple[float, float, int] | None = None
        self._sectors = Sectors(0, 1, 0, 0.0, SECTOR_RAD)
        self._state: Bytes = np.empty(0, np.int8)
        self._blind_s: Floats = np.empty(0)
        self._doubted: Booleans = np.empty(0, np.bool_)
        self._seen: Places = NOWHERE
        self._held: Places = NOWHERE
        self._pose = Pose()
        self._stamp_s = -math.inf
        self._before: tuple[Pose, Bytes] | None = None
        self._lost_m: Places = NOWHERE
        self.on_lidar = False
        self.suspicious = False

    def look(self, view: View, pose: Pose) -> None:
        """Take in one scan; pose: base_link in the odometry frame."""
        scan, car = view.scan, self._car
        kind = scan.angle_min_rad, scan.angle_step_rad, view.ranges_m.size
        if kind != self._kind:
            self._begin(scan, kind)
        sectors, last = self._sectors, self._pose
        if not sectors.count:
            return
        fresh = 0.0 <= scan.stamp_s - self._stamp_s <= LATEST_S
        moved = cmath.rect(1.0, -last.yaw_rad) * complex(pose.x_m - last.x_m, pose.y_m - last.y_m)
        turned_rad = math.remainder(pose.yaw_rad - last.yaw_rad, math.tau)
        self._pose, self._stamp_s, held = pose, scan.stamp_s, self._held
        self._state, self._seen, self._held, row, suspects, gone = watched(
            view.ranges_m, view.x_m, view.y_m, view.no_echo, view.own, view.dirty, self._state, self._held,
            sectors.first, sectors.beams, sectors.first_rad, sectors.width_rad, view.lidar_x_m, car.front_m,
            car.half_width_m, min(EXPECTED_WITHIN_M, EXPECTED_SHARE * scan.range_max_m) if fresh else 0.0,
            moved.real, moved.imag, turned_rad,
        )  # fmt: skip
        self.on_lidar = row * abs(scan.angle_step_rad) >= ON_LIDAR_RAD
        if suspects or gone >= SILENCED_SECTORS:
            self._judge()
            self._remember((held - moved) * cmath.rect(1.0, -turned_rad))
            suspects = int(np.count_nonzero(self._state[sectors.ahead()] >= UNPROVEN))
        self.suspicious = suspects > 0
        if not suspects:
            self._lost_m = NOWHERE

    def _begin(self, scan: Scan, kind: tuple[float, float, int]) -> None:
        self._kind, self._sectors = kind, sectors_of(scan)
        self._state = np.full(self._sectors.count, UNPROVEN, np.int8)
        self._blind_s = np.full(self._sectors.count, -math.inf)
        self._doubted = np.zeros(self._sectors.count, np.bool_)
        self._seen = self._held = np.full(self._sectors.count, complex(math.nan, math.nan), np.complex128)
        self._stamp_s, self._before, self._lost_m = -math.inf, None, NOWHERE
        self.on_lidar = self.suspicious = False

    def _remember(self, before_m: Places) -> None:
        """Remember what was seen in the scan before, (n,), base_link, and is missing now: it is still there."""
        missing = before_m[self._known(before_m) >= MISSING]
        if missing.size:
            odom_m = missing * cmath.rect(1.0, self._pose.yaw_rad) + complex(self._pose.x_m, self._pose.y_m)
            self._lost_m = np.concatenate([self._lost_m, odom_m])[-MOST_LOST:]

    def _known(self, places_m: Places) -> Bytes:
        """Return what is known of the sectors in which places (k,), base_link, lie; SEEN beyond them."""
        off = places_m - self._car.lidar_x_m
        sector = np.rint((np.angle(off) - self._sectors.first_rad) / self._sectors.width_rad)
        inside = (sector >= 0) & (sector < self._state.size)  # NaN is not
        known = np.full(off.size, SEEN, np.int8)
        known[inside] = self._state[sector[inside].astype(np.intp)]
        return known

    def _judge(self) -> None:
        """Call silence blind where much is missing at once, and depth where its borders say so."""
        state = self._state
        self._doubted &= state > SEEN
        for first, last in runs(state > SEEN):
            part = state[first : last + 1]
            at_once = np.flatnonzero((part == MISSING) | (part == GONE))
            missing = int(np.count_nonzero(part == MISSING))
            if missing >= DOUBTED_SECTORS or at_once.size >= SILENCED_SECTORS:
                blind = at_once.size >= (BLIND_SECTORS if missing >= DOUBTED_SECTORS else BLIND_SECTORS + 1)
                self._doubt(first + int(at_once[0]), first + int(at_once[-1]), blind=blind)
            elif self._is_depth(first, last):
                part[((part == UNPROVEN) | (part == MISSING)) & ~self._doubted[first : last + 1]] = DEPTH

    def _doubt(self, first: int, last: int, *, blind: bool) -> None:
        """Much has fallen silent at once: only echoes prove these sectors again."""
        fresh = self._state[first : last + 1] != BLIND
        self._state[first : last + 1][fresh] = BLIND if blind else MISSING
        covered = last - first + 1 >= COVERED_SECTORS
        self._blind_s[first : last + 1][fresh] = -math.inf if covered else self._stamp_s
        self._doubted[first : last + 1] = True

    def _is_depth(self, first: int, last: int) -> bool:
        """Whether nothing at the borders of a silent run, right and left, speaks for a cover, and one for depth."""
        right, left = self._leads_out(first, -1), self._leads_out(last, 1)
        return (right or left) is True and right is not False and left is not False

    def _leads_out(self, end: int, step: int) -> bool | None:
        """Whether the silence that ends at this sector is depth; None where nothing borders it.

        It is where the sector was explained, or where the line of the wall outside leads out of range.
        """
        if self._state[end] in (DEPTH, GONE):
            return True
        beside = self._next_seen(end, step)
        if beside is None:
            return None
        outer = self._next_seen(beside, step)
        if outer is None:
            return False
        at, way = self._seen[beside] - self._car.lidar_x_m, self._seen[beside] - self._seen[outer]
        inward_rad = self._bearing_rad(beside) - step * GRAZING_SECTORS * self._sectors.width_rad
        return not crosses_within(complex(at), complex(way), inward_rad, EXPECTED_WITHIN_M)

    def _next_seen(self, sector: int, step: int) -> int | None:
        """Return the next sector, to the left or right of one, that sees something in this scan."""
        sector += step
        while 0 <= sector < self._seen.size:
            if self._seen[sector] == self._seen[sector]:  # no NaN
                return sector
            sector += step
        return None

    def _bearing_rad(self, sector: int) -> float:
        return self._sectors.first_rad + sector * self._sectors.width_rad

    def learn(self) -> None:
        """Compare with what was silent when the car was elsewhere: walls that come out of a silence that goes along."""
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

    def _goes_along(self, pose: Pose, state: Bytes, first: int, last: int) -> bool:
        """Whether what is seen now beside this silence was, from there, within the same silence."""
        if not np.all(state[first : last + 1] >= UNPROVEN):
            return False
        beside = [end for end in (self._next_seen(first, -1), self._next_seen(last, 1)) if end is not None]
        turned = cmath.rect(1.0, self._pose.yaw_rad - pose.yaw_rad)
        moved = cmath.rect(1.0, -pose.yaw_rad) * complex(self._pose.x_m - pose.x_m, self._pose.y_m - pose.y_m)
        for end in beside:
            off = complex(self._seen[end]) * turned + moved - self._car.lidar_x_m
            if abs(off) < EXPECTED_WITHIN_M / 2:
                sector = (cmath.phase(off) - self._sectors.first_rad) / self._sectors.width_rad
                if first + FIXED_SECTORS - 0.5 <= sector <= last - FIXED_SECTORS + 0.5:
                    return True
        return False

    def unknown(self) -> Unknown:
        """Return where unknown begins; asked only while something is suspicious."""
        state, ahead = self._state, self._sectors.ahead()
        pose = self._pose
        lost_m = (self._lost_m - complex(pose.x_m, pose.y_m)) * cmath.rect(1.0, -pose.yaw_rad)
        lost = self._known(lost_m) >= UNPROVEN
        self._lost_m = self._lost_m[lost]
        hard: list[Places] = [np.repeat(lost_m[lost], ENOUGH_POINTS)]
        soft: list[Places] = []
        blind = (state == BLIND) & (self._stamp_s - self._blind_s > REMEMBERS_S)
        for first, last in runs(blind):
            hard.append(self._hidden(first, last, HIDES_M))
        for first, last in runs(state > SEEN):
            for begin, end in runs((state[first : last + 1] == UNPROVEN) | (state[first : last + 1] == MISSING)):
                if first + end >= ahead.start and first + begin < ahead.stop and end - begin >= NARROW_SECTORS - 1:
                    hard.append(self._edge(first, last))
                    doubted = self._doubted[first + begin : first + end + 1].any()
                    width_m = HIDES_SIDE_M if doubted else HIDES_PERSON_M
                    soft.append(self._hidden(first + begin, first + end, width_m))
        return Unknown(_joined(hard), _joined(soft), bool(blind[ahead].any()))

    def _hidden(self, first: int, last: int, width_m: float) -> Places:
        """Return the arc at which something of this width fits into a gap, (k,)."""
        sectors = self._sectors
        half_rad = min((last - first + 1) * sectors.width_rad / 2, math.pi / 2 - 0.01)
        away_m = width_m / 2 / math.tan(half_rad)
        steps = max(3, math.ceil(2 * half_rad * away_m / EDGE_STEP_M))
        low_rad = max(self._bearing_rad(first) - sectors.width_rad / 2, -AHEAD_RAD)
        high_rad = min(self._bearing_rad(last) + sectors.width_rad / 2, AHEAD_RAD)
        if low_rad >= high_rad:
            return NOWHERE
        bearing_rad = np.linspace(low_rad, high_rad, steps)
        arc = np.empty(steps, np.complex128)
        arc.real, arc.imag = self._car.lidar_x_m + away_m * np.cos(bearing_rad), away_m * np.sin(bearing_rad)
        return arc

    def _edge(self, first: int, last: int) -> Places:
        """Return the line between what is seen on both sides of a silent run, (k,).

        With nothing on one side it is the line across the way as far ahead as the other side is seen; with nothing on
        either it is the bumper.
        """
        sides = [self._next_seen(first, -1), self._next_seen(last, 1)]
        seen = [complex(self._seen[side]) for side in sides if side is not None]
        ahead_m = seen[0].real if seen else self._car.front_m
        right = seen[0] if sides[0] is not None else complex(ahead_m, -EDGE_WITHIN_M)
        left = seen[-1] if sides[1] is not None else complex(ahead_m, EDGE_WITHIN_M)
        line = np.empty(max(3, math.ceil(abs(left - right) / EDGE_STEP_M)), np.complex128)
        line[:] = right + (left - right) * np.linspace(0.0, 1.0, line.size)
        return line


def _joined(places: list[Places]) -> Places:
    return np.concatenate(places) if places else NOWHERE


def crosses_within(at: complex, way: complex, bearing_rad: float, within_m: float) -> bool:
    """Whether the line through a place, in this direction, meets the beam of that bearing nearer than within_m."""
    beam = cmath.rect(1.0, bearing_rad)
    parallel = (way.conjugate() * beam).imag
    if not parallel:
        return False
    range_m = (way.conjugate() * at).imag / parallel
    return 0.0 < range_m < within_m


def runs(which: Booleans) -> list[tuple[int, int]]:
    """Return (first, last) of every row of true ones of (n,)."""
    edges = np.flatnonzero(np.diff(which, prepend=False, append=False)).tolist()
    return [(first, end - 1) for first, end in zip(edges[::2], edges[1::2], strict=True)]


@twin
def watched(  # flat arguments, as its twin in C wants them
    ranges_m: Floats,
    x_m: Floats,
    y_m: Floats,
    no_echo: Booleans,
    own: Booleans,
    dirty: Booleans | None,
    state: Bytes,
    held: Places,
    first: int,
    beams: int,
    first_rad: float,
    width_rad: float,
    lidar_x_m: float,
    front_m: float,
    half_width_m: float,
    within_m: float,
    moved_x_m: float,
    moved_y_m: float,
    turned_rad: float,
) -> tuple[Bytes, Places, Places, int, int, int]:
    """Return what is known of each sector after one more scan.

    state, (n,); a place that each sector sees, and only of the full ones, (n,), base_link, NaN for none; the longest
    row of beams that return from on the lidar; how many sectors ahead are unproven or blind; how many
    have fallen silent since the scan before.

    ranges_m to dirty: of a View, (beams,). state, held: what this has returned for the scan before, which was taken
    at the pose from which the car has moved by moved_x_m, moved_y_m and turned by turned_rad since. first, beams,
    first_rad, width_rad: of Sectors. within_m: how far anything is expected to be seen; 0: nothing is.
    """
    count = state.size
    part = slice(first, first + count * beams)
    range_m, echo = ranges_m[part], ~(no_echo[part] | own[part])
    if dirty is not None:
        echo &= ~(dirty[part] & (range_m < LEARNT_DIRT_NEARER_THAN_M))
    agree = echo[1:] & echo[:-1]
    agree &= np.abs(range_m[1:] - range_m[:-1]) <= SAME_THING_M + SAME_THING_SHARE * range_m[:-1]
    linked = np.zeros(range_m.size, np.bool_)
    linked[1:] |= agree
    linked[:-1] |= agree
    links = linked.reshape(count, beams)
    seeing = np.count_nonzero(links, axis=1)
    off_middle = np.abs(np.arange(beams) * 2 - (beams - 1))
    pick = np.where(links, off_middle, 2 * beams).argmin(axis=1) + np.arange(count) * beams + first
    sees = seeing >= max(2.0, SEES_SHARE * beams)
    nothing = complex(math.nan, math.nan)
    seen = np.where(sees, x_m[pick] + 1j * y_m[pick], nothing)
    new_held = np.where(sees & (seeing >= FULL_SHARE * beams), seen, nothing)
    off = (held - complex(moved_x_m, moved_y_m)) * cmath.rect(1.0, -turned_rad) - lidar_x_m
    place = (np.angle(off) - first_rad) / width_rad
    place[~(np.abs(off) < within_m)] = math.nan
    right, left = place[:-1] - BESIDE_SECTORS, place[1:] + BESIDE_SECTORS
    between = (left > right) & (left - right <= MOST_BETWEEN_SECTORS)
    right, left = np.ceil(right[between]), left[between]
    expected = np.zeros(count, np.bool_)
    for step in range(3):
        there = right[(right + step <= left) & (right + step >= 0) & (right + step < count)] + step
        expected[there.astype(np.intp)] = True
    silent = ~sees & (seeing <= SILENT_SHARE * beams)
    new_state = np.where((state == MISSING) | (state == GONE), state - 1, state).astype(np.int8)
    new_state[silent & (state == SEEN)] = GONE
    new_state[silent & expected & (state != BLIND)] = MISSING
    new_state[sees] = SEEN
    bearing_rad = first_rad + width_rad * np.arange(count)
    suspects = np.count_nonzero((new_state >= UNPROVEN) & (np.abs(bearing_rad) <= AHEAD_RAD))
    gone = np.count_nonzero((new_state == GONE) | (new_state == MISSING))
    near = np.zeros(ranges_m.size, np.bool_)
    near[part] = x_m[part] <= front_m + ON_LIDAR_SPARE_M
    near[part] &= np.abs(y_m[part]) <= half_width_m + ON_LIDAR_SPARE_M
    near[part] &= np.repeat(np.abs(bearing_rad) <= AHEAD_RAD, beams)
    return new_state, seen, new_held, row_on_lidar(near, own), int(suspects), int(gone)


def row_on_lidar(near: Booleans, own: Booleans) -> int:
    """Return the length of the longest row of near beams of which a third are within the outline; both (beams,)."""
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
