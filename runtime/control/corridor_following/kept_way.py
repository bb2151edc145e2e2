"""The way that is kept from scan to scan: carried by odometry, its near part as it was, its far part planned anew.

A way that is wholly new at each scan makes the car weave: noise of the borders becomes steering. What the car drives
within the next FIXED_S stays as it is; the odometry errs little on so short a way. All of it is planned anew only where
there is no way yet, where a border has come too near to its fixed part, or where the car has left it.
"""

import cmath
import math
from dataclasses import dataclass
from typing import Final

import numpy as np

from wallride.drivers.value import value
from wallride.runtime.control.corridor_following.bending import KEEP_M, LEAST_KEEP_M, bounds_of, straightened
from wallride.runtime.control.corridor_following.borders import CourseBorders, CourseReturns, borders_at, leads_through
from wallride.runtime.control.corridor_following.marching import STEP_M, course_of, marched
from wallride.runtime.control.perception.geometry import Places

FIXED_S, FIXED_M = 0.25, 0.3
"""Time and way for which the way ahead of the car stays as it is."""
BEHIND: Final = 3
"""Number of points that are kept behind the car."""
FIRST_ROUNDS: Final = 3
OTHER_SCANS, FAR_SCANS, FAR_M = 4, 12, 4.0
"""For so many scans another gap has to come first before the way is turned to it, while its own is still there; for
more while it is farther than FAR_M, where a dent in the wall looks like the end of it."""
NARROWS_M: Final = 0.27
"""How much nearer than KEEP_M a border may come to the fixed part."""
OFF_M: Final = 0.35
"""How far beyond its bounds the far part of a way may be; beyond that it leads elsewhere, and is marched anew."""
LEFT_M, LEFT_RAD = 0.35, 0.5
"""Distance and angle by which the car has left its way."""


@value(eq=False)
class Way:
    """Points (n,) in base_link at a scan, about STEP_M apart. here: the one beside the car. seen: how many are seen."""

    places_m: Places
    here: int
    seen: int

    def carried(self, moved_m: complex, turned_rad: float) -> "Way":
        """Return it as seen from the car after a motion."""
        return Way((self.places_m - moved_m) * cmath.exp(-1j * turned_rad), self.here, self.seen)


def even(places_m: Places, begin: int) -> Places:
    """Return a way whose points from `begin` on are STEP_M apart, on cubic pieces through the given ones."""
    part = places_m[max(0, begin - 1) :]
    gaps_m = np.abs(np.diff(part))
    along_m = np.concatenate([[0.0], np.cumsum(gaps_m)])
    slopes = np.empty_like(part)
    slopes[1:-1] = (part[2:] - part[:-2]) / (along_m[2:] - along_m[:-2])
    slopes[0], slopes[-1] = (part[1] - part[0]) / gaps_m[0], (part[-1] - part[-2]) / gaps_m[-1]
    at_m = np.arange(along_m[min(1, begin)], along_m[-1] + 1e-6, STEP_M)
    piece = np.minimum(np.searchsorted(along_m, at_m, side="right") - 1, gaps_m.size - 1)
    gap_m = gaps_m[piece]
    t = (at_m - along_m[piece]) / gap_m
    t2, t3 = t * t, t * t * t
    found = (
        (2 * t3 - 3 * t2 + 1) * part[piece] + (t3 - 2 * t2 + t) * gap_m * slopes[piece]
        + (3 * t2 - 2 * t3) * part[piece + 1] + (t3 - t2) * gap_m * slopes[piece + 1]
    )  # fmt: skip
    return np.concatenate([places_m[:begin], found])


