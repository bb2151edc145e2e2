"""Scan-matching odometry of a car, from its scans alone.

Each scan is laid over a key scan, one at most 0.2 m or 9 degrees back, by point-to-line matching with projective
association: a point is compared with the key's surface at its own bearing (Blais and Levine 1995; Censi 2008, PLICP).
Chaining keys instead of neighbours keeps noise from adding up: a standing car of 15 s ends within 1 cm and 0.1 degrees
of where it began, and while a car drives straight at a wall the way agrees with the range to it to 0.2 %.
"""

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from wallride.drivers.accelerated import accelerated
from wallride.runtime.control.perception.geometry import Booleans, Floats, directions

KEY_EVERY_M, KEY_EVERY_RAD = 0.2, 0.15
HOLE_S = 0.5
"""Maximum gap between scans; after a longer one the car's place is unknown and a new chain begins."""
MAX_GAP_S, MAX_GAP_PERIODS = 0.15, 2.5
"""Gap between two scans or reports over which no motion is told, and of a slow lidar in its periods."""
MIN_RANGE_M = 0.2
"""Minimum range; nearer returns are the car itself."""
NORMAL_BEAMS = 3
"""Limits over +-3 beams within which a surface is straight and has a normal: width per range, bend."""
MAX_SHARE, MAX_WIDTH_M, STRAIGHT_M = 0.3, 0.08, 0.04
GATES_M = (0.3, 0.3, 0.3, 0.1)
"""Association gates per iteration, distance of a point to a surface; the last holds for all further ones."""
SAME_PLACE_M = 0.4
HUBER_M = 0.02
ROUNDS = 10
ENOUGH_M = 1e-4
GUESS_WEIGHT = 5.0
"""Weight of the initial guess in points: it decides only along a corridor without a single door."""
SPEED_MEMORY = 0.6
HALF_WINDOW = 4
"""Half window of the speed estimate: +-4 scans, 0.2 s."""
STANDS_WITHIN_M = 0.1


@dataclass(frozen=True, slots=True, eq=False)
class ScanMotion:
    """All (n,), one row per scan: position and heading of the lidar since the first scan, and its speeds.

    speed_mps: along the car, signed; 0 where a gap or jumping stamps leave no data.
    """

    x_m: Floats
    y_m: Floats
    yaw_rad: Floats
    speed_mps: Floats
    yaw_rate_radps: Floats

    @property
    def way_m(self) -> Floats:
        """Return the way driven since the first scan, (n,); signed speeds do not cancel out."""
        steps_m = np.hypot(np.diff(self.x_m), np.diff(self.y_m))
        moving = np.abs(self.speed_mps[1:]) > 0.05  # else noise counts as way
        return np.concatenate(([0.0], np.cumsum(np.where(moving, steps_m, 0.0))))

    @property
    def stands(self) -> bool:
        """Return whether the car never left its place."""
        return bool(np.hypot(self.x_m - self.x_m[0], self.y_m - self.y_m[0]).max() < STANDS_WITHIN_M)


@dataclass(frozen=True, slots=True, eq=False)
class ReferenceScan:
    """Reference scan of the matching: its points and the normals of its surfaces, (2, beams), where it has any."""

    points_m: Floats
    normals: Floats
    usable: Booleans


Shift = tuple[float, float, float]
Kind = tuple[float, float, int]
"""One kind of lidar: first bearing [rad], step [rad], beams."""
STILL: Shift = (0.0, 0.0, 0.0)


