"""Scan matching: the motion of the last second, accurate enough to see slow things move.

The wheels tell the distance well and the heading badly: the servo lags, has a trim, and tyres slip. An error of 0.3
rad/s moves a table leg 4 m away by more than a person walks. So each scan is compared with one taken a moment before
(point-to-line ICP with projective association: Chen & Medioni 1991, Blais & Levine 1995), beginning at the
motion by odometry, which also decides where the scene does not: along a bare corridor.
"""

import cmath
import math
from dataclasses import dataclass
from typing import Any, Final, NamedTuple

import numpy as np
import numpy.typing as npt

from wallride.drivers.accelerated import accelerated
from wallride.runtime.control.perception.geometry import Booleans, Floats, Places
from wallride.runtime.control.perception.view import View

POINTS = 180
"""Approximate number of points that are compared, of any lidar."""
MIN_RANGE_M, MAX_RANGE_M = 0.3, 12.0
SURFACE_BEAMS = 3
"""Number of beams to each side that define the line through a point."""
STRAIGHT_M = 0.03
"""Maximum distance of a point from the middle of its neighbours on a straight surface."""
STEEPEST = 12.0
"""Maximum distance of these neighbours in multiples of their distance on a surface that faces the lidar: grazing
beams have no certain line."""
GATES_M = (0.25, 0.12, 0.06)
"""Maximum distance of a point from its line, for each iteration: people and revealed surfaces are left out."""
ALONG_M = 0.3
NOISE_M = 0.03
DRIFT: Final = (0.003, 0.02, 0.03)
SLIDE: Final = (0.1, 0.1, 0.1)
"""Standard deviations of the noise of a range with its surface, and of the guess over one scan, ahead and aside [m] and
in heading [rad]: by rolling wheels, which slip less along the car than across it, and of a car that slides on."""
ENOUGH_POINTS, ENOUGH_SHARE = 40, 0.6
"""Minimum number of points that fit, and their minimum share of those that have a line."""
SURE_M, SURE_RAD = 0.012, 0.004
"""Maximum standard deviations, by the scene alone, of a trusted shift to the side and of a trusted turn."""


class ScanPose(NamedTuple):
    """Position [m] as a complex number, and heading [rad] of base_link."""

    at_m: complex = 0j
    yaw_rad: float = 0.0

    def placed(self, other: "ScanPose") -> "ScanPose":
        """Return a pose given relative to this one in the frame of this one."""
        return ScanPose(self.at_m + other.at_m * cmath.rect(1.0, self.yaw_rad), self.yaw_rad + other.yaw_rad)

    def seen_from(self, other: "ScanPose") -> "ScanPose":
        """Return this pose relative to another one of the same frame."""
        return ScanPose((self.at_m - other.at_m) * cmath.rect(1.0, -other.yaw_rad), self.yaw_rad - other.yaw_rad)


@dataclass(frozen=True, slots=True, eq=False)
class Surfaces:
    """Points of a scan with the lines through them, all (beams,), base_link; valid where `flat`."""

    points_m: Places
    normals: Places
    flat: Booleans


def surfaces_of(view: View) -> Surfaces:
    """Return the points of a scan and the lines through them."""
    points, n = view.x_m + 1j * view.y_m, SURFACE_BEAMS
    along, middle = np.zeros_like(points), np.full_like(points, np.nan)
    along[n:-n] = points[2 * n :] - points[: -2 * n]
    middle[n:-n] = (points[2 * n :] + points[: -2 * n]) / 2
    size_m = np.abs(along)
    facing_m = 2 * n * abs(view.scan.angle_step_rad) * view.ranges_m
    with np.errstate(invalid="ignore", divide="ignore"):
        flat = (np.abs(points - middle) < STRAIGHT_M) & (size_m < STEEPEST * facing_m) & view.solid  # NaN is not less
        normals = 1j * along / size_m
    return Surfaces(points, normals, flat)


def match(
    view: View, surfaces: Surfaces, guess: ScanPose, drift: tuple[float, float, float] = DRIFT
) -> tuple[ScanPose, bool] | None:
    """Return the pose of a scan relative to that of the surfaces, and whether it is sure; None where they do not fit.

    guess: that pose by odometry. drift: its standard deviations. Both scans of one sensor, (beams,).
    """
    found = match_scan(view, surfaces, guess, drift)
    return None if found is None else (ScanPose(complex(found[0], found[1]), found[2]), found[3])


