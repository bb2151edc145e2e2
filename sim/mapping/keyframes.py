"""Keyframes: the scans of a drive at even distances, as the lidar would have seen them standing still."""

import math
from dataclasses import dataclass
from typing import Final

import numpy as np
import numpy.typing as npt

from wallride.runtime.calibration.scan_motion import Kind, ReferenceScan
from wallride.runtime.calibration.stop_match import surfaces, window_sums
from wallride.runtime.control.perception.geometry import Booleans, beam_ages_s, directions
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
AT_ONCE: Final = 32
"""Scans at a time, so that their points stay in the processor's cache."""

Numbers = npt.NDArray[np.intp]


@dataclass(frozen=True, slots=True, eq=False)
class Keyframe:
    """A scan in the frame of the lidar at the time of its last beam.

    odometry: (3,), that pose by odometry. points_m: (2, beams), NaN without. surface: lines through them.
    """

    time_s: float
    odometry: Floats
    points_m: Floats
    surface: ReferenceScan


def keyframes(record: LapRecord, path: LidarPath) -> list[Keyframe]:
    """Return a keyframe each EVERY_M or EVERY_RAD of a drive, beginning with its first scan."""
    poses = path.at(record.scan_s)
    chosen, last = [0], poses[0]
    for number, pose in enumerate(poses):
        if math.hypot(*(pose - last)[:2]) >= EVERY_M or abs(pose[2] - last[2]) >= EVERY_RAD:
            chosen.append(number)
            last = pose
    found: list[Keyframe] = []
    for first in range(0, len(chosen), AT_ONCE):
        found += _keyframes(record, path, np.array(chosen[first : first + AT_ONCE]), poses)
    return found


def swept_m(
    record: LapRecord, path: LidarPath, scans: Numbers, beams: Numbers, frames: Floats
) -> tuple[Floats, Floats]:
    """Return ends of beams, and whence they were sent, (2, n, beams) each, in frames (n, 3), one of each scan."""
    ahead = np.array(directions(*record.kind))[:, beams]
    times_s = record.scan_s[scans, None] - beam_ages_s(record.ray_s, record.kind[2], beams.astype(np.float64))
    from_poses = path.at(times_s.ravel()).reshape(*times_s.shape, 3)
    return in_one_moment(ahead[:, None] * record.ranges_m[np.ix_(scans, beams)], frames, from_poses)


def in_one_moment(points_m: Floats, frames: Floats, beam_poses: Floats) -> tuple[Floats, Floats]:
    """Return points (2, n, beams), seen from a pose each (n, beams, 3), and the places of these, in frames (n, 3)."""
    cos, sin = np.cos(frames[:, 2, None]), np.sin(frames[:, 2, None])
    dx, dy = (beam_poses[..., axis] - frames[:, axis, None] for axis in (0, 1))
    turn_rad = beam_poses[..., 2] - frames[:, 2, None]
    places_m = np.stack([cos * dx + sin * dy, cos * dy - sin * dx])
    cos, sin = np.cos(turn_rad), np.sin(turn_rad)
    turned_m = np.stack([cos * points_m[0] - sin * points_m[1], sin * points_m[0] + cos * points_m[1]])
    return turned_m + places_m, places_m


def trusted_ranges_m(told_m: npt.NDArray[np.float32]) -> npt.NDArray[np.float32]:
    """Return the ranges of scans, (n, beams), NaN where a beam has none or does not agree with its neighbours."""
    ranges_m = np.where((told_m > MIN_RANGE_M) & (told_m < MAX_RANGE_M), told_m, np.float32(np.nan))
    for first in range(0, len(ranges_m), AT_ONCE):
        part = ranges_m[first : first + AT_ONCE]
        part[~_trusted(part)] = np.nan
    return ranges_m


def _keyframes(record: LapRecord, path: LidarPath, scans: Numbers, poses: Floats) -> list[Keyframe]:
    places_m, _ = swept_m(record, path, scans, np.arange(record.kind[2]), poses[scans])
    points_m = _by_bearing(places_m, record.kind)
    step_rad = record.kind[1]
    wide, narrow = (_lines(points_m, max(2, round(one / abs(step_rad))), step_rad) for one in SURFACE_RAD)
    middles_m = np.where(wide.usable, wide.points_m, narrow.points_m)
    normals = np.where(wide.usable, wide.normals, narrow.normals)
    # Not the windows' middles, which lie farther along a wall than their beams: that made ways 0.3 % too long.
    on_lines_m = points_m - normals * np.sum(normals * (points_m - middles_m), axis=0)
    usable = wide.usable | narrow.usable
    return [
        Keyframe(
            float(record.scan_s[scan]), poses[scan], points_m[:, at],
            ReferenceScan(on_lines_m[:, at], normals[:, at], usable[at]),
        )
        for at, scan in enumerate(scans)
    ]  # fmt: skip


def _lines(points_m: Floats, reach: int, step_rad: float) -> ReferenceScan:
    """Return the lines through neighbours that are not parted by a gap.

    Behind a step of a wall lies a shadow, and a line across it moves with the car: that made ways 0.4 % too long.
    """
    found = surfaces(points_m, reach, MAX_BEND_M)
    range_m = np.hypot(points_m[0], points_m[1])
    with np.errstate(invalid="ignore", divide="ignore"):
        facing = np.maximum(np.abs(np.sum(found.normals * points_m, axis=0)) / range_m, LEAST_FACING)
        gap_m = np.hypot(*np.diff(points_m, axis=-1, append=np.nan))
        parted = gap_m > GAP_NOISE_M + GAP_TIMES * range_m * abs(step_rad) / facing
        ends_m = np.full_like(points_m, np.nan)
        ends_m[..., reach:-reach] = points_m[..., 2 * reach :] - points_m[..., : -2 * reach]
        wide = np.hypot(ends_m[0], ends_m[1]) > MIN_WIDTH_M
    whole = window_sums(parted.astype(np.float64), reach) < 0.5
    return ReferenceScan(found.points_m, found.normals, found.usable & whole & wide)


def _trusted(ranges_m: npt.NDArray[np.float32]) -> Booleans:
    """Return which beams of scans agree with two of their four neighbours: others see an edge, or nothing real."""
    limit_m, beams = AGREES_M + AGREES_SHARE * ranges_m, ranges_m.shape[1]
    agreeing = np.zeros(ranges_m.shape, dtype=np.int8)
    padded = np.pad(ranges_m, ((0, 0), (2, 2)), constant_values=np.nan)
    for shift in (0, 1, 3, 4):
        agreeing += np.abs(padded[:, shift : shift + beams] - ranges_m) < limit_m
    trusted: Booleans = agreeing >= 2
    return trusted


def _by_bearing(points_m: Floats, kind: Kind) -> Floats:
    """Return points (2, n, beams) in the places of their bearings: a turning lidar has moved them by some beams."""
    first_rad, step_rad, beams = kind
    scan, beam = np.nonzero(np.isfinite(points_m[0]))
    known = points_m[:, scan, beam]
    place = np.rint((np.arctan2(known[1], known[0]) - first_rad) / step_rad).astype(np.intp)
    inside = (place >= 0) & (place < beams)
    placed = np.full(points_m.shape, np.nan)
    placed[:, scan[inside], place[inside]] = known[:, inside]
    return placed
