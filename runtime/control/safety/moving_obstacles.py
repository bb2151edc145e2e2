"""Moving obstacles: small clusters are tracked in the odometry frame, and their predicted places count as occupied.

A person crossing at 1.5 m/s is not in the path until it is too late, and one approaching the car occupies the distance
that it needs to stop. The track is an alpha-beta filter (Kalata 1984) on the middle of the object's visible side; an
object counts as moving when it has moved faster than the error of the odometry, for long enough, with both of its
edges: of a wall's end that comes into view only one edge moves. And the beams must agree: its earlier place is free
now, and at its present place nothing was seen before (as in detecting dynamic objects by free space: Wang, Thorpe &
Thrun 2003). Two table legs seen alternately are not a moving object. The object's points, extrapolated along its motion
for the next moments, are added to the points that the safety sweeps.
"""

import cmath
from dataclasses import dataclass, replace

import numpy as np

from drivers.accelerated import accelerated
from drivers.value import value
from runtime.control.perception.geometry import NOWHERE, Booleans, Floats, Places, places_m
from runtime.control.perception.odometry import OdometryState
from runtime.control.perception.view import View

WITHIN_M = 6.0
GAP_BEAMS = 3
JUMP_M = 0.2
BACKGROUND_BEAMS = 40
MIN_BEAMS = 4
MAX_WIDTH_M = 0.7
MATCH_M, MAX_MOVE_M = 0.15, 0.35
"""Association gate: maximum distance from the predicted place, in addition to the motion of a runner between the scans;
and its absolute maximum."""
POSITION_GAIN = 0.4
SPEED_GAIN = 0.08
SEEN_SCANS = 8
MOVED_M = 0.2
LATELY_S = 0.6
"""Minimum age of the place from which motion is measured; the maximum is twice that: slow drift is not walking."""
MIN_SPEED_MPS = 0.4
MIN_SPEED_SHARE = 0.15
"""Share of the car's own speed that is added: a trimmed or drifting car turns by more than its steering indicates."""
TURNING_SHARE = 0.3
"""Share of the car's own yaw rate, now and half a second ago, times the distance, that is added: the servo lags behind
the odometry."""
TURNING_FADES = 0.95
MAX_SPEED_MPS = 4.0
"""Maximum speed of a track: runners reach 3 m/s; faster tracks are false associations."""
SAME_PLACE_M = 0.1
"""Maximum distance of a return from a place that counts as occupying it."""
MAX_OF_THREE = 2
AHEAD_S = (0.15, 0.3, 0.45, 0.6, 0.75, 0.9)
FORGOTTEN_S = 0.15


@value(eq=False)
class _Look:
    """One scan and its pose: position and heading of base_link in the odometry frame."""

    view: View
    at_m: complex
    turned: complex

    def ranges_m(self, place_m: complex) -> tuple[float, Floats]:
        """Return the distance of a place (odom) from the lidar, and the ranges of three beams toward it, if any."""
        view = self.view
        off = (place_m - self.at_m) * self.turned.conjugate() - view.lidar_x_m
        beam = round((cmath.phase(off) - view.scan.angle_min_rad) / view.scan.angle_step_rad)
        return abs(off), view.ranges_m[max(0, beam - 1) : max(0, beam + 2)]


@dataclass(frozen=True, slots=True)
class _Before:
    """Earlier places of the right and the left edge of an object (odom), their time, and the scan that showed them."""

    edges_m: tuple[complex, complex]
    stamp_s: float
    look: _Look

    def carried(self, by_m: complex) -> "_Before":
        """Return the same, shifted by a motion that the odometry has missed."""
        edges_m = self.edges_m[0] + by_m, self.edges_m[1] + by_m
        return _Before(edges_m, self.stamp_s, replace(self.look, at_m=self.look.at_m + by_m))