def _flat_match(view: View, surfaces: Surfaces, guess: ScanPose, drift: tuple[float, float, float]) -> tuple[Any, ...]:
    scan, lidar_m = view.scan, view.lidar_m
    return (
        view.x_m, view.y_m, view.ranges_m, view.solid, lidar_m.real, lidar_m.imag, scan.angle_min_rad,
        scan.angle_step_rad, surfaces.points_m, surfaces.normals, surfaces.flat, guess.at_m.real, guess.at_m.imag,
        guess.yaw_rad, *drift,
    )  # fmt: skip


@accelerated(flat=_flat_match)
def match_scan(
    view: View, surfaces: Surfaces, guess: ScanPose, drift: tuple[float, float, float]
) -> tuple[float, float, float, bool] | None:
    """Return x_m, y_m and yaw_rad of `match`, and whether they are sure."""
    every = max(1, view.solid.size // POINTS)
    beams = view.solid[::every].nonzero()[0] * every
    range_m = view.ranges_m[beams]
    beams = beams[(range_m > MIN_RANGE_M) & (range_m < MAX_RANGE_M)]
    points = view.x_m[beams] + 1j * view.y_m[beams]
    off = np.zeros(3)
    prior = _prior(guess.yaw_rad, drift)
    for gate_m in GATES_M:
        pose = ScanPose(guess.at_m + complex(off[0], off[1]), guess.yaw_rad + off[2])
        paired = _pair(points, surfaces, pose, view, gate_m)
        if paired is None:
            return None
        slopes, apart_m, share = paired
        information = slopes.T @ slopes / NOISE_M**2
        off = off - np.linalg.solve(information + prior, slopes.T @ apart_m / NOISE_M**2 + prior @ off)
    if share < ENOUGH_SHARE:
        return None
    side = cmath.rect(1.0, pose.yaw_rad) * 1j
    spread = np.linalg.inv(information + np.diag((1.0, 1.0, 1.0)))
    way = np.array((side.real, side.imag))
    sure = math.sqrt(way @ spread[:2, :2] @ way) < SURE_M and math.sqrt(spread[2, 2]) < SURE_RAD
    x_m, y_m, yaw_rad = off.tolist()
    return guess.at_m.real + x_m, guess.at_m.imag + y_m, guess.yaw_rad + yaw_rad, bool(sure)


def _prior(yaw_rad: float, drift: tuple[float, float, float]) -> Floats:
    """Return the information (3, 3) of the guess, for that heading."""
    ahead = np.array((math.cos(yaw_rad), math.sin(yaw_rad)))
    across = np.array((-ahead[1], ahead[0]))
    prior = np.diag((0.0, 0.0, drift[2] ** -2))
    prior[:2, :2] = np.outer(ahead, ahead) / drift[0] ** 2 + np.outer(across, across) / drift[1] ** 2
    return prior


def _pair(
    points: Places, surfaces: Surfaces, pose: ScanPose, view: View, gate_m: float
) -> tuple[npt.NDArray[np.float64], Floats, float] | None:
    """Return the slopes (n, 3) and distances (n,) of the points that fit their line, and their share; None: too few."""
    turned = points * cmath.rect(1.0, pose.yaw_rad)
    there = turned + pose.at_m
    beam = np.rint((np.angle(there - view.lidar_m) - view.scan.angle_min_rad) / view.scan.angle_step_rad)
    index = beam.astype(np.intp)
    index[(index < 0) | (index >= surfaces.flat.size)] = 0
    has_line = surfaces.flat[index] & (index > 0)
    index, there, turned = index[has_line], there[has_line], turned[has_line]
    normal = surfaces.normals[index]
    apart = (there - surfaces.points_m[index]) * normal.conj()
    near = (np.abs(apart.real) < gate_m) & (np.abs(apart.imag) < ALONG_M)
    count = int(np.count_nonzero(near))
    if count < ENOUGH_POINTS:
        return None
    normal, turned = normal[near], turned[near]
    slopes = np.stack((normal.real, normal.imag, (1j * turned * normal.conj()).real), axis=1)
    return slopes, apart.real[near], count / index.size
