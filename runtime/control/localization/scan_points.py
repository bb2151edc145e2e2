"""Some beams of a scan as points beside the rear axle, all as seen at the time of the last beam."""

from dataclasses import dataclass
from functools import lru_cache
from typing import Any, Final, NamedTuple

import numpy as np
import numpy.typing as npt

from wallride.drivers.accelerated import accelerated
from wallride.drivers.api import Scan
from wallride.runtime.control.perception.geometry import Booleans, Floats, Places, beam_ages_s, bearings_rad

BEAMS: Final = 180
"""Approximate number of beams that are looked at: with 45 the pose is as good, with people around the car it is not."""
MIN_RANGE_M, MAX_RANGE_M = 0.2, 15.0
"""Nearer echoes are the car's own, farther ones too noisy in bearing."""
FAR_M: Final = 2.0 * MAX_RANGE_M
JUMP_M, ALONE_M = 0.3, 0.6
"""Least step of the ranges at the edge of a thing that stands free, and its largest width."""


@dataclass(frozen=True, slots=True)
class AxleMotion:
    """Motion of the rear axle during a scan: forward and left [m/s], and turning [rad/s]."""

    ahead_mps: float
    left_mps: float
    turn_radps: float


@dataclass(frozen=True, slots=True, eq=False)
class ScanPoints:
    """Ends of beams as complex numbers (n,), in base_link at the scan's stamp, and the unit vectors of the beams.

    alone: which ends are on something narrow that stands free, such as legs or a car ahead, (n,).
    """

    places_m: Places
    ahead: Places
    alone: Booleans


class Beams(NamedTuple):
    """Every how manieth beam is looked at, their unit vectors, and how long before the stamp each was, (n,)."""

    every: int
    ahead: Places
    age_s: Floats


def scan_points(scan: Scan, lidar_m: complex, motion: AxleMotion) -> ScanPoints:
    """Return the ends of every k-th beam that has a distance. lidar_m: place of the lidar in base_link, x + iy."""
    beams = _beams(scan.angle_min_rad, scan.angle_step_rad, scan.ranges_m.shape[0], scan.ray_s)
    return ScanPoints(*ends_of_beams(scan, beams, lidar_m, motion))


def _flat_ends(scan: Scan, beams: Beams, lidar_m: complex, motion: AxleMotion) -> tuple[Any, ...]:
    return (
        scan.ranges_m[:: beams.every], beams.ahead, beams.age_s, min(MAX_RANGE_M, scan.range_max_m),
        abs(scan.angle_step_rad) * beams.every, lidar_m.real, lidar_m.imag, motion.ahead_mps, motion.left_mps,
        motion.turn_radps,
    )  # fmt: skip


@accelerated(flat=_flat_ends)
def ends_of_beams(scan: Scan, beams: Beams, lidar_m: complex, motion: AxleMotion) -> tuple[Places, Places, Booleans]:
    """Return the fields of `ScanPoints`."""
    ranges_m = scan.ranges_m[:: beams.every]
    known = np.flatnonzero((ranges_m > MIN_RANGE_M) & (ranges_m < min(MAX_RANGE_M, scan.range_max_m)))
    alone = _standing_alone(ranges_m, abs(scan.angle_step_rad) * beams.every).take(known)
    ahead = beams.ahead.take(known)
    places = ahead * ranges_m.take(known)
    places += lidar_m
    if motion.ahead_mps == 0.0 and motion.turn_radps == 0.0:
        return places, ahead, alone
    back_s = beams.age_s.take(known)
    turned = np.exp(-1j * motion.turn_radps * back_s)
    along = (0.5j * motion.ahead_mps * motion.turn_radps * back_s - complex(motion.ahead_mps, motion.left_mps)) * back_s
    return turned * places + along, turned * ahead, alone


def _standing_alone(ranges_m: npt.NDArray[np.float32], step_rad: float) -> Booleans:
    """Return which beams end on something narrower than ALONE_M with only farther things on both sides, (n,)."""
    far_m = np.where(ranges_m > MIN_RANGE_M, np.fmin(ranges_m, FAR_M), FAR_M)
    change_m = np.diff(far_m)
    begins, ends = np.flatnonzero(change_m < -JUMP_M) + 1, np.flatnonzero(change_m > JUMP_M) + 1
    alone = np.zeros(far_m.size, dtype=np.bool_)
    next_end = np.searchsorted(ends, begins, side="right")
    for begin, number in zip(begins.tolist(), next_end.tolist(), strict=True):
        if number < ends.size and (ends[number] - begin) * step_rad * float(far_m[begin]) < ALONE_M:
            alone[begin : ends[number]] = True
    return alone


@lru_cache(maxsize=8)
def _beams(first_rad: float, step_rad: float, beams: int, ray_s: float) -> Beams:
    every = max(1, beams // BEAMS)
    numbers = np.arange(beams, dtype=np.float64)[::every]
    ahead: Places = np.exp(1j * bearings_rad(first_rad, step_rad, beams)[::every])
    ahead.setflags(write=False)
    age_s = beam_ages_s(ray_s, beams, numbers)
    age_s.setflags(write=False)
    return Beams(every, ahead, age_s)