@dataclass(slots=True)
class _Track:
    """Track of an object in the odometry frame: middle, velocity, right and left edge, number of scans, last time.

    edges_m are smoothed, newest_m those of the last scan. before, lately: earlier places, before is the older one.
    """

    place_m: complex
    way_mps: complex
    edges_m: tuple[complex, complex]
    newest_m: tuple[complex, complex]
    before: _Before
    lately: _Before
    scans: int
    seen_s: float

    def carry(self, by_m: complex, stamp_s: float) -> None:
        """Move the track to the place where it is seen, without a motion of its own."""
        self.place_m += by_m
        self.edges_m = self.edges_m[0] + by_m, self.edges_m[1] + by_m
        self.before, self.lately = self.before.carried(by_m), self.lately.carried(by_m)
        self.seen_s = stamp_s

    def remember(self, stamp_s: float, look: _Look) -> None:
        """Store the present place every LATELY_S."""
        if stamp_s - self.lately.stamp_s > LATELY_S:
            self.before, self.lately = self.lately, _Before(self.edges_m, stamp_s, look)


class MovingObstacles:
    """Holds the tracks of moving obstacles. Call `update` once per scan."""

    def __init__(self) -> None:
        self._tracks: list[_Track] = []
        self._turning_radps = 0.0

    def update(self, view: View, pose: OdometryState, stamp_s: float, *, sliding: bool = False) -> Places:
        """Return the predicted places, (k,) in base_link, of pedestrians in the next 0.9 s; k = 0 without pedestrians.

        sliding: the wheels are locked, so that the odometry stands still while everything comes nearer: velocities are
        neither updated nor forgotten.
        """
        self._turning_radps = max(abs(pose.yaw_rate_radps), TURNING_FADES * self._turning_radps)
        things = find_small_clusters(view.solid, view.ranges_m, abs(view.scan.angle_step_rad))
        if not things and not self._tracks:
            return NOWHERE  # the usual case
        turned, at_m = cmath.rect(1.0, pose.yaw_rad), complex(pose.x_m, pose.y_m)
        look = _Look(view, at_m, turned)
        fresh: list[_Track] = []
        strips: list[Places] = []
        slowest_mps = MIN_SPEED_MPS + MIN_SPEED_SHARE * abs(pose.speed_mps)
        slowest_per_m = TURNING_SHARE * self._turning_radps
        for first, last in things:
            beams = view.solid[first : last + 1].nonzero()[0] + first
            points = places_m(view.x_m, view.y_m, beams)
            track = self._follow(points * turned + at_m, stamp_s, look, sliding=sliding)
            fresh.append(track)
            if track.scans < SEEN_SCANS:
                continue
            across_mps = slowest_mps + slowest_per_m * float(view.ranges_m[first])
            across = _goes(track, turned * 1j, look, across_mps, either=True)
            if across or _goes(track, at_m - track.place_m, look, slowest_mps):
                way_mps = track.way_mps * turned.conjugate()
                strips += [points + way_mps * ahead_s for ahead_s in AHEAD_S]
        self._tracks = fresh + [track for track in self._tracks if stamp_s - track.seen_s <= FORGOTTEN_S]
        return np.concatenate(strips) if strips else NOWHERE

    def _follow(self, points_m: Places, stamp_s: float, look: _Look, *, sliding: bool) -> _Track:
        """Return the track associated with these points (k,), odom, removed from the list, or a new one."""
        place_m = complex(points_m.sum()) / points_m.size
        edges_m = complex(points_m[0]), complex(points_m[-1])
        nearest, nearest_m = None, MAX_MOVE_M
        for track in self._tracks:
            elapsed_s = stamp_s - track.seen_s
            if elapsed_s > FORGOTTEN_S:  # a gap in the scans: tracks cannot be associated
                continue
            off_m = abs(track.place_m + track.way_mps * elapsed_s - place_m)
            if off_m < min(nearest_m, MATCH_M + MAX_SPEED_MPS * elapsed_s):
                nearest, nearest_m = track, off_m
        if nearest is None:
            here = _Before(edges_m, stamp_s, look)
            return _Track(place_m, 0j, edges_m, edges_m, here, here, 1, stamp_s)
        self._tracks.remove(nearest)
        nearest.newest_m = edges_m
        if sliding:
            nearest.carry(place_m - nearest.place_m, stamp_s)
            return nearest
        elapsed_s = max(1e-3, stamp_s - nearest.seen_s)
        nearest.place_m += nearest.way_mps * elapsed_s
        off = place_m - nearest.place_m
        nearest.place_m += POSITION_GAIN * off
        nearest.way_mps += SPEED_GAIN / elapsed_s * off
        right_m, left_m = nearest.edges_m
        nearest.edges_m = (
            right_m + POSITION_GAIN * (edges_m[0] - right_m),
            left_m + POSITION_GAIN * (edges_m[1] - left_m),
        )
        nearest.scans += 1
        nearest.seen_s = stamp_s
        nearest.remember(stamp_s, look)
        return nearest


