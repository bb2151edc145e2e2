"""From a drive to the poses of its keyframes: laid over their neighbours, and over those of the lap's beginning.

Two passes, each of which finds the car's errors with the poses; the second has its scans de-skewed by what the first
has found, and closes the ring. Then a bundle adjustment of all scans makes the poses exact.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Final

import numpy as np
from scipy.spatial import cKDTree

from wallride.runtime.calibration.scan_motion import HUBER_M, Kind, lay_over, pair
from wallride.sim.mapping.bundle import adjusted
from wallride.sim.mapping.keyframes import Keyframe, keyframes
from wallride.sim.mapping.lap_record import LapRecord
from wallride.sim.mapping.odometry_path import LearntCar, LidarPath, odometry_path, of_the_axle
from wallride.sim.mapping.pose_graph import ERRORS, Edge, Origin, PoseGraph, between, optimized, placed
from wallride.sim.recordings import RecordingError
from wallride.sim.world.pose import Floats

BACK: Final = (1, 8)
"""A keyframe is laid over these before it."""
NEARER: Final = (2, 3, 4)
"""Before it, where it fits none of those: in a narrow bend few of its points are seen from far."""
POINT_STD_M: Final = 0.03
"""Standard deviation of a point's distance from a surface: neighbours share most of their error, hence so much."""
MATCH_STD: Final = (0.02, 0.004, 0.003)
"""Least standard deviations [m, m, rad] of a match, of neighbours and of the ends of a loop."""
GUESS_WEIGHT: Final = 0.5
FITS_M: Final = 0.1
"""Maximum distance of a point that fits from its surface."""
MIN_POINTS: Final = 40
WEAK_SHARE: Final = 0.04
LOOP_WEAK_SHARE: Final = 0.15
"""Least ratio of the information in the two directions; below it the odometry has the weaker one. A loop's is larger,
because the noise of the normals invents information along a corridor."""
FACES: Final = 0.35
"""Least component of a normal along a direction that counts as information on it: noise turns normals by less."""
MIN_SHARE: Final = 0.4
LOOP_MIN_SHARE: Final = 0.55
LOOP_WAY_M: Final = 8.0
LOOP_TURN_RAD: Final = 0.6
WINDOW_M, WINDOW_SHARE, MAX_WINDOW_M = 0.3, 0.012, 2.0
"""Distance within which two keyframes can be neighbours after a loop: a constant, and a share of the way between."""
SEARCH_STEP_M: Final = 0.3
NEAR_M: Final = 2.0
LOOPS_EACH: Final = 3
STRAIGHT_RADPM: Final = 0.2


@dataclass(frozen=True, slots=True, eq=False)
class ClosedLap:
    """The result of a drive: its keyframes with their poses (n, 3) and all edges with the chi2 of each.

    car: what was learnt of the car's own sensors.
    """

    frames: Sequence[Keyframe]
    poses: Floats
    edges: Sequence[Edge]
    chi2: Floats
    car: LearntCar

    @property
    def loops(self) -> list[Edge]:
        """Return the edges between the lap's end and its beginning."""
        return [edge for edge in self.edges if edge.origin is Origin.LOOP]


def close_lap(record: LapRecord) -> ClosedLap:
    """Return the poses of a drive. RecordingError for a drive of fewer than three keyframes."""
    car, path = LearntCar(), odometry_path(record, LearntCar())
    frames, chain, poses = _chained(record, path, BACK)
    poses, _, errors = optimized(poses, chain)
    if len(record.reports):
        car = _corrected(car, errors, record)
        path = odometry_path(record, car)
    if len(record.gyro) < 2:
        times_s = np.array([frame.time_s for frame in frames])
        path = path.turned(times_s, poses[:, 2] - path.at(times_s)[:, 2])
    frames, chain, poses = _chained(record, path, BACK)
    poses, _, _ = optimized(poses, chain)
    poses, _, _ = optimized(poses, [*chain, *_loops(frames, poses, record.kind, searching=True)])
    times_s = np.array([frame.time_s for frame in frames])
    odometry = [edge for edge in chain if edge.origin is Origin.ODOMETRY]
    poses, errors = adjusted(record, path, times_s, poses, odometry)
    edges = [*chain, *_loops(frames, poses, record.kind, searching=False)]
    chi2 = PoseGraph(edges).errors(poses, errors)[1]
    car = _corrected(car, errors, record)
    if len(record.reports) and len(record.gyro) < 2:
        car = replace(car, trim_rad=_trim_rad(record, times_s, poses))
    return ClosedLap(frames, poses, edges, chi2, car)


