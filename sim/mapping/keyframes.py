"""Keyframes: the scans of a drive at even distances, as the lidar would have seen them standing still."""

import math
from dataclasses import dataclass
from typing import Final

import numpy as np
import numpy.typing as npt

from wallride.runtime.calibration.scan_motion import Kind, ReferenceScan
from wallride.runtime.calibration.stop_match import surfaces
from wallride.runtime.control.perception.geometry import Booleans, directions
from wallride.sim.mapping.lap_record import LapRecord
from wallride.sim.mapping.odometry_path import MAX_RANGE_M, LidarPath
from wallride.sim.world.pose import Floats

EVERY_M: Final = 0.25
EVERY_RAD: Final = 0.15
MIN_RANGE_M: Final = 0.3
SURFACE_RAD: Final = (math.radians(6.0), math.radians(2.0))
"""Halves of the angles under which the line through a point and its neighbours is fitted: the wide one where that is a
line, because noise turns the lines through a few near points, which invents information along a corridor."""
MAX_BEND_M: Final = 0.035
MIN_WIDTH_M: Final = 0.15
"""Least distance of the outer points of a line: the noise of ranges turns shorter ones by 0.1 rad and more."""
GAP_TIMES, GAP_NOISE_M, LEAST_FACING = 2.0, 0.05, 0.05
"""Two neighbours are on one surface up to this multiple of their distance on its line, and the noise of ranges."""
AGREES_M: Final = 0.08
AGREES_SHARE: Final = 0.06
"""Maximum difference of the ranges of neighbours on one surface: a constant, and a share of the range."""
POINTS: Final = 300
"""Approximate number of points of a keyframe that are laid over another one."""


@dataclass(frozen=True, slots=True, eq=False)
class Keyframe:
    """A scan in the frame of the lidar at the time of its last beam.

    odometry: (3,), that pose by odometry; turn_radps: yaw rate there. points_m: (2, beams), NaN without. surface: lines
    through them. middles_m: (2, n), points of surfaces, to be laid over another keyframe.
    """

    time_s: float
    odometry: Floats
    points_m: Floats
    surface: ReferenceScan
    middles_m: Floats


def keyframes(record: LapRecord, path: LidarPath) -> list[Keyframe]:
    """Return a keyframe each EVERY_M or EVERY_RAD of a drive, beginning with its first scan."""
    poses = path.at(record.scan_s)
    ahead = np.array(directions(*record.kind))
    age_s: Floats = record.ray_s * np.arange(record.kind[2] - 1.0, -1.0, -1.0)
    found: list[Keyframe] = []
    last = np.full(3, np.inf)
    for number, pose in enumerate(poses):
        if np.hypot(*(pose[:2] - last[:2])) < EVERY_M and abs(pose[2] - last[2]) < EVERY_RAD:
            continue
        last = pose
        time_s = float(record.scan_s[number])
        points_m = in_one_moment(ahead * trusted_ranges_m(record.ranges_m[number]), pose, path.at(time_s - age_s))
        found.append(_keyframe(time_s, pose, _by_bearing(points_m, record.kind), record.kind))
    return found


def in_one_moment(points_m: Floats, pose: Floats, beam_poses: Floats) -> Floats:
    """Return points (2, n), each seen from a pose of its own (n, 3), as seen from one pose (3,)."""
    turn_rad = beam_poses[:, 2] - pose[2]
    dx, dy = beam_poses[:, 0] - pose[0], beam_poses[:, 1] - pose[1]
    cos, sin = math.cos(pose[2]), math.sin(pose[2])
    x_m = np.cos(turn_rad) * points_m[0] - np.sin(turn_rad) * points_m[1] + cos * dx + sin * dy
    y_m = np.sin(turn_rad) * points_m[0] + np.cos(turn_rad) * points_m[1] + cos * dy - sin * dx
    return np.stack([x_m, y_m])


def trusted_ranges_m(told_m: npt.NDArray[np.float32]) -> Floats:
    """Return the ranges of a scan, (beams,), NaN where a beam has none or does not agree with its neighbours."""
    ranges_m = told_m.astype(np.float64)
    ranges_m[~((ranges_m > MIN_RANGE_M) & (ranges_m < MAX_RANGE_M))] = np.nan
    ranges_m[~_trusted(ranges_m)] = np.nan
    return ranges_m


def _keyframe(time_s: float, pose: Floats, points_m: Floats, kind: Kind) -> Keyframe:
    wide, narrow = (_lines(points_m, max(2, round(one / abs(kind[1]))), kind[1]) for one in SURFACE_RAD)
    middles_m = np.where(wide.usable, wide.points_m, narrow.points_m)
    normals = np.where(wide.usable, wide.normals, narrow.normals)
    # Not the windows' middles, which lie farther along a wall than their beams: that made ways 0.3 % too long.
    on_lines_m = points_m - normals * np.sum(normals * (points_m - middles_m), axis=0)
    surface = ReferenceScan(on_lines_m, normals, wide.usable | narrow.usable)
    known_m = on_lines_m[:, surface.usable]
    every = max(1, known_m.shape[1] // POINTS)
    return Keyframe(time_s, pose, points_m, surface, np.ascontiguousarray(known_m[:, ::every]))


def _lines(points_m: Floats, reach: int, step_rad: float) -> ReferenceScan:
    """Return the lines through neighbours that are not parted by a gap.

    Behind a step of a wall lies a shadow, and a line across it moves with the car: that made ways 0.4 % too long.
    """
    found = surfaces(points_m, reach, MAX_BEND_M)
    range_m = np.hypot(points_m[0], points_m[1])
    with np.errstate(invalid="ignore", divide="ignore"):
        facing = np.maximum(np.abs(np.sum(found.normals * points_m, axis=0)) / range_m, LEAST_FACING)
        gap_m = np.hypot(*np.diff(points_m, axis=1, append=np.nan))
        parted = gap_m > GAP_NOISE_M + GAP_TIMES * range_m * abs(step_rad) / facing
        ends_m = np.full_like(points_m, np.nan)
        ends_m[:, reach:-reach] = points_m[:, 2 * reach :] - points_m[:, : -2 * reach]
        wide = np.hypot(ends_m[0], ends_m[1]) > MIN_WIDTH_M
    whole = np.convolve(parted, np.ones(2 * reach + 1), mode="same") < 0.5
    return ReferenceScan(found.points_m, found.normals, found.usable & whole & wide)


def _trusted(ranges_m: Floats) -> Booleans:
    """Return which beams of a scan agree with two of their four neighbours: others see an edge, or nothing real."""
    limit_m = AGREES_M + AGREES_SHARE * ranges_m
    agreeing = np.zeros(ranges_m.size, dtype=np.int64)
    padded = np.pad(ranges_m, 2, constant_values=np.nan)
    for shift in (0, 1, 3, 4):
        agreeing += np.abs(padded[shift : shift + ranges_m.size] - ranges_m) < limit_m
    trusted: Booleans = agreeing >= 2
    return trusted


def _by_bearing(points_m: Floats, kind: Kind) -> Floats:
    """Return points (2, beams) in the places of their bearings: a turning lidar has moved them by some beams."""
    first_rad, step_rad, beams = kind
    known = points_m[:, np.isfinite(points_m[0])]
    place = np.rint((np.arctan2(known[1], known[0]) - first_rad) / step_rad).astype(np.int64)
    inside = (place >= 0) & (place < beams)
    placed = np.full((2, beams), np.nan)
    placed[:, place[inside]] = known[:, inside]
    return placed
