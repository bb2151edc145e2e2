"""Geometry of the beams. Lidar frame: x forward, y left, angles counter-clockwise (REP-103)."""

import math
from functools import lru_cache
from typing import Any

import numpy as np
import numpy.typing as npt

from wallride.drivers.accelerated import accelerated
from wallride.drivers.api import Scan

Floats = npt.NDArray[np.float64]
Booleans = npt.NDArray[np.bool_]
Bytes = npt.NDArray[np.int8]
Places = npt.NDArray[np.complex128]
"""Points of a plane as complex numbers x + iy [m]: turning them all by an angle is one multiplication."""
NOWHERE: Places = np.empty(0, np.complex128)
NOWHERE.setflags(write=False)
ENOUGH_POINTS = 3
"""Minimum number of points that count as an object; fewer are noise (2 % outliers)."""


def beam_ages_s(ray_s: float, beams: int, numbers: Floats) -> Floats:
    """Return how long before the end of a sweep of so many beams these were sent. ray_s: as of the scan."""
    ages_s: Floats = ray_s * (beams - 1.0 - numbers) if ray_s > 0.0 else -ray_s * numbers
    return ages_s


@lru_cache(maxsize=8)
def bearings_rad(angle_min_rad: float, angle_step_rad: float, beams: int) -> Floats:
    """Return the bearing of every beam, shape (beams,), read-only; computed once per kind of lidar."""
    bearings: Floats = angle_min_rad + angle_step_rad * np.arange(beams, dtype=np.float64)
    bearings.setflags(write=False)
    return bearings


@lru_cache(maxsize=8)
def directions(angle_min_rad: float, angle_step_rad: float, beams: int) -> Floats:
    """Return the unit vector of every beam, shape (2, beams), read-only; computed once per kind of lidar."""
    bearings = bearings_rad(angle_min_rad, angle_step_rad, beams)
    vectors = np.stack([np.cos(bearings), np.sin(bearings)])
    vectors.setflags(write=False)
    return vectors


def beyond(scan: Scan, bearing_rad: float) -> Booleans:
    """Return which beams have a larger absolute bearing, (beams,), read-only; computed once per kind of lidar."""
    return _beyond(scan.angle_min_rad, scan.angle_step_rad, scan.ranges_m.shape[0], bearing_rad)


@lru_cache(maxsize=16)
def _beyond(angle_min_rad: float, angle_step_rad: float, beams: int, bearing_rad: float) -> Booleans:
    aside: Booleans = np.abs(bearings_rad(angle_min_rad, angle_step_rad, beams)) > bearing_rad
    aside.setflags(write=False)
    return aside


def sector(scan: Scan, from_rad: float, to_rad: float) -> slice:
    """Return the beams with from_rad <= bearing <= to_rad; an empty slice where the lidar does not look."""
    beams = scan.ranges_m.shape[0]
    first = int(np.ceil((from_rad - scan.angle_min_rad) / scan.angle_step_rad - 1e-6))
    last = int(np.floor((to_rad - scan.angle_min_rad) / scan.angle_step_rad + 1e-6))
    return slice(max(0, min(first, beams)), max(0, min(last + 1, beams)))


def points_m(scan: Scan, part: slice) -> Floats:
    """Return the end points of some beams, shape (2, n), lidar frame; NaN where a beam has no distance."""
    vectors = directions(scan.angle_min_rad, scan.angle_step_rad, scan.ranges_m.shape[0])
    return vectors[:, part] * scan.ranges_m[part]


def places_m(x_m: Floats, y_m: Floats, which: npt.NDArray[np.intp]) -> Places:
    """Return some points, given by their indices, as complex numbers, shape (k,)."""
    places = np.empty(which.size, np.complex128)
    places.real = x_m.take(which)
    places.imag = y_m.take(which)
    return places


@accelerated
def solid_places(x_m: Floats, y_m: Floats, solid: Booleans) -> Places:
    """Return the solid ones of points (n,) as complex numbers, shape (k,)."""
    return places_m(x_m, y_m, solid.nonzero()[0])


@accelerated
def any_nearer(solid: Booleans, ranges_m: Floats, reach_m: float) -> bool:
    """Return whether a solid beam has a range below reach_m."""
    return bool(np.count_nonzero(solid & (ranges_m < reach_m)))


@accelerated
def beside_path_m(points_m: Places, path_m: Places) -> Floats:
    """Return the distance of points (k,) from a path (n,), n >= 2; 0 for those beyond its end."""
    begins_m, chords = path_m[:-1], np.diff(path_m)
    there_m = points_m[:, None] - begins_m
    share = (there_m * chords.conj()).real / np.maximum(np.abs(chords) ** 2, 1e-12)
    off_m = np.abs(there_m - np.clip(share, 0.0, 1.0) * chords)
    nearest = off_m.argmin(axis=1)
    apart_m: Floats = off_m.min(axis=1)
    apart_m[(nearest == chords.size - 1) & (share[:, -1] > 1.0)] = 0.0
    return apart_m


def median(values: npt.NDArray[np.floating[Any]]) -> float:
    """Return the median of some values (n,), n > 0, none of them NaN.

    As numpy's, which imports numpy.ma at the first call: 30 ms in the middle of a drive, and 1.3 MiB.
    """
    ordered, half = np.sort(values), values.size // 2
    return float(ordered[half] if values.size % 2 else (ordered[half - 1] + ordered[half]) / 2)


def quantile(values: npt.NDArray[np.floating[Any]], share: float) -> float:
    """Return the value below which a share of some values lies, linear between two; else as `median`."""
    ordered, place = np.sort(values), share * (values.size - 1)
    low, high = ordered[math.floor(place)], ordered[math.ceil(place)]
    between = place - math.floor(place)
    return float(low + (high - low) * between if between < 0.5 else high - (high - low) * (1.0 - between))
