"""Classification of returns behind the car's shoulders: parts of the car itself, or the world.

Posts, mounts, cables and wheels return at 0.2 to 0.7 m behind the shoulders of most cars, outside the outline. What is
so near there is doubted until something tells it from them, and not followed or stopped for meanwhile:

* it lies on the line of the wall that is seen before the shoulder; or
* its place was seen before the shoulder, or known as the world's, and has come here by odometry; or
* it moves against the car: its place, and not its bearing and range, is that of a scan some centimetres back; or
* the beams there have seen through, for a second: no part is in their way, and what comes there has come by itself.

The other way round, what keeps its bearing and range, but not its place, is a part of the car; 0.3 m of way tell it.
Only a car that backs out uses doubted returns: it has no other information about the area behind it.

All this is computed when a scan has been answered. What the next scan needs of it is one number per beam: what reads
less than that is ignored.
"""

import cmath
import math
from collections import deque
from dataclasses import dataclass, field

import numpy as np

from wallride.drivers.api import Scan
from wallride.drivers.value import value
from wallride.runtime.control.perception.geometry import NOWHERE, Booleans, Floats, Places, places_m
from wallride.runtime.control.perception.odometry import OdometryState
from wallride.runtime.control.perception.rear_places import (
    PLACES_NEARER_THAN_M,
    SAME_PLACE_BEAMS,
    Beams,
    around,
    expected_m,
    on_the_line,
    polar,
    seen_again,
)
from wallride.runtime.control.perception.view import DOUBTED_BEYOND_RAD, DOUBTED_NEARER_THAN_M, View, supported

ROUNDING_M = 1e-9
KEY_EVERY_M, KEY_EVERY_RAD = 0.04, 0.1
KEYS = 12
WEIGHS_EVERY_M = 0.02
MAX_STEP_S = 0.1
SHORT_M, LONG_M, MAX_LENGTH_M = 0.06, 0.2, 0.45
"""A return is compared with a scan SHORT_M back, while which a leg stays in view, and with one LONG_M back, on which no
part of a car is so long and even that its own beginning hides its end."""
AROUND_BEAMS = 8
MIN_FIXED, MIN_MOVED = 3, 4
CLEARLY = 3
"""Minimum ratio of the surrounding beams for the one hypothesis to those for the other."""
PART_MEMORY_M = 0.05
SEEN_THROUGH_MEMORY_M = 0.8
PART_ABOVE, PART_BELOW = 0.6, 0.3
EXPECTED_WITHIN_M = 0.1
WORLD_VIEWS = 24
LINE_FROM_RAD = math.radians(50)
BESIDE_FROM_RAD = math.radians(20)
"""Bearing from which places are stored that will be behind the shoulder within MAX_LENGTH_M."""
PART_RIM_BEAMS = 4
PART_RIM_M = 0.15
MIN_THROUGH_SCANS = 40
"""Number of scans in a row that show that no part is before a beam: a loose cable swings to and fro faster."""


@dataclass(frozen=True, slots=True)
class KnownParts:
    """Own parts of one car, for one kind of lidar: first bearing and step [rad], beams; (beam, range in m) of each."""

    angle_min_rad: float
    angle_step_rad: float
    beams: int
    ranges_m: tuple[tuple[int, float], ...]


@value(eq=False)
class _NearScan:
    """An earlier scan: where the lidar was and looked, and the places of near returns beside and behind it; odom.

    polar: of the places, in the lidar frame of then.
    """

    at_m: complex
    turned: complex
    places: Places
    polar: tuple[Floats, Floats]


@dataclass(frozen=True, slots=True, eq=False)
class _Rear:
    """The beams behind the shoulders of one kind of lidar, (k,), how many of them are on the side that comes first.

    before: of each side, the beams from the shoulder forward. aback, beside: (n,), whether a beam is behind the
    shoulders, and beside or behind. below_m: (n,), everything in doubt. to_x_m: the rear beams meet no place that is
    farther ahead of the lidar, not even with the gates of `rear_places`.
    """

    beams: Beams
    first_side: int
    before: tuple[Beams, Beams]
    aback: Booleans
    beside: Booleans
    below_m: Floats
    to_x_m: float