def laid_over(
    frames: Sequence[Keyframe], before: int, after: int, guess: Floats, kind: Kind, origin: Origin
) -> Edge | None:
    """Return the shift of a keyframe in the frame of another one; None where it does not fit.

    Where the scene hides a direction, the shift has the guess's value in it, and the information none.
    """
    loop = origin is Origin.LOOP
    surface, middles_m = frames[before].surface, frames[after].middles_m
    shift, information = lay_over(surface, middles_m, guess, kind, GUESS_WEIGHT)
    pairs = pair(surface, middles_m, shift, kind)
    fits = pairs.good & (np.abs(pairs.off_m) < FITS_M)
    count, seen = int(np.count_nonzero(fits)), int(np.count_nonzero(surface.usable[pairs.beam]))
    if count < MIN_POINTS or count < (LOOP_MIN_SHARE if loop else MIN_SHARE) * seen:
        return None
    off_m = np.abs(pairs.off_m[fits])
    residual_m = float(np.sqrt(np.average(off_m**2, weights=1.0 / np.maximum(1.0, off_m / HUBER_M))))
    strength, axes = np.linalg.eigh(information[:2, :2])
    toward = axes[:, 0] @ surface.normals[:, pairs.beam[fits]]
    determined = float(np.sum(toward[np.abs(toward) > FACES] ** 2) / strength[1])
    full = determined > (LOOP_WEAK_SHARE if loop else WEAK_SHARE)
    if not full:
        strong = np.eye(3)
        strong[:2, :2] = np.outer(axes[:, 1], axes[:, 1])
        shift, information = guess + strong @ (shift - guess), strong @ information @ strong
    information = information / POINT_STD_M**2
    information = np.linalg.solve(np.eye(3) + information * np.square(MATCH_STD), information).astype(np.float64)
    return Edge(before, after, shift, information, origin, full, determined, count / seen, residual_m)


def _frames(record: LapRecord, path: LidarPath) -> list[Keyframe]:
    frames = keyframes(record, path)
    if len(frames) < 3:
        raise RecordingError(f"{record.name}: the car hardly moved ({len(frames)} places): a map needs a drive")
    return frames


def _chained(record: LapRecord, path: LidarPath, backs: Sequence[int]) -> tuple[list[Keyframe], list[Edge], Floats]:
    """Return keyframes, the edges along the way, and first poses, (n, 3). backs: which are laid over each other."""
    frames = _frames(record, path)
    poses, edges = [frames[0].odometry], []
    for number in range(1, len(frames)):
        told = _odometry(frames, number, record)
        edges.append(told)
        found: list[Edge] = []
        pose = placed(poses[-1], told.shift)
        for back in (*backs, *NEARER):
            if back > number or (found and back in NEARER):
                continue
            guess = between(poses[number - back], pose)
            if (edge := laid_over(frames, number - back, number, guess, record.kind, Origin.NEIGHBOUR)) is not None:
                found.append(edge)
                pose = placed(poses[number - back], edge.shift) if back == 1 else pose
        edges += found
        poses.append(_met(poses, [told, *found]))
    return frames, edges, np.array(poses)


def _met(poses: Sequence[Floats], edges: Sequence[Edge]) -> Floats:
    """Return the next pose, which fits best all edges to earlier ones."""
    pose = placed(poses[edges[-1].before], edges[-1].shift)
    matrix, pull = np.zeros((3, 3)), np.zeros(3)
    for edge in edges:
        cos, sin = np.cos(poses[edge.before][2]), np.sin(poses[edge.before][2])
        turned = np.array([[cos, sin, 0.0], [-sin, cos, 0.0], [0.0, 0.0, 1.0]])
        error = edge.shift - between(poses[edge.before], pose)
        error[2] = np.angle(np.exp(1j * error[2]))
        matrix = matrix + turned.T @ edge.information @ turned
        pull = pull + turned.T @ edge.information @ error
    met: Floats = pose + np.linalg.solve(matrix, pull)
    return met


