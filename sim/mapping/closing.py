"""From a drive to the poses of its keyframes: laid over their neighbours, and over those of the lap's beginning.

Two passes or more, each of which finds the car's errors with the poses and has its scans de-skewed by what the one
before has found; the last closes the ring. Then a bundle adjustment of all scans makes the poses exact.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Final

import numpy as np
from scipy.spatial import cKDTree

from wallride.runtime.calibration.scan_motion import Kind
from wallride.sim.mapping.bundle import adjusted
from wallride.sim.mapping.keyframes import Keyframe, keyframes, trusted_ranges_m
from wallride.sim.mapping.lap_record import LapRecord
from wallride.sim.mapping.matching import Matcher
from wallride.sim.mapping.odometry_path import LearntCar, LidarPath, odometry_path, of_the_axle
from wallride.sim.mapping.pose_graph import ERRORS, Edge, Origin, between, optimized, placed
from wallride.sim.recordings import RecordingError
from wallride.sim.world.pose import Floats

BACK: Final = (1, 8)
"""A keyframe is laid over these before it."""
LEARNT_SCALE: Final = 0.03
MOST_PASSES: Final = 3
"""A pass that corrects the wheels' scale by more is followed by another one, up to so many: a match is drawn toward
the guess that the odometry gives, hence half of an error of 10 % remains."""
NEARER: Final = (2, 3, 4)
"""Before it, where it fits none of those: in a narrow bend few of its points are seen from far."""
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
    """The result of a drive: its keyframes with their poses (n, 3), and all edges.

    car: what was learnt of the car's own sensors.
    """

    frames: Sequence[Keyframe]
    poses: Floats
    edges: Sequence[Edge]
    car: LearntCar

    @property
    def loops(self) -> list[Edge]:
        """Return the edges between the lap's end and its beginning."""
        return [edge for edge in self.edges if edge.origin is Origin.LOOP]


def close_lap(record: LapRecord) -> ClosedLap:
    """Return the poses of a drive. RecordingError for a drive of fewer than three keyframes."""
    car, path = LearntCar(), odometry_path(record, LearntCar())
    scans = replace(record, ranges_m=trusted_ranges_m(record.ranges_m))
    for _ in range(MOST_PASSES):
        frames, chain, poses = _chained(record, scans, path)
        poses, _, errors = optimized(poses, chain)
        if len(record.reports):
            car = _corrected(car, errors, record)
            path = odometry_path(record, car)
        if len(record.gyro) < 2:
            times_s = np.array([frame.time_s for frame in frames])
            path = path.turned(times_s, poses[:, 2] - path.at(times_s)[:, 2])
        if abs(errors[0]) < LEARNT_SCALE:
            break
    frames, chain, poses = _chained(record, scans, path)
    poses, _, _ = optimized(poses, chain)
    poses, _, _ = optimized(poses, [*chain, *_loops(frames, poses, record.kind, searching=True)])
    times_s = np.array([frame.time_s for frame in frames])
    odometry = [edge for edge in chain if edge.origin is Origin.ODOMETRY]
    poses, errors = adjusted(scans, path, times_s, poses, odometry)
    edges = [*chain, *_loops(frames, poses, record.kind, searching=False)]
    car = _corrected(car, errors, record)
    if len(record.reports) and len(record.gyro) < 2:
        car = replace(car, trim_rad=_trim_rad(record, times_s, poses))
    return ClosedLap(frames, poses, edges, car)


def _chained(record: LapRecord, scans: LapRecord, path: LidarPath) -> tuple[list[Keyframe], list[Edge], Floats]:
    """Return keyframes, the edges along the way, and first poses, (n, 3)."""
    frames = keyframes(scans, path)
    if len(frames) < 3:
        raise RecordingError(f"{record.name}: the car hardly moved ({len(frames)} places): a map needs a drive")
    matcher = Matcher(frames, record.kind)
    edges = [[_odometry(frames, number, record)] for number in range(1, len(frames))]
    poses = np.array([frame.odometry for frame in frames])
    for back in (*BACK, *NEARER):
        after = np.arange(back, len(frames))
        if back in NEARER:
            after = after[[len(edges[number - 1]) == 1 for number in after.tolist()]]
        if not len(after):
            continue
        guesses = between(poses[after - back], poses[after])
        for edge in matcher.laid_over(after - back, after, guesses, Origin.NEIGHBOUR):
            if edge is not None:
                edges[edge.after - 1].append(edge)
        if back in BACK:
            poses = _placed(frames[0].odometry, edges)
    return frames, [edge for some in edges for edge in some], poses


def _placed(first: Floats, edges: Sequence[Sequence[Edge]]) -> Floats:
    """Return poses (n, 3), each the one that fits its edges to earlier ones best."""
    poses = [first]
    for some in edges:
        poses.append(_met(poses, some))
    return np.array(poses)


def _met(poses: Sequence[Floats], edges: Sequence[Edge]) -> Floats:
    """Return the next pose, which fits best all edges to earlier ones."""
    pose = placed(poses[edges[-1].before], edges[-1].shift)
    if len(edges) == 1:
        return pose
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


def _loops(frames: Sequence[Keyframe], poses: Floats, kind: Kind, *, searching: bool) -> list[Edge]:
    """Return the edges between keyframes that are near each other after a loop.

    searching: the poses may still be wrong by as much as a drive drifts; else they are right to a decimetre. Then of
    the fits from several places within the window only the best is an edge.
    """
    way_m = np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(poses[:, :2], axis=0).T))])
    tree = cKDTree(poses[:, :2])
    pairs, guesses = [], []
    for number in range(1, len(frames)):
        near = np.array(tree.query_ball_point(poses[number, :2], MAX_WINDOW_M if searching else NEAR_M), dtype=np.intp)
        turned = np.abs(np.angle(np.exp(1j * (poses[near, 2] - poses[number, 2]))))
        near = near[(way_m[near] < way_m[number] - LOOP_WAY_M) & (turned < LOOP_TURN_RAD)]
        near = near[np.argsort(np.hypot(*(poses[near, :2] - poses[number, :2]).T))]
        for one in near[: 1 if searching else LOOPS_EACH]:
            guess = between(poses[one], poses[number])
            starts = _starts(guess, float(way_m[number] - way_m[one])) if searching else [guess]
            pairs += [(one, number)] * len(starts)
            guesses += starts
    if not pairs:
        return []
    before, after = np.array(pairs).T
    edges = Matcher(frames, kind).laid_over(before, after, np.array(guesses), Origin.LOOP)
    found = [edge for edge in edges if edge is not None]
    if not searching:
        return found
    best = {edge.after: edge for edge in sorted(found, key=lambda edge: (edge.full, edge.share))}
    return list(best.values())


def _starts(guess: Floats, way_m: float) -> list[Floats]:
    """Return the places from which to lay a keyframe over another one after a loop of so much way."""
    window_m = min(MAX_WINDOW_M, WINDOW_M + WINDOW_SHARE * way_m)
    if float(np.hypot(*guess[:2])) > window_m + WINDOW_M:
        return []
    reach = int(window_m / SEARCH_STEP_M) if window_m > SEARCH_STEP_M + WINDOW_M else 0
    return [guess + np.array([ahead * SEARCH_STEP_M, 0.0, 0.0]) for ahead in range(-reach, reach + 1)]