class OwnParts:
    """Holds evidence per beam, some earlier scans, the near places of the world. Call `update` once per scan.

    below_m: (n,), what reads less is ignored; None before the first scan. doubtful: places of this scan, (k,), odom,
    which nothing tells from the car's parts. changes: how often the set of parts has changed by what was seen.
    """

    def __init__(self, lidar_m: complex) -> None:
        self._lidar_m = lidar_m
        self._known: KnownParts | None = None
        self.changes = 0
        self._begin((0.0, 0.0, 0), None)

    def _begin(self, kind: tuple[float, float, int], rear: _Rear | None) -> None:
        """Reset the state for this kind of lidar, except for the remembered parts."""
        count = rear.beams.size if rear is not None else 0
        self._kind, self._rear = kind, rear
        self._evidence, self._part_m = np.zeros(count), np.full(count, math.nan)
        self._keys: deque[_NearScan] = deque(maxlen=KEYS)
        self._world: deque[Places] = deque(maxlen=WORLD_VIEWS)
        self._all_world: Places = NOWHERE
        self._weighed_m: complex | None = None
        self._stamp_s = math.nan
        self.below_m: Floats | None = rear.below_m if rear is not None else None
        self.doubtful: Places = NOWHERE
        self._world_now: Places = NOWHERE
        known = self._known
        if known is not None and rear is not None and kind == (known.angle_min_rad, known.angle_step_rad, known.beams):
            ranges_m = np.full(known.beams, math.nan)
            for beam, range_m in known.ranges_m:
                ranges_m[beam] = range_m
            self._part_m = ranges_m[rear.beams]
            self._evidence = np.where(np.isfinite(self._part_m), 1.0, 0.0)
        self._parts: Booleans = self._evidence > PART_ABOVE
        self._rim: Booleans | None = None
        self._through_scans, self._through = np.zeros(count, np.intp), np.zeros(count, np.bool_)
        self._shut: Booleans = ~self._through
        self._doubted_m = rear.below_m if rear is not None else None
        self._settled = self._evidence.copy(), self._part_m.copy()
        self._is_settled = True

    @property
    def parts(self) -> Booleans:
        """Return the beams (n,) that see parts of the car."""
        parts = np.zeros(self._kind[2], np.bool_)
        if self._rear is not None:
            parts[self._rear.beams] = self._parts
        return parts

    @property
    def known(self) -> KnownParts | None:
        """Return the parts, to be remembered; None before the first scan."""
        if self._rear is None:
            return self._known
        beams, ranges_m = self._rear.beams[self._parts].tolist(), self._part_m[self._parts].tolist()
        found = ((beam, round(range_m, 3)) for beam, range_m in zip(beams, ranges_m, strict=True))
        return KnownParts(*self._kind, tuple(found))

    def have_met(self, scan: Scan) -> bool:
        """Return whether below_m is for the lidar that took this scan."""
        return self.below_m is not None and self.below_m.shape == scan.ranges_m.shape

    def remember(self, known: KnownParts | None) -> None:
        """Reset the state to parts known from an earlier drive, or to none."""
        self._known = known
        self._begin((0.0, 0.0, 0), None)

    def update(self, view: View, pose: OdometryState, *, moved: bool | None = True) -> None:
        """Process one scan.

        moved: whether the car really made the way that odometry says; None: not known yet, what was learnt on it waits.
        """
        scan = view.scan
        kind = scan.angle_min_rad, scan.angle_step_rad, scan.ranges_m.shape[0]
        rear = self._rear
        if rear is None or kind != self._kind:
            rear = rear_of(view)
            self._begin(kind, rear)
        elapsed_s, self._stamp_s = scan.stamp_s - self._stamp_s, scan.stamp_s
        turned = cmath.rect(1.0, pose.yaw_rad)
        seen = _RearScan(view, rear, complex(pose.x_m, pose.y_m) + self._lidar_m * turned, turned)
        world = np.zeros(seen.near.shape, np.bool_)
        if moved is False:
            self._forget_the_way()
        elif np.count_nonzero(seen.near):
            world = self._weigh(seen)
        if moved:
            self._settle()
        self._see_through(seen)
        self.below_m, self.doubtful, self._world_now = self._doubted_m, NOWHERE, NOWHERE
        if np.count_nonzero(seen.near & ~self._parts):
            world |= self._on_the_wall(seen) | (seen.near & self._through)
            self._world_now = seen.places(rear.beams[world])
            self.doubtful = seen.places(rear.beams[self._in_doubt(seen, world)])
            self.below_m = self._expecting(seen, pose, elapsed_s)
        if moved is not False and self._is_key_due(seen):
            self._keep(seen)

    def _weigh(self, seen: "_RearScan") -> Booleans:
        """Compare with earlier scans, learn what is a part, return which beams (k,) see the world move."""
        none = np.zeros(seen.near.shape, np.bool_)
        way_m = abs(seen.at_m - self._weighed_m) if self._weighed_m is not None else LONG_M
        keys = [key for key in (self._key(seen, SHORT_M), self._key(seen, LONG_M)) if key is not None]
        if way_m < WEIGHS_EVERY_M or not keys:
            return none
        self._weighed_m = seen.at_m
        fixed, moved = none.copy(), none.copy()
        for key in keys:
            here, there = seen.again(*key.polar), seen.again(*seen.polar(key.places))
            fixed |= seen.were_in_view(here & ~there, key)
            moved |= there & ~here
        both = fixed & moved
        fixed[both] = moved[both] = False
        for_fixed = around(fixed, seen.rear.first_side, AROUND_BEAMS)
        for_moved = around(moved, seen.rear.first_side, AROUND_BEAMS)
        part = fixed & (for_fixed >= MIN_FIXED) & (for_fixed > CLEARLY * for_moved)
        world = seen.near & ~fixed & (for_moved >= MIN_MOVED) & (for_moved > CLEARLY * for_fixed)
        self._learn(part, world, seen.rear_m, min(way_m, LONG_M))
        return world & ~self._parts

    def _see_through(self, seen: "_RearScan") -> None:
        """Find the beams (k,) that no part is before, at their sides neither."""
        self._through_scans[self._parts | (seen.near & self._shut)] = 0
        self._through_scans += seen.rear_m >= DOUBTED_NEARER_THAN_M  # NaN compares as not beyond
        shut = self._through_scans < MIN_THROUGH_SCANS
        if shut.tobytes() != self._shut.tobytes():
            self._shut = shut
            self._through = around(shut, seen.rear.first_side, PART_RIM_BEAMS) == 0
            self._doubted_m = seen.rear.below_m.copy()
            self._doubted_m[seen.rear.beams[self._through]] = 0.0

    def _learn(self, part: Booleans, world: Booleans, rear_m: Floats, way_m: float) -> None:
        self._is_settled = False
        gain = 1.0 - math.exp(-way_m / PART_MEMORY_M)
        off_m = rear_m - self._part_m
        begun = part & ~(np.abs(off_m) < PART_RIM_M)  # NaN: the first time
        self._part_m[begun] = rear_m[begun]
        self._evidence[begun] *= PART_BELOW
        self._part_m[part & ~begun] += gain / 4 * off_m[part & ~begun]
        self._evidence[part] += gain * (1.0 - self._evidence[part])
        self._evidence[world] *= PART_BELOW
        self._evidence[off_m > PART_RIM_M] *= math.exp(-way_m / SEEN_THROUGH_MEMORY_M)

    def _forget_the_way(self) -> None:
        """Discard what was learnt while the wheels turned and the car did not move."""
        self._keys.clear()
        if not self._is_settled:
            self._evidence, self._part_m, self._is_settled = self._settled[0].copy(), self._settled[1].copy(), True

    def _settle(self) -> None:
        """Confirm what was learnt: the car has really moved."""
        if self._is_settled:
            return
        self._is_settled = True
        self._settled = self._evidence.copy(), self._part_m.copy()
        parts = (self._evidence > PART_ABOVE) | (self._parts & (self._evidence > PART_BELOW))
        if np.count_nonzero(parts != self._parts):
            self._parts, self._rim = parts, None
            self.changes += 1

    def _on_the_wall(self, seen: "_RearScan") -> Booleans:
        """Return which near beams (k,) see the wall that is before the shoulder."""
        rear, view = seen.rear, seen.view
        wall, asked = np.zeros(seen.near.shape, np.bool_), seen.near & ~self._parts
        for side, before in zip((slice(0, rear.first_side), slice(rear.first_side, None)), rear.before, strict=True):
            index = np.flatnonzero(asked[side])
            wall[side][index] = on_the_line(view.x_m, view.y_m, view.solid, before, rear.beams[side][index])
        return wall

    def _in_doubt(self, seen: "_RearScan", world: Booleans) -> Booleans:
        """Return which beams (k,) may see the car itself; a part's rim is part of it."""
        rear, view = seen.rear, seen.view
        if self._rim is None:
            self._rim = around(self._parts, rear.first_side, PART_RIM_BEAMS) > 0
        doubtful = seen.near & ~(world | self._rim | view.own[rear.beams] | view.solid[rear.beams])
        return doubtful & supported(view.ranges_m)[rear.beams] if np.count_nonzero(doubtful) else doubtful

    def _expecting(self, seen: "_RearScan", pose: OdometryState, elapsed_s: float) -> Floats:
        """Return below_m for the expected pose of the car at the next scan."""
        rear, scan = seen.rear, seen.view.scan
        ahead_s = elapsed_s if 0.0 < elapsed_s < MAX_STEP_S + seen.view.waits_s else 0.0
        turned = cmath.rect(1.0, pose.yaw_rad + pose.yaw_rate_radps * ahead_s)
        at_m = complex(pose.x_m, pose.y_m) + pose.speed_mps * ahead_s * seen.turned + self._lidar_m * turned
        places = np.concatenate([self._all_world, self._world_now])
        away_m = expected_m(scan.ranges_m.size, *polar(places, at_m, turned, rear.to_x_m, scan))[rear.beams]
        below_m = rear.below_m.copy()
        below_m[rear.beams] = np.minimum(np.maximum(away_m - EXPECTED_WITHIN_M, 0.0), DOUBTED_NEARER_THAN_M)
        below_m[rear.beams[self._through]] = 0.0
        below_m[rear.beams[self._parts]] = DOUBTED_NEARER_THAN_M
        return below_m

    def _key(self, seen: "_RearScan", back_m: float) -> _NearScan | None:
        """Return the newest scan taken at least back_m away, None without one near by."""
        for key in reversed(self._keys):
            if back_m <= abs(seen.at_m - key.at_m) <= MAX_LENGTH_M:
                return key
        return None

    def _is_key_due(self, seen: "_RearScan") -> bool:
        if not self._keys:
            return True
        last = self._keys[-1]
        turn_rad = abs(cmath.phase(seen.turned * last.turned.conjugate()))
        return abs(seen.at_m - last.at_m) >= KEY_EVERY_M or turn_rad >= KEY_EVERY_RAD

    def _keep(self, seen: "_RearScan") -> None:
        """Store this scan for comparison with later ones, and its places of the world."""
        view, rear = seen.view, seen.rear
        near = view.ranges_m < PLACES_NEARER_THAN_M
        near &= rear.beside
        places = seen.places(near.nonzero()[0])
        self._keys.append(_NearScan(seen.at_m, seen.turned, places, seen.polar(places)))
        before = (near & view.solid & ~rear.aback).nonzero()[0]
        self._world.append(np.concatenate([seen.places(before), self._world_now]))
        self._all_world = np.concatenate(self._world)