@dataclass(slots=True)
class KeptWay:
    """The way of the car, None where there is none. other: for how many scans another gap has come first."""

    way: Way | None = None
    other: int = 0

    def forget(self) -> None:
        """Give the way up."""
        self.way, self.other = None, 0

    def plan(self, returns: CourseReturns, speed_mps: float) -> Way | None:
        """Take in a scan, to which the way was carried; return the way from now on, None where there is none."""
        kept = self._onward(returns, speed_mps) if self.way is not None else None
        self.way = kept if kept is not None else self._anew(returns)
        return self.way

    def _onward(self, returns: CourseReturns, speed_mps: float) -> Way | None:
        """Return the way with its far part planned anew, None where it has to be planned wholly anew."""
        way = self.way
        assert way is not None  # noqa: S101 - `plan` has asked
        here = int(np.abs(way.places_m).argmin())
        dropped = max(0, here - BEHIND)
        places_m, here = way.places_m[dropped:], here - dropped
        fixed = here + 2 + math.ceil((FIXED_M + FIXED_S * speed_mps) / STEP_M)
        course = course_of(places_m)
        off_m = (-places_m[here] * course[here].conj()).imag
        if places_m.size <= fixed or abs(off_m) > LEFT_M or abs(cmath.phase(complex(course[here]))) > LEFT_RAD:
            return None
        gap, stays = self._gap(returns, places_m, course)
        if gap is None:
            return None
        borders = borders_at(returns, gap)
        kept = max(fixed, _seen(returns, places_m, here)) if stays else fixed
        if kept > fixed and bounds_of(places_m[:kept], course[:kept], borders).off_m(slice(here, kept)) > OFF_M:
            kept = fixed
        places_m = marched(places_m[:kept], complex(course[kept - 1]), borders, returns)
        return _finished(places_m, here, fixed, borders, returns, NARROWS_M)

    def _gap(self, returns: CourseReturns, places_m: Places, course: Places) -> tuple[int | None, bool]:
        """Return the gap that the way leads through, and whether it is the one of the way so far."""
        if not returns.gaps:
            return None, False
        first, own = returns.gaps[0], _led_through(returns, returns.gaps, places_m, course)
        most = OTHER_SCANS if own is None or abs(returns.places_m[first]) < FAR_M else FAR_SCANS
        if own is None:
            nearer = _led_through(returns, returns.kept, places_m, course)
            own = nearer if nearer is not None and nearer < first else first
        if own == first:
            self.other = 0
            return first, True
        self.other += 1
        if self.other < most:
            return own, True
        self.other = 0
        return first, False

    def _anew(self, returns: CourseReturns) -> Way | None:
        """Return a way from the car on, in its direction first."""
        begin_m = STEP_M * np.arange(-BEHIND, 2, dtype=np.float64).astype(np.complex128)
        for gap in returns.gaps[:2]:
            borders = borders_at(returns, gap)
            places_m = marched(begin_m, 1 + 0j, borders, returns)
            way: Way | None = None
            for _ in range(FIRST_ROUNDS):
                if places_m.size <= begin_m.size + 2:
                    break
                way = _finished(places_m, BEHIND, begin_m.size, borders, returns, KEEP_M - LEAST_KEEP_M)
                if way is None:
                    break
                places_m = way.places_m
            if way is not None:
                self.other = 0
                return way
        return None


def _led_through(returns: CourseReturns, gaps: tuple[int, ...], places_m: Places, course: Places) -> int | None:
    """Return the first of some gaps that a way leads through."""
    return next((gap for gap in gaps if leads_through(returns, gap, places_m, course)), None)


def _finished(
    places_m: Places, here: int, fixed: int, borders: CourseBorders, returns: CourseReturns, spare_m: float
) -> Way | None:
    """Return a way that bends least from its fixed part on, cut where there is no room; None where that is too near.

    spare_m: how much nearer than KEEP_M a border may be to the fixed part.
    """
    if places_m.size <= fixed + 2:
        return None
    course = course_of(places_m)
    bounds = bounds_of(places_m, course, borders)
    closed = np.flatnonzero(bounds.lack_m[here:] > 2.0 * (KEEP_M - LEAST_KEEP_M))
    end = here + int(closed[0]) if closed.size else places_m.size
    if end <= fixed + 2 or bounds.off_m(slice(here, fixed)) > spare_m:
        return None
    places_m = even(straightened(places_m[:end], course[:end], fixed, bounds.first(end)), fixed)
    return Way(places_m, here, _seen(returns, places_m, here))


def _seen(returns: CourseReturns, places_m: Places, here: int) -> int:
    """Return how many points of a way are seen from the car, up to the first hidden one ahead of it."""
    hidden = np.flatnonzero(returns.sees(places_m[here + 1 :]) < 0.0)
    return here + 1 + int(hidden[0]) if hidden.size else places_m.size