class ScanChain:
    """Lays each scan over the key before it. poses: of the lidar since the first scan, one for each scan taken."""

    def __init__(self, kind: Kind, range_max_m: float) -> None:
        self.poses: list[Shift] = []
        self._kind, self._rays, self._range_max_m = kind, directions(*kind), range_max_m
        self._stamp_s = -math.inf
        self._key = ReferenceScan(np.empty((2, 0)), np.empty((2, 0)), np.empty(0, bool))
        self._at, self._moved, self._speeds = STILL, STILL, np.zeros(3)

    def take(self, stamp_s: float, sent_m: npt.NDArray[np.floating[Any]]) -> Shift:
        """Return the pose of one scan, in order. sent_m: (beams,), NaN where nothing returns."""
        ranges_m = sent_m.astype(np.float64)
        ranges_m[~((ranges_m >= MIN_RANGE_M) & (ranges_m <= self._range_max_m))] = np.nan
        points_m = self._rays * ranges_m
        elapsed_s, self._stamp_s = stamp_s - self._stamp_s, stamp_s
        if not 0.0 < elapsed_s < HOLE_S:
            self._at = self.poses[-1] if self.poses else STILL
            self._key, self._moved, self._speeds = _key(points_m, ranges_m), STILL, np.zeros(3)
            self.poses.append(self._at)
            return self._at
        before = np.array(self._moved)
        now, _ = lay_over(self._key, points_m, before + self._speeds * elapsed_s, self._kind)
        self._speeds = SPEED_MEMORY * self._speeds + (1 - SPEED_MEMORY) * (now - before) / elapsed_s
        self._moved = moved = (float(now[0]), float(now[1]), float(now[2]))
        self.poses.append(_after(self._at, moved))
        if math.hypot(moved[0], moved[1]) > KEY_EVERY_M or abs(moved[2]) > KEY_EVERY_RAD:
            self._take_key(_key(points_m, ranges_m))
        return self.poses[-1]

    def _take_key(self, key: ReferenceScan) -> None:
        """Count from the newest scan on."""
        cos, sin = math.cos(self._moved[2]), math.sin(self._moved[2])
        x, y, turn = self._speeds
        self._key, self._at, self._moved = key, self.poses[-1], STILL
        self._speeds = np.array([cos * x + sin * y, cos * y - sin * x, turn])


def motion_of_scans(
    stamps_s: Floats, sent_m: npt.NDArray[np.floating[Any]], kind: Kind, range_max_m: float
) -> ScanMotion:
    """Return the motion of a lidar by its scans. stamps_s: (n,). sent_m: (n, beams), NaN where nothing returns."""
    chain = ScanChain(kind, range_max_m)
    for stamp_s, ranges_m in zip(stamps_s, sent_m, strict=True):
        chain.take(float(stamp_s), ranges_m)
    return _with_speeds(np.array(chain.poses), stamps_s)


def follow_each_other(elapsed_s: Floats) -> Booleans:
    """Return which of the times between scans lack at most a few of them, (n,)."""
    gap_s = max(MAX_GAP_S, MAX_GAP_PERIODS * float(np.median(elapsed_s))) if elapsed_s.size else MAX_GAP_S
    return (elapsed_s > 0.0) & (elapsed_s < gap_s)


def _after(at: Shift, moved: Shift) -> Shift:
    cos, sin = math.cos(at[2]), math.sin(at[2])
    return at[0] + cos * moved[0] - sin * moved[1], at[1] + sin * moved[0] + cos * moved[1], at[2] + moved[2]


def _key(points_m: Floats, ranges_m: Floats) -> ReferenceScan:
    along = np.full_like(points_m, np.nan)
    reach = NORMAL_BEAMS
    first, last, middle = points_m[:, : -2 * reach], points_m[:, 2 * reach :], points_m[:, reach:-reach]
    along[:, reach:-reach] = last - first
    width_m = np.hypot(along[0], along[1])
    normals = np.stack([-along[1], along[0]]) / np.where(width_m > 0, width_m, np.nan)
    bend_m = np.full(ranges_m.size, np.nan)
    bend_m[reach:-reach] = np.abs(np.sum(normals[:, reach:-reach] * (middle - (first + last) / 2), axis=0))
    usable = (width_m < np.maximum(MAX_SHARE * ranges_m, MAX_WIDTH_M)) & (bend_m < STRAIGHT_M)  # False for NaN
    return ReferenceScan(points_m, normals, usable)


