"""The places on a map at which a scan fits: around one that was told, or anywhere."""

import cmath
import math
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Final

import numpy as np
import numpy.typing as npt

from wallride.drivers.accelerated import accelerated
from wallride.runtime.control.localization.line_field import LineField
from wallride.runtime.control.localization.pose_filter import PoseFilter
from wallride.runtime.control.localization.scan_points import ScanPoints
from wallride.runtime.control.perception.geometry import Floats, Places

STEP_M, STEP_RAD = 0.25, math.radians(5.0)
BEAMS: Final = 60
SEEN_M: Final = 10.0
"""Farther ends of beams are not looked up."""
WALL_M: Final = 0.2
"""Least distance of a car's middle from a wall."""
AROUND_M, AROUND_RAD = 0.8, math.radians(30.0)
AROUND_STEP_M: Final = 0.2
KEPT, KEPT_OF_HEADING, REFINED = 1000, 40, 96
"""Best places that are kept of a search, of each heading, and those of them, apart from each other, that scans are laid
over: with 12 of 200, alike places along a corridor left the right one out (levine, 5 of 180 starts)."""
APART_M, APART_RAD = 0.5, math.radians(20.0)
PRIOR_M, PRIOR_RAD = 0.2, math.radians(6.0)
FINE_M: Final = 0.06
"""Width within which the ends of beams are near their wall, for the comparison of refined places."""
ALIKE: Final = 0.95
"""A second place with this share of the best one's nearness is as likely."""
BEFORE_WALL: Final = 0.1
"""Nearness below which a beam that ends in free space ends before its wall."""
LOOK_UPS: Final = 500_000
"""Look-ups of one part of a search: about 0.5 ms on a laptop, 5 ms without the C."""
LAID_AT_ONCE: Final = 6
"""Places over which a scan is laid in one part: as long."""

Numbers = npt.NDArray[np.intp]


@dataclass(frozen=True, slots=True)
class Place:
    """A pose on the map at which a scan fits. score: mean nearness of its beams to a wall, 0 to 1."""

    x_m: float
    y_m: float
    yaw_rad: float
    score: float


@dataclass(frozen=True, slots=True)
class Candidates:
    """Poses on the map, x + iy and yaw, with their scores; all of shape (n,)."""

    places_m: Places
    yaws_rad: Floats
    scores: Floats

    @classmethod
    def joined(cls, *parts: "Candidates") -> "Candidates":
        """Return those of several."""
        return cls(
            np.concatenate([part.places_m for part in parts]), np.concatenate([part.yaws_rad for part in parts]),
            np.concatenate([part.scores for part in parts]),
        )  # fmt: skip

    def best(self, most: int) -> "Candidates":
        """Return the best ones, the best first."""
        first = np.argsort(-self.scores, kind="stable")[:most]
        return Candidates(self.places_m[first], self.yaws_rad[first], self.scores[first])

    def apart(self, most: int) -> list[Place]:
        """Return the best ones that are apart from each other, the best first."""
        left, chosen = self.best(self.scores.size), list[Place]()
        while left.scores.size and len(chosen) < most:
            place_m, yaw_rad = complex(left.places_m[0]), float(left.yaws_rad[0])
            chosen.append(Place(place_m.real, place_m.imag, yaw_rad, float(left.scores[0])))
            turned_rad = np.angle(np.exp(1j * (left.yaws_rad - yaw_rad)))
            other = (np.abs(left.places_m - place_m) > APART_M) | (np.abs(turned_rad) > APART_RAD)
            left = Candidates(left.places_m[other], left.yaws_rad[other], left.scores[other])
        return chosen


NONE: Final = Candidates(np.empty(0, np.complex128), np.empty(0), np.empty(0))


