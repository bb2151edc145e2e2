"""Parts of the car in its lidar's view: near returns behind the shoulders that stay while the car moves."""

from typing import Any

import numpy as np
import numpy.typing as npt

from wallride.runtime.calibration.scan_motion import Kind
from wallride.runtime.control.perception.geometry import Booleans, Floats, bearings_rad

BEHIND_DEG, WITHIN_M = 90.0, 0.8
MAX_STD_M, MIN_SHARE = 0.05, 0.25
"""Maximum spread of a beam's near returns, and the minimum share of scans with one."""
SIGMA_PER_MAD = 1.4826
RIM_BEAMS = 3


def near_parts_m(ranges_m: npt.NDArray[np.floating[Any]], kind: Kind, range_min_m: float = 0.02) -> Floats:
    """Return the range of the own part in each beam, (beams,), inf without one, of scans (n, beams) of a moving car."""
    with np.errstate(invalid="ignore"):
        near: Booleans = (ranges_m > range_min_m) & (ranges_m < WITHIN_M)
    share = near.mean(axis=0)
    part_m = np.full(kind[2], np.inf)
    behind = np.abs(np.degrees(bearings_rad(*kind))) > BEHIND_DEG
    for beam in np.flatnonzero(behind & (share > MIN_SHARE)):
        returns_m = ranges_m[near[:, beam], beam].astype(np.float64)
        if SIGMA_PER_MAD * np.median(np.abs(returns_m - np.median(returns_m))) < MAX_STD_M:
            part_m[beam] = np.median(returns_m)
    return part_m


def seen_beams(part_m: Floats) -> Booleans:
    """Return the beams (beams,) that see a part, or its rim."""
    found = np.isfinite(part_m)
    wide = np.convolve(found, np.ones(2 * RIM_BEAMS + 1), mode="same") > 0
    return np.asarray(wide)


def sectors(part_m: Floats, kind: Kind) -> tuple[tuple[float, float, float], ...]:
    """Return the rows of beams with parts: from_deg, to_deg, range_m."""
    deg, found = np.degrees(bearings_rad(*kind)), np.isfinite(part_m)
    edges = np.flatnonzero(np.diff(np.concatenate([[0], found.astype(int), [0]])))
    return tuple(
        (float(deg[first]), float(deg[end - 1]), float(np.median(part_m[first:end])))
        for first, end in zip(edges[::2], edges[1::2], strict=True)
    )
