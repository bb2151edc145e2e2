"""Moving obstacles: small clusters are tracked in the odometry frame, and their predicted places count as occupied.

A person crossing at 1.5 m/s is not in the path until it is too late, and one approaching the car occupies the distance
that it needs to stop. `obstacle_track` decides what moves, by odometry that scans correct (`perception.motion`): so
what crosses slowly is told from an error of the heading. The object's points, extrapolated along its motion for the
next moments, are added to the points that the safety sweeps.
"""

import cmath
from collections.abc import Callable

import numpy as np

from wallride.drivers.accelerated import accelerated
from wallride.runtime.control.perception.geometry import NOWHERE, Booleans, Floats, Places, places_m
from wallride.runtime.control.perception.motion.own_motion import OwnMotion
from wallride.runtime.control.perception.obstacles.obstacle_track import (
    MAX_SPEED_MPS,
    NARROW_WIDTH_M,
    MotionBounds,
    ObstacleTrack,
    ScanLook,
)
from wallride.runtime.control.perception.odometry import OdometryState
from wallride.runtime.control.perception.view import View

WITHIN_M = 6.0
GAP_BEAMS = 3
JUMP_M = 0.2
BACKGROUND_BEAMS = 40
MIN_BEAMS = 4
MAX_THINGS = 30
"""Maximum number of objects that are followed, the nearest ones: each is compared with each track."""
MAX_WIDTH_M = 1.3
MATCH_M, MAX_MOVE_M = 0.15, 0.35
"""Association gate: maximum distance from the predicted place, in addition to the motion of a runner between the scans;
and its absolute maximum."""
MOVED_M, SEEN_SCANS = 0.2, 8
"""Minimum way and number of scans that show a motion."""
SLOW_SEEN_SCANS, SLOW_S = 4, 0.03
"""The same number for a lidar for which the next scan is waited for that much longer: what moves goes farther from scan
to scan, and eight of them take a second."""
MIN_SPEED_MPS = 0.4
MIN_SPEED_SHARE = 0.15
"""Share of the car's own speed that is added: a trimmed or drifting car turns by more than its steering indicates."""
TURNING_SHARE = 0.3
"""Share of the car's own yaw rate, now and half a second ago, times the distance, that is added: the servo lags behind
the odometry."""
TURNING_FADES = 0.95
SURE_MOVED_M, SURE_SEEN_SCANS = 0.1, 6
SURE_SPEED_MPS, SURE_SPEED_SHARE, SURE_TURNING_SHARE = 0.2, 0.03, 0.04
"""The same for a motion aside while scan matching corrects the odometry."""
SURE_SLIP_S2PM = 0.005
"""Speed aside that is added then, by turn x speed^2: near their grip the tyres slip by other than the usual 0.023."""
AHEAD_S = (0.15, 0.3, 0.45, 0.6, 0.75, 0.9)
STOOD_S = 1.5
"""Time for which a car has to stand until no place from which a motion is measured is of its own drive."""
FORGOTTEN_S = 0.15
"""Maximum time out of sight with a lidar of 40 Hz."""
CARRIED_S = 0.7
"""The same for an object that moves and goes out of sight: behind a pillar, or beside the shoulder."""
HOLE_RAD = 0.03
"""Widest hole in an object for a slow lidar: cells of a turn that got no sample. 9 cm at 3 m."""
CARRIED_POINTS = np.linspace(0.0, 1.0, 6)


Motion = Callable[[], OwnMotion]