class PlaceSearch:
    """Searches on one map; what it needs of the map is computed once."""

    def __init__(self, field: LineField, wheelbase_m: float) -> None:
        self._field = field
        self._wheelbase_m = wheelbase_m
        nearness = field.nearness.reshape(field.rows, field.columns)
        # Beams that leave the map on a side come out in this margin, which is far from all walls.
        self._width = field.columns + int(SEEN_M / field.cell_m) + 1
        padded = np.zeros((field.rows, self._width), dtype=np.float32)
        padded[:, : field.columns] = nearness
        self._nearness = padded.ravel()
        self._everywhere = self._free_places(nearness)
        self._cells = self._cells_of(self._everywhere)

    def around(self, points: ScanPoints, x_m: float, y_m: float, yaw_rad: float) -> list[Place]:
        """Return the places within AROUND_M and AROUND_RAD of one, the best first; that one where none is better."""
        steps_m: Floats = np.arange(-AROUND_M, AROUND_M + 1e-9, AROUND_STEP_M)
        places = np.empty(steps_m.size**2, np.complex128)
        places.real, places.imag = x_m + np.repeat(steps_m, steps_m.size), y_m + np.tile(steps_m, steps_m.size)
        yaws = yaw_rad + np.arange(-AROUND_RAD, AROUND_RAD + 1e-9, STEP_RAD)
        cells = self._cells_of(places)
        told = self._laid(points, Place(x_m, y_m, yaw_rad, 0.0))
        if told.score >= ALIKE:  # no place has more than 1
            return [told]
        rough = Candidates.joined(*(self._scored(points, places, cells, float(yaw)) for yaw in yaws))
        found = _joined([self._laid(points, place) for place in rough.apart(REFINED)]).apart(REFINED)
        if found and told.score >= ALIKE * found[0].score:
            return [told]
        return found

    def anywhere(self, points: ScanPoints) -> Iterator[list[Place] | None]:
        """Search all free places: yield None after each part of the search, and the places, the best first, at last."""
        rough = NONE
        at_once, scored = max(1, LOOK_UPS // BEAMS), 0
        for yaw in np.arange(-math.pi, math.pi, STEP_RAD):
            for first in range(0, self._everywhere.size, at_once):
                some = slice(first, first + at_once)
                more = self._scored(points, self._everywhere[some], self._cells[some], float(yaw))
                rough = Candidates.joined(rough, more)
                scored += self._cells[some].size
                if scored >= at_once:
                    scored = 0
                    yield None
            rough = rough.best(KEPT)
        laid: list[Place] = []
        apart = rough.apart(REFINED)
        yield None
        for number, place in enumerate(apart, start=1):
            laid.append(self._laid(points, place))
            if number % LAID_AT_ONCE == 0:
                yield None
        yield _joined(laid).apart(REFINED)

    def _free_places(self, nearness: npt.NDArray[np.float32]) -> Places:
        field = self._field
        every = max(1, round(STEP_M / field.cell_m))
        free = field.free.reshape(field.rows, field.columns) & (nearness < math.exp(-((WALL_M / 0.2) ** 2)))
        row, column = np.nonzero(free[::every, ::every])
        there = field.corner_m + field.cell_m * (every * (column + 1j * row) + 0.5 + 0.5j)
        return np.asarray(there, np.complex128)

    def _cells_of(self, places: Places) -> Numbers:
        inside = (places - self._field.corner_m) / self._field.cell_m
        return np.floor(inside.imag).astype(np.intp) * self._width + np.floor(inside.real).astype(np.intp)

    def _scored(self, points: ScanPoints, places: Places, cells: Numbers, yaw_rad: float) -> Candidates:
        """Return the best of some places, in these cells, with one heading."""
        near = points.places_m[np.abs(points.places_m) < SEEN_M]
        if not near.size or not places.size:
            return NONE
        arms = near[:: max(1, near.size // BEAMS)] * cmath.exp(1j * yaw_rad)
        shifts = np.rint(arms / self._field.cell_m)
        ends = shifts.imag.astype(np.intp) * self._width + shifts.real.astype(np.intp)
        scores = mean_nearness(self._nearness, cells, ends)
        few = min(scores.size, KEPT_OF_HEADING)
        best = np.argpartition(-scores, few - 1)[:few]
        return Candidates(places[best], np.full(few, yaw_rad), scores[best])

    def _laid(self, points: ScanPoints, place: Place) -> Place:
        filter_ = PoseFilter(self._field, self._wheelbase_m)
        filter_.state[:3] = place.x_m, place.y_m, place.yaw_rad
        for std_m in (PRIOR_M, 0.5 * PRIOR_M):
            x_m, y_m, yaw_rad = filter_.state[:3].tolist()
            filter_.place(x_m, y_m, yaw_rad, std_m, PRIOR_RAD * std_m / PRIOR_M)
            filter_.correct(points)
        x_m, y_m, yaw_rad = filter_.state[:3].tolist()
        return Place(x_m, y_m, yaw_rad, nearness_at(self._field, points, filter_.state))


def _joined(places: list[Place]) -> Candidates:
    """Return places as candidates."""
    rows = np.array([(place.x_m, place.y_m, place.yaw_rad, place.score) for place in places]).reshape(-1, 4)
    return Candidates(rows[:, 0] + 1j * rows[:, 1], rows[:, 2], rows[:, 3])


@accelerated
def mean_nearness(nearness: npt.NDArray[np.float32], cells: Numbers, ends: Numbers) -> Floats:
    """Return the mean nearness at the ends of beams (k,) from each of some cells (n,); outside, that of a corner."""
    near = nearness.take(cells[:, None] + ends, mode="clip")
    return np.asarray(near.sum(axis=1, dtype=np.float64) / max(1, ends.size), np.float64)


def nearness_at(field: LineField, points: ScanPoints, pose: Floats) -> float:
    """Return the mean nearness of a scan's beams to their walls at a pose, 0 to 1: exp(-(distance / FINE_M)^2).

    Beams that end in free space, at a person, count half.
    """
    if not points.places_m.size:
        return 0.0
    turn = cmath.exp(1j * float(pose[2]))
    places = points.places_m * turn + complex(float(pose[0]), float(pose[1]))
    lines = field.lines_at(places, points.ahead * turn)
    off_m = (field.normals[lines].conj() * places).real - field.offsets_m[lines]
    near = np.exp(-((off_m / FINE_M) ** 2))
    before = (near < BEFORE_WALL) & field.free.take(field.cells_at(places))
    return float(np.sum(near) / (near.size - 0.5 * np.count_nonzero(before)))