@dataclass(slots=True, eq=False)
class _RearScan:
    """One scan behind the shoulders, and where it was taken: the lidar's place and heading in odom.

    rear_m, near: (k,) of the rear beams; near is what is doubted.
    """

    view: View
    rear: _Rear
    at_m: complex
    turned: complex
    rear_m: Floats = field(init=False)
    near: Booleans = field(init=False)

    def __post_init__(self) -> None:
        """Take the rear beams out."""
        self.rear_m = self.view.ranges_m[self.rear.beams]
        self.near = self.rear_m < DOUBTED_NEARER_THAN_M  # NaN compares as not nearer

    def places(self, beams: Beams) -> Places:
        """Return the end points of some beams, odom."""
        seen = places_m(self.view.x_m, self.view.y_m, beams) - self.view.lidar_m
        places: Places = seen * self.turned + self.at_m
        return places

    def polar(self, places: Places) -> tuple[Floats, Floats]:
        """Return range and beam of the places (m,), odom, that rear beams may meet here."""
        return polar(places, self.at_m, self.turned, self.rear.to_x_m, self.view.scan)

    def again(self, away_m: Floats, at_beam: Floats) -> Booleans:
        """Return which near beams (k,) end at one of these places, `polar` (m,)."""
        again, index = np.zeros(self.near.shape, np.bool_), self.near.nonzero()[0]
        again[index] = seen_again(self.view.ranges_m, self.rear.beams[index], away_m, at_beam)
        return again

    def were_in_view(self, which: Booleans, key: _NearScan) -> Booleans:
        """Return which of these rear beams (k,) end where an earlier scan has looked and remembers what it saw."""
        index = which.nonzero()[0]
        places = (self.places(self.rear.beams[index]) - key.at_m) * key.turned.conjugate()
        bearing_rad = np.arctan2(places.imag, places.real)
        first_rad, last_rad = self.view.bearing_rad[0], self.view.bearing_rad[-1]
        inside = (bearing_rad > min(first_rad, last_rad)) & (bearing_rad < max(first_rad, last_rad))
        seen = which.copy()
        seen[index] = inside & (np.abs(bearing_rad) > BESIDE_FROM_RAD)
        return seen