def _flat_laid(
    key: ReferenceScan, points_m: Floats, guess: Floats, kind: Kind, guess_weight: float = GUESS_WEIGHT
) -> tuple[Any, ...]:
    return (*points_m, *key.points_m, *key.normals, key.usable, *kind[:2], *guess.tolist(), guess_weight)


@accelerated(flat=_flat_laid)
def lay_over(
    key: ReferenceScan, points_m: Floats, guess: Floats, kind: Kind, guess_weight: float = GUESS_WEIGHT
) -> tuple[Floats, Floats]:
    """Return the shift (x, y, yaw) that aligns points (2, n) with the key's surfaces, and its information, (3, 3).

    Least squares over n . (R q + t - p), Huber weights, Gauss-Newton. The information is the inverse covariance for
    distances of 1 m of standard deviation; guess_weight is not in it.
    """
    shift, information = guess.copy(), np.zeros((3, 3))
    for turn in range(ROUNDS):
        slopes, off_m = _pair(key, points_m, shift, kind, GATES_M[min(turn, len(GATES_M) - 1)])
        weighted = slopes / np.maximum(1.0, np.abs(off_m) / HUBER_M)
        information = weighted @ slopes.T
        matrix = information + guess_weight * np.eye(3)
        step = np.linalg.solve(matrix, -weighted @ off_m + guess_weight * (guess - shift))
        shift = shift + step
        if np.abs(step).max() < ENOUGH_M:
            break
    return shift, information


def _pair(key: ReferenceScan, points_m: Floats, shift: Floats, kind: Kind, gate_m: float) -> tuple[Floats, Floats]:
    """Return slopes (3, n) and distances (n,) of the points near a surface that the key has in their directions."""
    cos, sin = math.cos(shift[2]), math.sin(shift[2])
    arm_x, arm_y = cos * points_m[0] - sin * points_m[1], sin * points_m[0] + cos * points_m[1]
    x_m, y_m = arm_x + shift[0], arm_y + shift[1]
    with np.errstate(invalid="ignore"):
        index = np.nan_to_num(np.rint((np.arctan2(y_m, x_m) - kind[0]) / kind[1]), nan=-1.0).astype(np.intp)
    good = (index >= 0) & (index < key.usable.size)
    index[~good] = 0
    dx, dy = x_m - key.points_m[0, index], y_m - key.points_m[1, index]
    nx, ny = key.normals[:, index]
    off_m = nx * dx + ny * dy
    good &= key.usable[index] & (np.hypot(dx, dy) < SAME_PLACE_M) & (np.abs(off_m) < gate_m)
    return np.stack([nx, ny, ny * arm_x - nx * arm_y])[:, good], off_m[good]


def _with_speeds(poses: Floats, stamps_s: Floats) -> ScanMotion:
    count = len(poses)
    speed_mps, turning_radps = np.zeros(count), np.zeros(count)
    holes = np.concatenate(([0], np.cumsum(~((np.diff(stamps_s) > 0) & (np.diff(stamps_s) < HOLE_S)))))
    for scan in range(count):
        same = np.flatnonzero(holes[max(0, scan - HALF_WINDOW) : scan + HALF_WINDOW + 1] == holes[scan])
        first, last = (max(0, scan - HALF_WINDOW) + int(same[end]) for end in (0, -1))
        elapsed_s = stamps_s[last] - stamps_s[first]
        if elapsed_s <= 0:
            continue
        dx, dy, turned_rad = poses[last] - poses[first]
        speed_mps[scan] = (math.cos(poses[scan, 2]) * dx + math.sin(poses[scan, 2]) * dy) / elapsed_s
        turning_radps[scan] = turned_rad / elapsed_s
    return ScanMotion(poses[:, 0], poses[:, 1], poses[:, 2], speed_mps, turning_radps)