def _odometry(frames: Sequence[Keyframe], number: int, record: LapRecord) -> Edge:
    before, after = frames[number - 1], frames[number]
    shift, by_gyro = between(before.odometry, after.odometry), len(record.gyro) >= 2
    way_m, turn_rad = float(np.hypot(*shift[:2])), float(shift[2])
    yaw_std = 0.0007 + 0.004 * abs(turn_rad) if by_gyro else 0.01 + 0.1 * abs(turn_rad) + 0.05 * way_m
    std = np.array([0.001 + 0.01 * way_m, 0.004 + 0.04 * way_m, yaw_std])
    by_errors = np.zeros((3, ERRORS))
    if len(record.reports):
        since_s = after.time_s - before.time_s
        step = between(*of_the_axle(np.stack([before.odometry, after.odometry]), record.lidar_m))
        by_errors[:2, 0] = step[:2]
        by_errors[1, 1] = -((step[0] / since_s) ** 2) * turn_rad
        by_errors[2, 2:] = (turn_rad, since_s) if by_gyro else (0.0, step[0])
    return Edge(number - 1, number, shift, np.diag(std**-2), Origin.ODOMETRY, by_errors=by_errors)


def _corrected(car: LearntCar, errors: Floats, record: LapRecord) -> LearntCar:
    """Return the car corrected by the errors of a pose graph: of scale, slip, gyro's scale, and bias or trim."""
    scale, slip_s2pm, gyro_scale, drift = errors.tolist()
    bias_radps, trim_rad = (drift, 0.0) if len(record.gyro) >= 2 else (0.0, record.wheelbase_m * drift)
    return LearntCar(
        car.scale * (1.0 + scale), car.trim_rad + trim_rad, max(0.0, car.slip_s2pm + slip_s2pm),
        car.gyro_scale * (1.0 + gyro_scale), car.bias_radps - bias_radps,
    )  # fmt: skip


def _trim_rad(record: LapRecord, times_s: Floats, poses: Floats) -> float:
    """Return the true steering less the reported one, by the steps of the map (n, 3) on which the car hardly turned."""
    told_rad = np.diff(odometry_path(record, LearntCar()).at(times_s)[:, 2])
    way_m, turn_rad = np.hypot(*np.diff(poses[:, :2], axis=0).T), np.diff(np.unwrap(poses[:, 2]))
    straight = np.abs(turn_rad) < STRAIGHT_RADPM * way_m
    if not straight.any():
        return 0.0
    return float(np.arctan(record.wheelbase_m * np.median((turn_rad - told_rad)[straight] / way_m[straight])))


def _loops(frames: Sequence[Keyframe], poses: Floats, kind: Kind, *, searching: bool) -> Iterator[Edge]:
    """Yield the edges between keyframes that are near each other after a loop.

    searching: the poses may still be wrong by as much as a drive drifts; else they are right to a decimetre.
    """
    way_m = np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(poses[:, :2], axis=0).T))])
    tree = cKDTree(poses[:, :2])
    for after in range(1, len(frames)):
        near = np.array(tree.query_ball_point(poses[after, :2], MAX_WINDOW_M if searching else NEAR_M), dtype=np.intp)
        turned = np.abs(np.angle(np.exp(1j * (poses[near, 2] - poses[after, 2]))))
        near = near[(way_m[near] < way_m[after] - LOOP_WAY_M) & (turned < LOOP_TURN_RAD)]
        if not len(near):
            continue
        near = near[np.argsort(np.hypot(*(poses[near, :2] - poses[after, :2]).T))]
        if not searching:
            for before in near[:LOOPS_EACH]:
                guess = between(poses[before], poses[after])
                if (edge := laid_over(frames, int(before), after, guess, kind, Origin.LOOP)) is not None:
                    yield edge
        elif (best := _searched(frames, poses, int(near[0]), after, way_m, kind)) is not None:
            yield best


def _searched(
    frames: Sequence[Keyframe], poses: Floats, before: int, after: int, way_m: Floats, kind: Kind
) -> Edge | None:
    """Return the best fit of a keyframe to one of the lap's beginning, from several places within the window."""
    guess = between(poses[before], poses[after])
    window_m = min(MAX_WINDOW_M, WINDOW_M + WINDOW_SHARE * float(way_m[after] - way_m[before]))
    if float(np.hypot(*guess[:2])) > window_m + WINDOW_M:
        return None
    reach = int(window_m / SEARCH_STEP_M) if window_m > SEARCH_STEP_M + WINDOW_M else 0
    found: list[Edge] = []
    for ahead in sorted(range(-reach, reach + 1), key=abs):
        start = guess + np.array([ahead * SEARCH_STEP_M, 0.0, 0.0])
        if (edge := laid_over(frames, before, after, start, kind, Origin.LOOP)) is not None:
            found.append(edge)
    return max(found, key=lambda edge: (edge.full, edge.share), default=None)