def rear_of(view: View) -> _Rear:
    """Return the rear beams of the lidar that took a scan."""
    bearing_rad = view.bearing_rad
    aside_rad = np.abs(bearing_rad)
    aback, beside = aside_rad > DOUBTED_BEYOND_RAD, aside_rad >= BESIDE_FROM_RAD
    rear = np.flatnonzero(aback)
    ordered = np.argsort(-aside_rad, kind="stable")
    ordered = ordered[(~aback & (aside_rad >= LINE_FROM_RAD))[ordered]]
    first_sign = math.copysign(1.0, bearing_rad[0])
    first = ordered[bearing_rad[ordered] * first_sign > 0]
    second = ordered[bearing_rad[ordered] * first_sign < 0]
    first_side = int(np.count_nonzero(bearing_rad[rear] * first_sign > 0))
    from_rad = max(0.0, DOUBTED_BEYOND_RAD - SAME_PLACE_BEAMS * abs(view.scan.angle_step_rad))
    to_x_m = PLACES_NEARER_THAN_M * max(0.0, math.cos(from_rad)) + ROUNDING_M
    below_m = np.where(aback, DOUBTED_NEARER_THAN_M, 0.0)
    return _Rear(rear, first_side, (first, second), aback, beside, below_m, to_x_m)
