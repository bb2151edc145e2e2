"""A pose graph on SE(2): measured shifts between poses, and the poses that contradict them least.

Gauss-Newton on the sparse normal equations; matched edges that contradict all others lose their weight (Agarwal et al.,
"Robust map optimization using dynamic covariance scaling", 2013).
"""

from collections.abc import Sequence
from dataclasses import dataclass
from enum import Enum
from typing import Final

import numpy as np
from scipy import sparse
from scipy.sparse.linalg import splu

from wallride.sim.world.pose import Floats

ROUNDS: Final = 16
ENOUGH_M: Final = 1e-5
DOUBTED_CHI2: Final = 10.0
FIRST_DOUBTED_CHI2: Final = 1e5
"""From which chi2 on an edge loses weight, at last and in the first round; by a tenth less in each: before the ring is
closed the true edges contradict the drift as much as the false ones."""


class Origin(Enum):
    """Where a shift is from: the odometry, two keyframes in a row, or two that meet at the end of a loop."""

    ODOMETRY = "odometry"
    NEIGHBOUR = "neighbour"
    LOOP = "loop"


@dataclass(frozen=True, slots=True, eq=False)
class Edge:
    """A shift of pose `after` in the frame of pose `before`, (3,) x, y, yaw, and its information (3, 3).

    full: whether the scene determines all of it. determined: ratio of what it tells of two directions. share: of the
    points that fit. residual_m: rms of their distances, weighted as in the fit (Huber).
    """

    before: int
    after: int
    shift: Floats
    information: Floats
    origin: Origin
    full: bool = True
    determined: float = 1.0
    share: float = 1.0
    residual_m: float = 0.0


def between(before: Floats, after: Floats) -> Floats:
    """Return pose `after` in the frame of pose `before`; (3,), or (n, 3) each."""
    dx, dy = after[..., 0] - before[..., 0], after[..., 1] - before[..., 1]
    cos, sin = np.cos(before[..., 2]), np.sin(before[..., 2])
    turn_rad = np.angle(np.exp(1j * (after[..., 2] - before[..., 2])))
    return np.stack([cos * dx + sin * dy, cos * dy - sin * dx, turn_rad], axis=-1)


def placed(at: Floats, shift: Floats) -> Floats:
    """Return the pose (3,) that lies at a shift from another one."""
    cos, sin = np.cos(at[2]), np.sin(at[2])
    return np.array(
        [at[0] + cos * shift[0] - sin * shift[1], at[1] + sin * shift[0] + cos * shift[1], at[2] + shift[2]]
    )


def optimized(poses: Floats, edges: Sequence[Edge]) -> tuple[Floats, Floats]:
    """Return the poses (n, 3) that fit the edges best, the first kept, and the chi2 of each edge."""
    before, after = np.array([edge.before for edge in edges]), np.array([edge.after for edge in edges])
    shifts, information = np.array([edge.shift for edge in edges]), np.array([edge.information for edge in edges])
    matched = np.array([edge.origin is not Origin.ODOMETRY for edge in edges])
    poses = poses.copy()
    doubted = FIRST_DOUBTED_CHI2
    for _ in range(ROUNDS):
        errors, chi2 = _errors(poses, before, after, shifts, information)
        trust = np.where(matched, (doubted / (doubted + chi2)) ** 2, 1.0)
        step = _step(poses, before, after, errors, information * trust[:, None, None])
        poses += step
        if doubted == DOUBTED_CHI2 and np.abs(step).max() < ENOUGH_M:
            break
        doubted = max(DOUBTED_CHI2, 0.1 * doubted)
    return poses, _errors(poses, before, after, shifts, information)[1]


def _errors(
    poses: Floats, before: np.ndarray, after: np.ndarray, shifts: Floats, information: Floats
) -> tuple[Floats, Floats]:
    errors = between(poses[before], poses[after]) - shifts
    errors[:, 2] = np.angle(np.exp(1j * errors[:, 2]))
    return errors, np.einsum("ei,eij,ej->e", errors, information, errors)


def _step(poses: Floats, before: np.ndarray, after: np.ndarray, errors: Floats, information: Floats) -> Floats:
    """Return the change of the poses, (n, 3), of one Gauss-Newton step."""
    count, cos, sin = len(before), np.cos(poses[before, 2]), np.sin(poses[before, 2])
    there = between(poses[before], poses[after])
    zero, one = np.zeros(count), np.ones(count)
    by_after = np.array([[cos, sin, zero], [-sin, cos, zero], [zero, zero, one]])
    by_before = np.array([[-cos, -sin, there[:, 1]], [sin, -cos, -there[:, 0]], [zero, zero, -one]])
    slopes = np.concatenate([by_before, by_after], axis=1).transpose(2, 0, 1)  # (edges, 3, 6)
    blocks = np.einsum("eki,ekl,elj->eij", slopes, information, slopes)
    pulls = np.einsum("eki,ekl,el->ei", slopes, information, errors)
    index = np.concatenate([3 * before[:, None] + np.arange(3), 3 * after[:, None] + np.arange(3)], axis=1)
    size = 3 * len(poses)
    rows, columns = np.repeat(index, 6, axis=1).ravel(), np.tile(index, (1, 6)).ravel()
    matrix = sparse.csc_matrix((blocks.ravel(), (rows, columns)), shape=(size, size))[3:, 3:]
    pull = np.bincount(index.ravel(), pulls.ravel(), size)[3:]
    moved = splu(sparse.csc_matrix(matrix)).solve(-pull)
    return np.concatenate([np.zeros(3), moved]).reshape(-1, 3)