class MovingObstacles:
    """Holds the tracks of moving obstacles. Call `update` once per scan.

    any_moves: whether one was seen to move at the last update.
    """

    def __init__(self) -> None:
        self._tracks: list[ObstacleTrack] = []
        self._turning_radps = 0.0
        self._sure = False
        self.any_moves = False
        self._look: ScanLook | None = None

    def update(
        self, view: View, pose: OdometryState, stamp_s: float, told: Motion | None = None, *, sliding: bool = False
    ) -> Places:
        """Return the predicted places, (k,) in base_link, of moving obstacles in the next 0.9 s; k = 0 without any.

        told: returns the motion as scans correct it, asked where there is a thing; without it the pose counts.
        sliding: the wheels are locked, so that the odometry stands still while everything comes nearer: velocities are
        neither updated nor forgotten, and what moved before still does.
        """
        self._turning_radps = max(abs(pose.yaw_rate_radps), TURNING_FADES * self._turning_radps)
        self.any_moves, self._sure, self._look = False, False, None
        slow, step_rad = view.waits_s > SLOW_S, abs(view.scan.angle_step_rad)
        bridged = _bridged(view.solid, view.ranges_m, step_rad) if slow else (view.solid, view.ranges_m)
        things = find_small_clusters(*bridged, step_rad)
        if not things and not self._tracks:
            return NOWHERE  # the usual case
        if len(things) > MAX_THINGS:
            things = sorted(things, key=lambda thing: float(view.ranges_m[thing[0]]))[:MAX_THINGS]
        look = self._look_from(view, pose, told)
        bounds = self._bounds(abs(pose.speed_mps), slow=slow)
        fresh: list[ObstacleTrack] = []
        strips: list[Places] = []
        for first, last in things:
            beams = view.solid[first : last + 1].nonzero()[0] + first
            points = places_m(view.x_m, view.y_m, beams)
            track = self._follow(points * look.turned + look.at_m, stamp_s, look, sliding=sliding)
            fresh.append(track)
            if not sliding:
                track.judge(look, float(view.ranges_m[first]), bounds)
            if track.moves:
                velocity_mps = track.velocity_mps * look.turned.conjugate()
                strips += [points + velocity_mps * ahead_s for ahead_s in AHEAD_S]
        hidden = [track for track in self._tracks if track.moves and stamp_s - track.seen_s <= CARRIED_S]
        for track in hidden:
            strips += _carried(track, stamp_s, look)
        forgotten_s = FORGOTTEN_S + view.waits_s
        self._tracks = fresh + [
            track for track in self._tracks if stamp_s - track.seen_s <= (CARRIED_S if track.moves else forgotten_s)
        ]
        self.any_moves, self._look = bool(strips), look
        return np.concatenate(strips) if strips else NOWHERE

    def _look_from(self, view: View, pose: OdometryState, told: Motion | None) -> ScanLook:
        if told is None:
            return ScanLook(view, complex(pose.x_m, pose.y_m), cmath.rect(1.0, pose.yaw_rad))
        motion = told()
        self._sure = motion.sure
        return ScanLook(view, motion.rolled.at_m, cmath.rect(1.0, motion.rolled.yaw_rad))

    def moving(self, *, stood: bool) -> list[ObstacleTrack]:
        """Return the tracks seen at the last update of what moves; stood: the car has not moved for STOOD_S.

        What goes away from the car is told from the odometry's errors only by a car that stands.
        """
        look = self._look
        if look is None:
            return []
        now_s = look.view.scan.stamp_s
        seen = [track for track in self._tracks if track.seen_s == now_s]
        return [track for track in seen if track.moves or (stood and track.goes(look, MIN_SPEED_MPS, MOVED_M))]

    def _bounds(self, speed_mps: float, *, slow: bool) -> MotionBounds:
        """Return what a track must exceed at this speed of the car. slow: the lidar is."""
        scans, soon_scans = (SLOW_SEEN_SCANS, SLOW_SEEN_SCANS) if slow else (SEEN_SCANS, SURE_SEEN_SCANS)
        toward_mps, shown = MIN_SPEED_MPS + MIN_SPEED_SHARE * speed_mps, (MOVED_M, scans)
        if not self._sure:
            turning_per_s = TURNING_SHARE * self._turning_radps
            return MotionBounds(toward_mps, toward_mps, turning_per_s, shown, shown, NARROW_WIDTH_M)
        aside_mps = SURE_SPEED_MPS + SURE_SPEED_SHARE * speed_mps + SURE_SLIP_S2PM * self._turning_radps * speed_mps**2
        turning_per_s = SURE_TURNING_SHARE * self._turning_radps
        return MotionBounds(toward_mps, aside_mps, turning_per_s, shown, (SURE_MOVED_M, soon_scans), MAX_WIDTH_M)

    def _follow(self, points_m: Places, stamp_s: float, look: ScanLook, *, sliding: bool) -> ObstacleTrack:
        """Return the track associated with these points (k,), odom, removed from the list, or a new one."""
        place_m = complex(points_m.sum()) / points_m.size
        edges_m = complex(points_m[0]), complex(points_m[-1])
        nearest, nearest_m = None, MAX_MOVE_M
        for track in self._tracks:
            elapsed_s = stamp_s - track.seen_s
            if elapsed_s > FORGOTTEN_S + look.view.waits_s:  # a gap in the scans: tracks cannot be associated
                continue
            off_m = abs(track.place_m + track.velocity_mps * elapsed_s - place_m)
            if off_m < min(nearest_m, MATCH_M + MAX_SPEED_MPS * elapsed_s):
                nearest, nearest_m = track, off_m
        if nearest is None:
            return ObstacleTrack.begin(place_m, edges_m, stamp_s, look)
        self._tracks.remove(nearest)
        if sliding:
            nearest.carry(place_m, edges_m, stamp_s)
        else:
            nearest.add(place_m, edges_m, stamp_s, look)
        return nearest


