"""Who walks: small things that stand out are tracked in the odometry frame, and where they are going is taken as full.

A person who crosses at 1.5 m/s is not in the way until it is too late. The track is an alpha-beta filter (Kalata 1984)
on the middle of the thing's visible side; a thing counts as walking when it has moved faster than odometry can err, for
long enough, with both of its edges: of a wall's end that comes into view only one edge moves. Its points, moved on
along its way for the next moments, are added to what the safety sweeps.
"""

import math
from dataclasses import dataclass

import numpy as np

from runtime.control.geometry import Floats
from runtime.control.odometry import Pose
from runtime.control.perception import View

WITHIN_M = 3.5
GAP_BEAMS = 3
JUMP_M = 0.2
BACKGROUND_BEAMS = 40
FEWEST_BEAMS = 4
WIDEST_M = 0.7
MATCH_M = 0.35
POSITION_GAIN = 0.4
SPEED_GAIN = 0.08
SEEN_SCANS = 8
MOVED_M = 0.2
SLOWEST_MPS = 0.4
SLOWEST_SHARE = 0.15
"""Of the car's own speed: a trimmed or drifting car turns by more than its steering says."""
TURNING_SHARE = 0.3
"""Of the car's own turning, now and half a second ago, times the distance: the servo lags behind the odometry."""
TURNING_FADES = 0.95
FASTEST_MPS = 3.0
AHEAD_S = (0.15, 0.3, 0.45, 0.6, 0.75, 0.9)
FORGOTTEN_S = 0.15


@dataclass(slots=True)
class _Track:
    """A thing in the odometry frame: middle, speed, edges (2, xy) now and at first, how often and when last seen."""

    x_m: float
    y_m: float
    x_mps: float
    y_mps: float
    edges_m: Floats
    from_m: Floats
    scans: int
    seen_s: float


class Movers:
    """Small state: the tracks. `update` once per scan."""

    def __init__(self) -> None:
        self._tracks: list[_Track] = []
        self._turning_radps = 0.0

    def update(self, view: View, pose: Pose, stamp_s: float) -> Floats:
        """Return points, (2, k) in base_link, where walkers will be in the next 0.9 s; k = 0 for nobody."""
        cos, sin = math.cos(pose.yaw_rad), math.sin(pose.yaw_rad)
        turn, at_m = np.array([[cos, -sin], [sin, cos]]), np.array([[pose.x_m], [pose.y_m]])
        fresh: list[_Track] = []
        strips: list[Floats] = []
        slowest_mps = SLOWEST_MPS + SLOWEST_SHARE * abs(pose.speed_mps)
        self._turning_radps = max(abs(pose.yaw_rate_radps), TURNING_FADES * self._turning_radps)
        slowest_per_m = TURNING_SHARE * self._turning_radps
        for first, last in small_things(view):
            points = np.stack([view.x_m[first : last + 1], view.y_m[first : last + 1]])
            points = points[:, view.solid[first : last + 1]]
            track = self._follow(turn @ points + at_m, stamp_s)
            fresh.append(track)
            if _walks(track, turn[:, 1], slowest_mps + slowest_per_m * float(view.ranges_m[first])):
                way_mps = turn.T @ np.array([[track.x_mps], [track.y_mps]])
                strips += [points + way_mps * ahead_s for ahead_s in AHEAD_S]
        self._tracks = fresh + [track for track in self._tracks if stamp_s - track.seen_s <= FORGOTTEN_S]
        return np.hstack(strips) if strips else np.empty((2, 0))

    def _follow(self, points_m: Floats, stamp_s: float) -> _Track:
        """Return the track that these points (2, k), odom, continue, taken from the list, or a new one."""
        x_m, y_m = (points_m.sum(axis=1) / points_m.shape[1]).tolist()
        edges_m = points_m[:, [0, -1]].T
        nearest, nearest_m = None, MATCH_M
        for track in self._tracks:
            elapsed_s = stamp_s - track.seen_s
            if elapsed_s > FORGOTTEN_S:  # a hole in the scans: nobody can tell who is who
                continue
            off_m = math.hypot(track.x_m + track.x_mps * elapsed_s - x_m, track.y_m + track.y_mps * elapsed_s - y_m)
            if off_m < nearest_m:
                nearest, nearest_m = track, off_m
        if nearest is None:
            return _Track(x_m, y_m, 0.0, 0.0, edges_m, edges_m, 1, stamp_s)
        self._tracks.remove(nearest)
        elapsed_s = max(1e-3, stamp_s - nearest.seen_s)
        nearest.x_m += nearest.x_mps * elapsed_s
        nearest.y_m += nearest.y_mps * elapsed_s
        off_x, off_y = x_m - nearest.x_m, y_m - nearest.y_m
        nearest.x_m += POSITION_GAIN * off_x
        nearest.y_m += POSITION_GAIN * off_y
        nearest.x_mps += SPEED_GAIN / elapsed_s * off_x
        nearest.y_mps += SPEED_GAIN / elapsed_s * off_y
        nearest.edges_m = nearest.edges_m + POSITION_GAIN * (edges_m - nearest.edges_m)
        nearest.scans += 1
        nearest.seen_s = stamp_s
        return nearest


def small_things(view: View) -> list[tuple[int, int]]:
    """Return (first, last) beam of every near thing at most 0.7 m wide that stands out before its surroundings."""
    index = np.flatnonzero(view.solid & (view.ranges_m < WITHIN_M))
    if index.size < FEWEST_BEAMS:
        return []
    ranges_m = view.ranges_m[index]
    cut = np.flatnonzero((index[1:] - index[:-1] > GAP_BEAMS) | (np.abs(ranges_m[1:] - ranges_m[:-1]) > JUMP_M))
    starts, ends = [0, *(cut + 1).tolist()], [*cut.tolist(), index.size - 1]
    step_rad = abs(view.scan.angle_step_rad)
    things = []
    for start, end in zip(starts, ends, strict=True):
        first, last = int(index[start]), int(index[end])
        width_m = (last - first) * step_rad * ranges_m[start]
        if end - start + 1 < FEWEST_BEAMS or width_m > WIDEST_M or first == 0 or last == view.solid.size - 1:
            continue
        if _behind(view, range(first - 1, first - 1 - BACKGROUND_BEAMS, -1), ranges_m[start]) and _behind(
            view, range(last + 1, last + 1 + BACKGROUND_BEAMS), ranges_m[end]
        ):
            things.append((first, last))
    return things


def _behind(view: View, beams: range, range_m: float) -> bool:
    """Whether the first solid one of the next beams is clearly farther away.

    Dirt and wild beams are skipped: they cut walls into pieces whose edges go along with the car. Where nothing is
    solid, silence counts as far.
    """
    for beam in beams:
        if not 0 <= beam < view.solid.size:
            return False
        if view.solid[beam]:
            return bool(view.ranges_m[beam] > range_m + JUMP_M)
    return True


def _walks(track: _Track, across: Floats, slowest_mps: float) -> bool:
    """Whether it crosses; across is the car's left, odom. Along the car, an error of its own speed looks the same."""
    if track.scans < SEEN_SCANS or math.hypot(track.x_mps, track.y_mps) > FASTEST_MPS:
        return False
    across_mps = float(across @ [track.x_mps, track.y_mps])
    if abs(across_mps) <= slowest_mps:
        return False
    return bool((((track.edges_m - track.from_m) @ across) * math.copysign(1.0, across_mps)).min() > MOVED_M)
