"""A pose graph on SE(2): measured shifts between poses, and the poses that contradict them least.

Gauss-Newton on the sparse normal equations; matched edges that contradict all others lose their weight (Agarwal et al.,
"Robust map optimization using dynamic covariance scaling", 2013).
"""

from collections.abc import Sequence
from dataclasses import dataclass, field
from enum import Enum
from typing import Final

import numpy as np
from scipy import sparse
from scipy.sparse.linalg import splu

from wallride.sim.world.pose import Floats

ERRORS: Final = 4
ERROR_STD: Final = (0.05, 0.02, 0.02, 0.01)
"""Number of a car's errors that are unknown with the poses, and what they may be: scale of the wheels, slip [s2/m],
scale of the gyro, and its bias [rad/s], or the bend of the way [rad/m] by the steering's trim."""
ROUNDS: Final = 16
ENOUGH_M: Final = 1e-4
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
    by_errors: Floats = field(default_factory=lambda: np.zeros((3, ERRORS)))


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


def optimized(poses: Floats, edges: Sequence[Edge]) -> tuple[Floats, Floats, Floats]:
    """Return the poses (n, 3) that fit the edges best, the first kept, the chi2 of each edge, and the errors (ERRORS,).

    The errors of a car are unknown with the poses, and not learnt from those found with wrong ones: these would be
    pulled toward them.
    """
    graph = PoseGraph(edges)
    poses, car = poses.copy(), np.zeros(ERRORS)
    doubted = FIRST_DOUBTED_CHI2
    for _ in range(ROUNDS):
        errors, chi2 = graph.errors(poses, car)
        trust = np.where(graph.matched, (doubted / (doubted + chi2)) ** 2, 1.0)
        step, learnt = solved(*graph.equations(poses, car, errors, trust))
        poses, car = poses + step, car + learnt
        if doubted == DOUBTED_CHI2 and np.abs(step).max() < ENOUGH_M:
            break
        doubted = max(DOUBTED_CHI2, 0.1 * doubted)
    return poses, graph.errors(poses, car)[1], car


class PoseGraph:
    """Edges as arrays, each (edges, ...), and the normal equations of poses by them."""

    def __init__(self, edges: Sequence[Edge]) -> None:
        self._before, self._after = np.array([(edge.before, edge.after) for edge in edges]).T
        self._shifts = np.array([edge.shift for edge in edges])
        self._information = np.array([edge.information for edge in edges])
        self._by_errors = np.array([edge.by_errors for edge in edges])
        self.matched = np.array([edge.origin is not Origin.ODOMETRY for edge in edges])

    def errors(self, poses: Floats, car: Floats) -> tuple[Floats, Floats]:
        """Return what the edges are off by, (edges, 3), and the chi2 of each."""
        errors = between(poses[self._before], poses[self._after]) - self._shifts - self._by_errors @ car
        errors[:, 2] = np.angle(np.exp(1j * errors[:, 2]))
        return errors, np.einsum("ei,eij,ej->e", errors, self._information, errors)

    def equations(self, poses: Floats, car: Floats, errors: Floats, trust: Floats) -> tuple[sparse.csc_matrix, Floats]:
        """Return the normal equations of a Gauss-Newton step: matrix and gradient, of the poses, then of the car."""
        before, after = self._before, self._after
        count, cos, sin = len(before), np.cos(poses[before, 2]), np.sin(poses[before, 2])
        there = between(poses[before], poses[after])
        zero, one = np.zeros(count), np.ones(count)
        by_after = np.array([[cos, sin, zero], [-sin, cos, zero], [zero, zero, one]])
        by_before = np.array([[-cos, -sin, there[:, 1]], [sin, -cos, -there[:, 0]], [zero, zero, -one]])
        slopes = np.concatenate([by_before, by_after, -self._by_errors.transpose(1, 2, 0)], axis=1).transpose(2, 0, 1)
        information = self._information * trust[:, None, None]
        weighted = slopes.transpose(0, 2, 1) @ information
        blocks, pulls = weighted @ slopes, np.einsum("eik,ek->ei", weighted, errors)
        first = 3 * len(poses)
        of_car = np.tile(first + np.arange(ERRORS)[:, None], count)
        index = np.concatenate([3 * before + np.arange(3)[:, None], 3 * after + np.arange(3)[:, None], of_car]).T
        size = first + ERRORS
        rows, columns = np.repeat(index, index.shape[1], axis=1).ravel(), np.tile(index, (1, index.shape[1])).ravel()
        known = sparse.diags(np.concatenate([np.zeros(first), np.array(ERROR_STD) ** -2]))
        matrix = sparse.csc_matrix((blocks.ravel(), (rows, columns)), shape=(size, size)) + known
        return matrix, np.bincount(index.ravel(), pulls.ravel(), size) + known @ np.concatenate([np.zeros(first), car])


def solved(matrix: sparse.csc_matrix, gradient: Floats) -> tuple[Floats, Floats]:
    """Return the change of the poses, (n, 3), the first kept, and of the car's errors, (ERRORS,)."""
    # In a quarter of the time of the general order, which the dense columns of the car's errors disturb.
    symmetric = {"SymmetricMode": True}
    factors = splu(sparse.csc_matrix(matrix[3:, 3:]), "MMD_AT_PLUS_A", diag_pivot_thresh=0.0, options=symmetric)
    moved = factors.solve(-gradient[3:])
    return np.concatenate([np.zeros(3), moved[:-ERRORS]]).reshape(-1, 3), moved[-ERRORS:]
