"""Track of one small object in the odometry frame: its place and velocity, and the evidence that it moves.

The filter fits a line to the first places (least squares), then is an alpha-beta filter (Kalata 1984): the speed of a
new object is known to 0.1 m/s after a quarter of a second, and that of an old one follows a person that starts to walk.

An object moves if it is faster than the error of the odometry, with both of its edges: of a wall's end that comes into
view only one edge moves. And the beams must agree: its earlier place is free now, and at its present place nothing was
seen before (Wang, Thorpe & Thrun 2003), or it was hidden. Two table legs seen alternately are not a moving object.
"""

import cmath
from dataclasses import dataclass, replace

import numpy as np

from wallride.drivers.value import value
from wallride.runtime.control.perception.geometry import Floats
from wallride.runtime.control.perception.view import View

POSITION_GAIN, SPEED_GAIN = 0.4, 0.08
LATELY_S = 0.6
"""Minimum age of the place from which motion is measured; the maximum is twice that: slow drift is not walking."""
MAX_SPEED_MPS = 4.0
"""Maximum speed of a track: runners reach 3 m/s; faster tracks are false associations."""
LEG_WIDTH_M, NARROW_WIDTH_M = 0.08, 0.7
"""Width of what is soon seen to move: of two legs of a table one may be taken for the other, and of a wall that comes
into view both ends seem to move."""
TURNED_M, TURNED_MPS = 0.03, 0.25
"""Minimum way and speed at which an object is on its way back."""
KEPT_SHARE = 0.5
"""Share of the speed bounds that keeps a track moving that has been seen to move."""
SAME_PLACE_M = 0.1
"""Maximum distance of a return from a place that counts as occupying it."""
MAX_OF_THREE = 2
LEFT_SCANS = 8
"""Minimum number of scans of an object whose new place was hidden before."""

Edges = tuple[complex, complex]
"""Right and left edge of an object."""


@value(eq=False)
class ScanLook:
    """One scan and its pose: position and heading (unit vector) of base_link in the odometry frame."""

    view: View
    at_m: complex
    turned: complex

    def ranges_m(self, place_m: complex) -> tuple[float, Floats]:
        """Return the distance of a place (odom) from the lidar, and the ranges of three beams toward it, if any."""
        view = self.view
        off = (place_m - self.at_m) * self.turned.conjugate() - view.lidar_m
        beam = round((cmath.phase(off) - view.scan.angle_min_rad) / view.scan.angle_step_rad)
        return abs(off), view.ranges_m[max(0, beam - 1) : max(0, beam + 2)]

    def is_in_view(self, place_m: complex) -> bool:
        """Return whether the lidar looks in that direction."""
        return bool(self.ranges_m(place_m)[1].size)

    def is_occupied(self, place_m: complex) -> bool:
        """Return whether one of three beams returns from that place: of a table leg it may be the only one."""
        away_m, ranges_m = self.ranges_m(place_m)
        return bool(np.count_nonzero(np.abs(ranges_m - away_m) < SAME_PLACE_M))

    def is_free(self, place_m: complex) -> bool:
        """Return whether most of three beams pass beyond that place, and none ends there; without an echo it passes."""
        away_m, ranges_m = self.ranges_m(place_m)
        beyond = int(np.count_nonzero(ranges_m < away_m + SAME_PLACE_M)) < MAX_OF_THREE
        return beyond and not np.count_nonzero(np.abs(ranges_m - away_m) < SAME_PLACE_M)


@value()
class MotionBounds:
    """What a track must exceed to count as moving.

    toward_mps: speed toward the car. aside_mps: across its heading, plus turning_per_s times the distance. shown: way
    and number of scans that show a motion. soon: the same for what is narrow and crosses. width_m: greatest width.
    """

    toward_mps: float
    aside_mps: float
    turning_per_s: float
    shown: tuple[float, int]
    soon: tuple[float, int]
    width_m: float


@dataclass(frozen=True, slots=True)
class EarlierPlace:
    """Earlier edges of an object (odom), their time, and the scan that showed them."""

    edges_m: Edges
    stamp_s: float
    look: ScanLook

    def carried(self, by_m: complex) -> "EarlierPlace":
        """Return the same, shifted by a motion that the odometry has missed."""
        edges_m = self.edges_m[0] + by_m, self.edges_m[1] + by_m
        return EarlierPlace(edges_m, self.stamp_s, replace(self.look, at_m=self.look.at_m + by_m))


