"""A closed race line with its speeds, and the point of it that is nearest to a car."""

import cmath
import math
from dataclasses import dataclass
from typing import Final

import numpy as np

from wallride.drivers.value import value
from wallride.runtime.control.perception.geometry import Floats, Places

NEAR_M: Final = 3.0
"""Largest way along the line from scan to scan: where a line passes near itself, the other part is not taken."""

PULL_M: Final = 0.3
"""Way over which the acceleration of a line is taken."""


@value()
class OnLine:
    """The point of a line that is nearest to a place.

    along_m: way from the line's first point. aside_m: of the place from the line, left positive. yaw_rad,
    curvature_radpm: of the line there.
    """

    along_m: float
    aside_m: float
    yaw_rad: float
    curvature_radpm: float


@dataclass(frozen=True, slots=True, eq=False)
class CourseLine:
    """Points in the map's frame in the direction of driving, shape (n,) each; the last one joins the first.

    places_m: x + iy. along_m: way from the first point, rising from 0. yaw_rad: heading. curvature_radpm: positive to
    the left. speed_mps: at which a point is passed. length_m: of the whole lap. is_against_lap: it goes round the other
    way than the lap that the map was made of.
    """

    places_m: Places
    along_m: Floats
    yaw_rad: Floats
    curvature_radpm: Floats
    speed_mps: Floats
    length_m: float
    is_against_lap: bool = False

    @property
    def aside_mps2(self) -> float:
        """Return the largest lateral acceleration of the line."""
        return float((self.speed_mps**2 * np.abs(self.curvature_radpm)).max())

    def nearest(self, place_m: complex, near_m: float = math.nan) -> OnLine:
        """Return the nearest point. near_m: way along the line as known from the last scan; NaN: anywhere on it."""
        count = self.places_m.size
        if math.isfinite(near_m):
            reach = min(count // 2, 1 + int(NEAR_M * count / self.length_m))
            here, _ = self._before(near_m)
            some = np.arange(here - reach, here + reach + 1) % count
            number = int(some[np.argmin(np.abs(self.places_m.take(some) - place_m))])
        else:
            number = int(np.argmin(np.abs(self.places_m - place_m)))
        before = (number - 1) % count
        piece = number if self._share(place_m, number) > 0.0 else before
        return self._on(place_m, piece, min(max(self._share(place_m, piece), 0.0), 1.0))

    def _share(self, place_m: complex, piece: int) -> float:
        """Return where beside a piece a place is: 0 at its first point, 1 at its last."""
        begin = complex(self.places_m[piece])
        step = complex(self.places_m[(piece + 1) % self.places_m.size]) - begin
        return ((place_m - begin) * step.conjugate()).real / max(1e-12, abs(step) ** 2)

    def _on(self, place_m: complex, piece: int, share: float) -> OnLine:
        after = (piece + 1) % self.places_m.size
        begin_m, end_m = complex(self.places_m[piece]), complex(self.places_m[after])
        yaw_rad = float(self.yaw_rad[piece])
        yaw_rad += share * math.remainder(float(self.yaw_rad[after]) - yaw_rad, math.tau)
        off_m = place_m - (begin_m + share * (end_m - begin_m))
        first, last = float(self.curvature_radpm[piece]), float(self.curvature_radpm[after])
        along_m = float(self.along_m[piece]) + share * abs(end_m - begin_m)
        aside_m = (off_m * cmath.exp(-1j * yaw_rad)).imag
        return OnLine(
            along_m % self.length_m, aside_m, math.remainder(yaw_rad, math.tau), first + share * (last - first)
        )

    def curvature_at(self, along_m: float) -> float:
        """Return the curvature at a way along the line [1/m]."""
        return self._between(self.curvature_radpm, along_m)

    def speed_at(self, along_m: float) -> float:
        """Return the speed at a way along the line [m/s]."""
        return self._between(self.speed_mps, along_m)

    def pull_at(self, along_m: float) -> float:
        """Return the acceleration along the way from a place on [m/s2]."""
        return (self.speed_at(along_m + PULL_M) ** 2 - self.speed_at(along_m) ** 2) / (2.0 * PULL_M)

    def place_at(self, along_m: float) -> complex:
        """Return the point at a way along the line."""
        number, share = self._before(along_m)
        begin_m, end_m = self.places_m[number], self.places_m[(number + 1) % self.places_m.size]
        return complex(begin_m + share * (end_m - begin_m))

    def ahead(self, along_m: float, ways_m: Floats) -> tuple[Places, Places, Floats]:
        """Return points, directions (of about unit length) and speeds at ways ahead of a place, (n,) each."""
        at_m = (along_m + ways_m) % self.length_m
        number = self.along_m.searchsorted(at_m, side="right") - 1
        after = (number + 1) % self.along_m.size
        begin_m, step_m = self.along_m[number], (self.along_m[after] - self.along_m[number]) % self.length_m
        share = np.minimum(1.0, (at_m - begin_m) / np.maximum(step_m, 1e-9))
        begins, ends = (np.exp(1j * self.yaw_rad[some]) for some in (number, after))
        places = self.places_m[number] + share * (self.places_m[after] - self.places_m[number])
        speeds = self.speed_mps[number] + share * (self.speed_mps[after] - self.speed_mps[number])
        return places, begins + share * (ends - begins), speeds

    def _between(self, values: Floats, along_m: float) -> float:
        number, share = self._before(along_m)
        first, last = float(values[number]), float(values[(number + 1) % values.size])
        return first + share * (last - first)

    def _before(self, along_m: float) -> tuple[int, float]:
        """Return the last point before a way along the line, and the share of the piece that begins there."""
        along_m %= self.length_m
        number = int(np.searchsorted(self.along_m, along_m, side="right")) - 1
        begin_m = float(self.along_m[number])
        end_m = float(self.along_m[number + 1]) if number + 1 < self.along_m.size else self.length_m
        return number, min(1.0, (along_m - begin_m) / max(1e-9, end_m - begin_m))