def _carried(track: ObstacleTrack, stamp_s: float, look: ScanLook) -> list[Places]:
    """Return the present and the next places, base_link, of an object that went out of sight; none where it is not."""
    right_m, left_m = track.newest_m
    points_m = right_m + (left_m - right_m) * CARRIED_POINTS + track.velocity_mps * (stamp_s - track.seen_s)
    middle_m = complex(points_m.mean())
    if look.is_in_view(middle_m) and look.is_free(middle_m):
        return []
    velocity_mps = track.velocity_mps * look.turned.conjugate()
    points_m = (points_m - look.at_m) * look.turned.conjugate()
    return [np.asarray(points_m + velocity_mps * ahead_s, complex) for ahead_s in (0.0, *AHEAD_S)]


def _bridged(solid: Booleans, ranges_m: Floats, step_rad: float) -> tuple[Booleans, Floats]:
    """Return both, with the holes filled between returns of one distance.

    A hole cuts an object into two beside each other, neither of which stands out.
    """
    index = solid.nonzero()[0]
    near_m = ranges_m.take(index)
    beams, off_m = np.diff(index), np.abs(np.diff(near_m))
    holes = ((beams > GAP_BEAMS) & (beams <= HOLE_RAD / step_rad) & (off_m <= JUMP_M)).nonzero()[0]
    if not holes.size:
        return solid, ranges_m
    solid, ranges_m = solid.copy(), ranges_m.copy()
    for hole in holes.tolist():
        inside = slice(index[hole] + 1, index[hole + 1])
        solid[inside], ranges_m[inside] = True, near_m[hole]
    return solid, ranges_m


@accelerated
def find_small_clusters(solid: Booleans, ranges_m: Floats, step_rad: float) -> list[tuple[int, int]]:
    """Return (first, last) beam of every near object at most MAX_WIDTH_M wide that stands out from its surroundings.

    solid, ranges_m: (beams,) of a View. step_rad: between two beams, positive.
    """
    index = (solid & (ranges_m < WITHIN_M)).nonzero()[0]
    if index.size < MIN_BEAMS:
        return []
    near_m = ranges_m.take(index)
    off_m = near_m[1:] - near_m[:-1]
    cut = np.abs(off_m, out=off_m) > JUMP_M
    cut |= index[1:] - index[:-1] > GAP_BEAMS
    ends = [*cut.nonzero()[0].tolist(), index.size - 1]
    things, start = [], 0
    for end in ends:
        if end - start >= MIN_BEAMS - 1:
            right, left = int(index[start]), int(index[end])
            if (left - right) * step_rad * near_m[start] <= MAX_WIDTH_M and _stands_out(solid, ranges_m, right, left):
                things.append((right, left))
        start = end + 1
    return things


def _stands_out(solid: Booleans, ranges_m: Floats, right: int, left: int) -> bool:
    """Return whether the things at both sides are farther away, and there are both sides."""
    to_the_right = range(right - 1, right - 1 - BACKGROUND_BEAMS, -1)
    to_the_left = range(left + 1, left + 1 + BACKGROUND_BEAMS)
    return _behind(solid, ranges_m, to_the_right, ranges_m[right]) and _behind(
        solid, ranges_m, to_the_left, ranges_m[left]
    )


def _behind(solid: Booleans, ranges_m: Floats, beams: range, range_m: float) -> bool:
    """Return whether the first solid one of the next beams is clearly farther away.

    Dirt and outliers are skipped: they cut walls into pieces whose edges move with the car. Where no beam is solid,
    silence counts as far.
    """
    for beam in beams:
        if not 0 <= beam < solid.size:
            return False
        if solid[beam]:
            return bool(ranges_m[beam] > range_m + JUMP_M)
    return True