@dataclass(slots=True)
class ObstacleTrack:
    """An object: middle of its visible side, velocity, edges, number of scans, last time (odom).

    edges_m are smoothed, newest_m those of the last scan. before, lately: earlier places, before is the older one.
    moves: whether it has been seen to move.
    """

    place_m: complex
    velocity_mps: complex
    edges_m: Edges
    newest_m: Edges
    before: EarlierPlace
    lately: EarlierPlace
    scans: int
    seen_s: float
    moves: bool = False

    @classmethod
    def begin(cls, place_m: complex, edges_m: Edges, stamp_s: float, look: ScanLook) -> "ObstacleTrack":
        """Return the track of an object that is seen for the first time."""
        here = EarlierPlace(edges_m, stamp_s, look)
        return cls(place_m, 0j, edges_m, edges_m, here, here, 1, stamp_s)

    def carry(self, place_m: complex, edges_m: Edges, stamp_s: float) -> None:
        """Move the track to the place where the object is seen, without a motion of its own."""
        by_m = place_m - self.place_m
        self.place_m, self.newest_m, self.seen_s = place_m, edges_m, stamp_s
        self.edges_m = self.edges_m[0] + by_m, self.edges_m[1] + by_m
        self.before, self.lately = self.before.carried(by_m), self.lately.carried(by_m)

    def add(self, place_m: complex, edges_m: Edges, stamp_s: float, look: ScanLook) -> None:
        """Add a place at which the object is seen."""
        elapsed_s = max(1e-3, stamp_s - self.seen_s)
        self.scans += 1
        self.place_m += self.velocity_mps * elapsed_s
        off = place_m - self.place_m
        position_gain, speed_gain = _gains(self.scans)
        self.place_m += position_gain * off
        self.velocity_mps += speed_gain / elapsed_s * off
        right_m, left_m = self.edges_m
        self.edges_m = right_m + POSITION_GAIN * (edges_m[0] - right_m), left_m + POSITION_GAIN * (edges_m[1] - left_m)
        self.newest_m, self.seen_s = edges_m, stamp_s
        if self._turns_back():
            self.before = self.lately = EarlierPlace(self.edges_m, stamp_s, look)
        elif stamp_s - self.lately.stamp_s > LATELY_S:
            self.before, self.lately = self.lately, EarlierPlace(self.edges_m, stamp_s, look)

    def _turns_back(self) -> bool:
        """Return whether the object comes back to where it was before: the way out must not count against it."""
        moved_m = self.edges_m[0] + self.edges_m[1] - self.before.edges_m[0] - self.before.edges_m[1]
        speed_mps = abs(self.velocity_mps)
        return (moved_m * self.velocity_mps.conjugate()).real < -2.0 * TURNED_M * speed_mps and speed_mps > TURNED_MPS

    def judge(self, look: ScanLook, range_m: float, bounds: MotionBounds) -> None:
        """Find out whether the object crosses before the car or comes nearer; once it does, KEPT_SHARE is enough.

        look: this scan. range_m: distance of the object from the lidar.
        """
        if abs(self.velocity_mps) > MAX_SPEED_MPS:
            self.moves = False
            return
        aside_mps = bounds.aside_mps + bounds.turning_per_s * range_m
        aside, toward = look.turned * 1j, look.at_m - self.place_m
        toward /= abs(toward) or 1.0
        if self._along_mps(aside) < 0.0:
            aside = -aside
        aside_share, toward_share = self._along_mps(aside) / aside_mps, self._along_mps(toward) / bounds.toward_mps
        if self.moves:
            self.moves = max(aside_share, toward_share) > KEPT_SHARE
            return
        width_m = abs(self.newest_m[1] - self.newest_m[0])
        if width_m > bounds.width_m:
            return
        crossed_m, scans = bounds.soon if LEG_WIDTH_M < width_m <= NARROW_WIDTH_M else bounds.shown
        crosses = aside_share > 1.0 and self.scans >= scans and self._has_moved(aside, look, crossed_m)
        came_m, scans = bounds.shown
        comes = toward_share > 1.0 and self.scans >= scans and self._has_moved(toward, look, came_m)
        self.moves = crosses or comes

    def goes(self, look: ScanLook, speed_mps: float, moved_m: float) -> bool:
        """Return whether the object moves in any direction, faster and farther than this; for a car that stands.

        Where it goes away, its new place was hidden by itself before; the old one has to be left.
        """
        if not speed_mps < abs(self.velocity_mps) < MAX_SPEED_MPS:
            return False
        along = (self.velocity_mps / abs(self.velocity_mps)).conjugate()
        edges = zip(self.edges_m, self.before.edges_m, strict=True)
        if not all(((now - then) * along).real > moved_m for now, then in edges):
            return False
        return not look.is_occupied(min(self.before.edges_m, key=lambda edge: (edge * along).real))

    def _along_mps(self, toward: complex) -> float:
        """Return the speed in a direction, a unit vector (odom)."""
        return (self.velocity_mps * toward.conjugate()).real

    def _has_moved(self, toward: complex, look: ScanLook, moved_m: float) -> bool:
        """Return whether both edges have moved that far in that direction, from a place now free to one free before.

        Or hidden before, as from round a bend: then all of the old place has to be free now.
        """
        along = toward.conjugate()  # the real part of a product with it is the part of a vector in this direction
        edges = zip(self.edges_m, self.before.edges_m, strict=True)
        if not all(((now - then) * along).real > moved_m for now, then in edges):
            return False
        came_from = min(self.before.edges_m, key=lambda edge: (edge * along).real)
        came_to = max(self.newest_m, key=lambda edge: (edge * along).real)
        if self.before.look.is_free(came_to):
            return not look.is_occupied(came_from)
        was_hidden = self.scans >= LEFT_SCANS and not self.before.look.is_occupied(came_to)
        return was_hidden and all(look.is_free(edge_m) for edge_m in self.before.edges_m)


def _gains(scans: int) -> tuple[float, float]:
    """Return the gains of place and speed at the n-th scan: those of a line fitted to all, until they are smaller.

    Source: Bar-Shalom, Li & Kirubarajan, Estimation with Applications to Tracking and Navigation, section 6.5.
    """
    both = scans * (scans + 1)
    return max(2 * (2 * scans - 1) / both, POSITION_GAIN), max(6 / both, SPEED_GAIN)
