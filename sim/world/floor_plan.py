"""Floor made of convex pieces, and the walls round it.

The free space is the union of the pieces, so rooms, lanes, doors and niches are joined by letting them overlap, and a
lane that returns to its beginning is a loop. The walls are the border of that union: each piece's sides, less what lies
inside another piece.
"""

import math
from dataclasses import dataclass, field

import numpy as np

from wallride.sim.world.pose import Floats, Pose

ON_THE_BORDER_M = 1e-6
"""Distance below which a point counts as on a piece's side, not inside: sides that lie on each other stay."""
MIN_WALL_M = 1e-3


@dataclass(slots=True)
class FloorPlan:
    """Floor. pieces: convex polygons, (k, 2) each, counter-clockwise. things: objects on the floor, segments (n, 4)."""

    pieces: list[Floats] = field(default_factory=list)
    things: list[Floats] = field(default_factory=list)

    def lane(self, at: Pose, length_m: float, width_m: float, end_width_m: float | None = None) -> Pose:
        """Add a lane that begins at a pose in its middle, perhaps narrowing, and return the pose at its end."""
        end = at.ahead(length_m)
        half_m, end_half_m = width_m / 2, (width_m if end_width_m is None else end_width_m) / 2
        corners = [
            at.ahead(0.0, -half_m),
            end.ahead(0.0, -end_half_m),
            end.ahead(0.0, end_half_m),
            at.ahead(0.0, half_m),
        ]
        self.pieces.append(np.array([(corner.x_m, corner.y_m) for corner in corners]))
        return end

    def walls_m(self) -> Floats:
        """Return the walls and the objects before them, segments (x0, y0, x1, y1), shape (n, 4)."""
        walls: list[Floats] = []
        for piece in self.pieces:
            others = [other for other in self.pieces if other is not piece]
            for start, end in zip(piece, np.roll(piece, -1, axis=0), strict=True):
                walls += _outside(start, end, others)
        return np.vstack([*walls, *self.things])


def _sides(piece: Floats) -> tuple[Floats, Floats]:
    """Return the inward normals, (k, 2), and the first points of the sides, (k, 2)."""
    along = np.roll(piece, -1, axis=0) - piece
    along /= np.hypot(along[:, 0], along[:, 1])[:, None]
    return np.column_stack([-along[:, 1], along[:, 0]]), piece


def _outside(start: Floats, end: Floats, others: list[Floats]) -> list[Floats]:
    """Return the parts of a side, (1, 4) each, that lie inside no other piece."""
    hidden = sorted(part for other in others if (part := _inside(start, end, other)) is not None)
    length_m = math.hypot(*(end - start))
    parts, at = [], 0.0
    for first, last in [*hidden, (1.0, 1.0)]:
        if (first - at) * length_m > MIN_WALL_M:
            parts.append(np.concatenate([start + at * (end - start), start + first * (end - start)])[None, :])
        at = max(at, last)
    return parts


def _inside(start: Floats, end: Floats, piece: Floats) -> tuple[float, float] | None:
    """Return the first and last share of a side that lie inside a piece, None if it does not."""
    normals, corners = _sides(piece)
    first, last = 0.0, 1.0
    for depth_m, deeper_m in zip(
        ((start - corners) * normals).sum(axis=1) - ON_THE_BORDER_M, normals @ (end - start), strict=True
    ):
        if abs(deeper_m) < 1e-12:
            if depth_m <= 0.0:
                return None
        elif deeper_m > 0:
            first = max(first, -depth_m / deeper_m)
        else:
            last = min(last, -depth_m / deeper_m)
    return (first, last) if first < last else None