@accelerated
def find_small_clusters(solid: Booleans, ranges_m: Floats, step_rad: float) -> list[tuple[int, int]]:
    """Return (first, last) beam of every near object at most 0.7 m wide that stands out from its surroundings.

    solid, ranges_m: (beams,) of a View. step_rad: between two beams, positive.
    """
    index = (solid & (ranges_m < WITHIN_M)).nonzero()[0]
    if index.size < MIN_BEAMS:
        return []
    near_m = ranges_m.take(index)
    off_m = near_m[1:] - near_m[:-1]
    cut = np.abs(off_m, out=off_m) > JUMP_M
    cut |= index[1:] - index[:-1] > GAP_BEAMS
    ends = [*cut.nonzero()[0].tolist(), index.size - 1]
    things, start = [], 0
    for end in ends:
        if end - start >= MIN_BEAMS - 1:
            right, left = int(index[start]), int(index[end])
            if (left - right) * step_rad * near_m[start] <= MAX_WIDTH_M and _stands_out(solid, ranges_m, right, left):
                things.append((right, left))
        start = end + 1
    return things


def _stands_out(solid: Booleans, ranges_m: Floats, right: int, left: int) -> bool:
    """Return whether the things at both sides are farther away, and there are both sides."""
    to_the_right = range(right - 1, right - 1 - BACKGROUND_BEAMS, -1)
    to_the_left = range(left + 1, left + 1 + BACKGROUND_BEAMS)
    return _behind(solid, ranges_m, to_the_right, ranges_m[right]) and _behind(
        solid, ranges_m, to_the_left, ranges_m[left]
    )


def _behind(solid: Booleans, ranges_m: Floats, beams: range, range_m: float) -> bool:
    """Return whether the first solid one of the next beams is clearly farther away.

    Dirt and outliers are skipped: they cut walls into pieces whose edges move with the car. Where no beam is solid,
    silence counts as far.
    """
    for beam in beams:
        if not 0 <= beam < solid.size:
            return False
        if solid[beam]:
            return bool(ranges_m[beam] > range_m + JUMP_M)
    return True


def _goes(track: _Track, toward: complex, look: _Look, slowest_mps: float, *, either: bool = False) -> bool:
    """Return whether both edges of the object move in that direction (odom; either: or its opposite) faster than that.

    look: of this scan; it and the earlier one must show that the object has left one place for another.
    """
    size = abs(toward)
    if not size or abs(track.way_mps) > MAX_SPEED_MPS:
        return False
    along = toward.conjugate() / size  # the real part of a product with it is the part of a vector in this direction
    along_mps = (track.way_mps * along).real
    if either and along_mps < 0:
        along, along_mps = -along, -along_mps
    edges = zip(track.edges_m, track.before.edges_m, strict=True)
    if along_mps <= slowest_mps or not all(((now - then) * along).real > MOVED_M for now, then in edges):
        return False
    came_from = min(track.before.edges_m, key=lambda edge: (edge * along).real)
    came_to = max(track.newest_m, key=lambda edge: (edge * along).real)
    return not _stands(look, came_from) and _is_free(track.before.look, came_to)


def _stands(look: _Look, place_m: complex) -> bool:
    """Return whether most of three beams return from that place."""
    away_m, ranges_m = look.ranges_m(place_m)
    return int(np.count_nonzero(np.abs(ranges_m - away_m) < SAME_PLACE_M)) >= MAX_OF_THREE


def _is_free(look: _Look, place_m: complex) -> bool:
    """Return whether most of three beams pass beyond that place; a beam without an echo does."""
    away_m, ranges_m = look.ranges_m(place_m)
    return int(np.count_nonzero(ranges_m < away_m + SAME_PLACE_M)) < MAX_OF_THREE
