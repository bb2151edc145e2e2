"""Bundle adjustment of a lap: the poses with which all scans see the same pieces of walls.

Pairs of keyframes tell a way only as well as two noisy scans do. Here each piece of a wall is one line, unknown with
the poses and eliminated from them (Schur complement; Liu and Zhang, "BALM: bundle adjustment for lidar mapping", 2021,
does so with planes). Beams that graze a rough wall end on what sticks out of it, by millimetres nearer than others:
that bent laps by centimetres, so how much nearer is unknown, too, for each piece and side.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np
import numpy.typing as npt
from scipy import sparse

from wallride.sim.mapping.keyframes import swept_m
from wallride.sim.mapping.lap_record import LapRecord
from wallride.sim.mapping.odometry_path import LidarPath
from wallride.sim.mapping.pose_graph import ERRORS, Edge, PoseGraph, solved
from wallride.sim.world.pose import Booleans, Floats

PIECE_M: Final = 0.3
"""A piece is what lies within a square of this side and faces the car from one side."""
MIN_POINTS: Final = 20
MAX_BEND_M: Final = 0.05
"""Least number of points of a piece, and their largest standard deviation from its line."""
GATE_M: Final = 0.15
"""Maximum distance of a point from the line of its piece."""
POINT_STD_M: Final = 0.06
"""Standard deviation of a point's distance from a line, of beams whose errors are alike by more than noise has it."""
HUBER_M: Final = 0.06
ROUGH_M: Final = 0.01
"""Standard deviation of how much nearer a piece seems under 45 degrees than from straight ahead."""
MAX_GRAZE: Final = 3.0
UNKNOWN: Final = 4
"""Unknowns of a piece: offset and slope of its line, and what sticks out toward either side."""
LEAST_KNOWN: Final = (1e-3, 1e-3, ROUGH_M**-2, ROUGH_M**-2)
SCANS_EACH: Final = 3
BEAMS_APART: Final = 3
"""About so many scans for each keyframe, and of each scan one beam in so many, the others of the next one."""
ROUNDS: Final = (1, 2)
"""Scans between keyframes are put to their places as often as there are numbers: of Gauss-Newton steps that follow."""

Complexes = npt.NDArray[np.complex128]
Numbers = npt.NDArray[np.intp]


@dataclass(frozen=True, slots=True, eq=False)
class SeenPoints:
    """Ends of beams, each (points,): keyframe nearest in time, place x + iy in its frame, and direction of the beam."""

    frame: Numbers
    places_m: Complexes
    rays: Complexes


@dataclass(frozen=True, slots=True, eq=False)
class WallPieces:
    """Lines, each (pieces,): middle x + iy and normal on the map, and whether there are enough points on a line."""

    middles_m: Complexes
    normals: Complexes
    sure: Booleans


def adjusted(
    record: LapRecord, path: LidarPath, times_s: Floats, poses: Floats, odometry: Sequence[Edge]
) -> tuple[Floats, Floats]:
    """Return the poses (n, 3) that fit walls and odometry best, the first kept, and the car's errors (ERRORS,).

    path: of the odometry. times_s: (n,), of the keyframes, poses: theirs, right to a few centimetres between all that
    see the same wall.
    """
    graph, trust = PoseGraph(odometry), np.ones(len(odometry))
    poses, car = poses.copy(), np.zeros(ERRORS)
    for rounds in ROUNDS:
        seen = _seen(record, path.through(times_s, poses), times_s)
        for _ in range(rounds):
            matrix, gradient = graph.equations(poses, car, graph.errors(poses, car)[0], trust)
            of_walls, pull = _wall_equations(seen, poses)
            matrix = matrix + sparse.block_diag([of_walls, sparse.csc_matrix((ERRORS, ERRORS))], "csc")
            gradient[: pull.size] += pull
            step, learnt = solved(matrix, gradient)
            poses, car = poses + step, car + learnt
    return poses, car


def _seen(record: LapRecord, path: LidarPath, times_s: Floats) -> SeenPoints:
    """Return the points of all scans. path: through the poses of the keyframes at times_s."""
    scans = np.arange(0, len(record.scan_s), max(1, round(len(record.scan_s) / (SCANS_EACH * len(times_s)))))
    nearest = np.searchsorted((times_s[1:] + times_s[:-1]) / 2, record.scan_s[scans])
    at = path.at(times_s)
    parts = [
        _swept(record, path, scans[first::BEAMS_APART], nearest[first::BEAMS_APART], first, at)
        for first in range(BEAMS_APART)
    ]
    frame, places_m, rays = (np.concatenate(part) for part in zip(*parts, strict=True))
    return SeenPoints(frame, places_m, rays)


def _swept(
    record: LapRecord, path: LidarPath, scans: Numbers, nearest: Numbers, first: int, at: Floats
) -> tuple[Numbers, Complexes, Complexes]:
    """Return the points of every BEAMS_APART-th beam of scans (n,), each in the frame of the nearest of poses `at`."""
    beams = np.arange(first, record.kind[2], BEAMS_APART)
    (x_m, y_m), (from_x_m, from_y_m) = swept_m(record, path, scans, beams, at[nearest])
    scan, beam = np.nonzero(np.isfinite(x_m))
    places_m = (x_m + 1j * y_m)[scan, beam]
    ways_m = places_m - (from_x_m + 1j * from_y_m)[scan, beam]
    return nearest[scan], places_m, ways_m / np.abs(ways_m)


def _wall_equations(seen: SeenPoints, poses: Floats) -> tuple[sparse.csc_matrix, Floats]:
    """Return the normal equations of the poses, (3 n, 3 n) and (3 n,), the unknowns of all pieces eliminated."""
    turn = np.exp(1j * poses[:, 2])[seen.frame]
    points_m, rays = seen.places_m * turn + (poses[:, 0] + 1j * poses[:, 1])[seen.frame], seen.rays * turn
    piece, walls = _pieces(points_m, rays)
    from_middle_m = (points_m - walls.middles_m[piece]) * walls.normals[piece].conj()
    good = walls.sure[piece] & (np.abs(from_middle_m.real) < GATE_M)
    piece, off_m, along_m = piece[good], from_middle_m[good].real, from_middle_m[good].imag
    pair, place = np.unique(piece * len(poses) + seen.frame[good], return_inverse=True)
    weight = POINT_STD_M**-2 / np.maximum(1.0, np.abs(off_m) / HUBER_M)
    toward = rays[good] * walls.normals[piece].conj()
    graze = np.clip(toward.imag / np.maximum(np.abs(toward.real), 1e-3), -MAX_GRAZE, MAX_GRAZE)
    shapes = (np.ones(off_m.size), along_m, np.maximum(graze, 0.0), np.maximum(-graze, 0.0))
    told = np.zeros((pair.size, UNKNOWN, UNKNOWN))
    for one in range(UNKNOWN):
        for two in range(one + 1):
            told[:, one, two] = np.bincount(place, weight * shapes[one] * shapes[two], pair.size)
            told[:, two, one] = told[:, one, two]
    pull = np.array([np.bincount(place, weight * shape * off_m, pair.size) for shape in shapes]).T
    return _eliminated(pair // len(poses), pair % len(poses), told, pull, walls, poses)


def _pieces(points_m: Complexes, rays: Complexes) -> tuple[Numbers, WallPieces]:
    """Return the piece of each point, and the pieces; both faces of a thin wall are two."""
    column, row = (np.floor(part / PIECE_M).astype(np.int64) for part in (points_m.real, points_m.imag))
    column, row = column - column.min(), row - row.min()
    place = column * (row.max() + 1) + row
    square = (np.cumsum(np.bincount(place) > 0) - 1)[place]
    piece = 2 * square + ((rays * _lines(points_m, square).normals[square].conj()).real > 0.0)
    return piece, _lines(points_m, piece)


def _lines(points_m: Complexes, piece: Numbers) -> WallPieces:
    """Return the lines through the points of each piece (total least squares)."""
    counts = np.bincount(piece)

    def mean(values: Floats) -> Floats:
        return np.bincount(piece, values) / np.maximum(counts, 1)

    middles_m = mean(points_m.real) + 1j * mean(points_m.imag)
    apart_m = points_m - middles_m[piece]
    squares_m2 = mean(apart_m.real**2) + mean(apart_m.imag**2)
    longer_m2 = mean(apart_m.real**2 - apart_m.imag**2) + 2j * mean(apart_m.real * apart_m.imag)
    bend_m = np.sqrt(np.maximum((squares_m2 - np.abs(longer_m2)) / 2, 0.0))
    normals = 1j * np.exp(0.5j * np.angle(longer_m2))
    return WallPieces(middles_m, normals, (counts >= MIN_POINTS) & (bend_m < MAX_BEND_M))


def _eliminated(
    piece: Numbers, frame: Numbers, told: Floats, pull: Floats, walls: WallPieces, poses: Floats
) -> tuple[sparse.csc_matrix, Floats]:
    """Return the normal equations of the poses. Each (pairs, ...): a piece, a keyframe that sees it, and what it tells.

    told, pull: normal equations of the piece's unknowns by that keyframe alone, (UNKNOWN, UNKNOWN) and (UNKNOWN,).
    Pairs are in the order of their pieces.
    """
    count, pieces = len(poses), len(walls.normals)
    arm_m = walls.middles_m[piece] - (poses[:, 0] + 1j * poses[:, 1])[frame]
    slopes = np.zeros((len(piece), UNKNOWN, 3))
    slopes[:, 0, 0], slopes[:, 0, 1] = walls.normals[piece].real, walls.normals[piece].imag
    slopes[:, 0, 2], slopes[:, 1, 2] = (arm_m.conj() * walls.normals[piece]).imag, -1.0
    whole = _summed(piece, told, pieces) + np.diag(LEAST_KNOWN)
    root = np.linalg.inv(np.linalg.cholesky(whole))
    shared = root[piece] @ (told @ slopes)
    ends = np.append(0, np.cumsum(np.bincount(piece, minlength=pieces)))
    by_pieces = sparse.bsr_matrix((shared, frame, ends), shape=(UNKNOWN * pieces, 3 * count))
    own = sparse.block_diag(list(_summed(frame, slopes.transpose(0, 2, 1) @ told @ slopes, count)), "csr")
    gradient = _summed(frame, np.einsum("pki,pk->pi", slopes, pull), count)
    freed = root @ _summed(piece, pull, pieces)[:, :, None]
    return sparse.csc_matrix(own - by_pieces.T @ by_pieces), gradient.ravel() - by_pieces.T @ freed.ravel()


def _summed(group: Numbers, values: Floats, groups: int) -> Floats:
    """Return the sums of values (n, ...) over the members of each group, (groups, ...)."""
    parts = values.reshape(len(values), -1).T
    return np.array([np.bincount(group, part, groups) for part in parts]).T.reshape(groups, *values.shape[1:])
