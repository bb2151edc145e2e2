"""Static world that a car drives in: walls, a start, a side to follow, perhaps a lap. Ground truth for all tests.

Not here: obstacles that appear or move (`wallride.sim.world.obstacles`), the lidar's measurement of the world
(`wallride.sim.world.beams`).
"""

from dataclasses import dataclass, replace
from typing import Protocol

import numpy as np

from wallride.sim.world.lap import Lap
from wallride.sim.world.pose import CAR, Floats, Footprint, Pose, Side, other_side, side_sign

START_DISTANCE_M = 1.0
"""Distance of every default start pose from the followed wall; less only on maps too narrow for it."""

_SIDE_BEARINGS_RAD = np.radians(np.linspace(30.0, 150.0, 481))
_EACH_DEGREE_RAD = np.radians(np.linspace(30.0, 150.0, 121))  # 4e-5 too far at most
_POSES_AT_ONCE = 9


class Surroundings(Protocol):
    """Surfaces that a lidar can see and a car can hit: a world, or a world with obstacles in it."""

    def cast(self, x_m: float | Floats, y_m: float | Floats, bearing_rad: Floats) -> Floats:
        """Return the distance along each world bearing (n,) from one origin, or one each; inf without a surface."""

    def clearance(self, pose: Pose, footprint: Footprint = CAR) -> float:
        """Return the distance between the car's outline and the nearest surface, 0 in contact, inf without one."""


class Geometry(Protocol):
    """Walls, independent of their storage (`wallride.sim.world.segments`, `wallride.sim.world.grid`)."""

    @property
    def outline_m(self) -> Floats:
        """Segments (x0, y0, x1, y1), shape (k, 4), to draw."""

    def cast(self, x_m: float | Floats, y_m: float | Floats, bearing_rad: Floats) -> Floats:
        """See Surroundings."""

    def clearance(self, pose: Pose, footprint: Footprint) -> float:
        """See Surroundings."""

    def mirrored(self) -> "Geometry":
        """Return the same walls with y negated."""


@dataclass(frozen=True, slots=True, eq=False)
class World:
    """Walls and the task in them.

    start: a pose from which to follow the wall, parallel to it, room_m from it.
    side: the side on which the followed wall is at the start.
    lap: how progress is measured where the world closes on itself, else None.
    room_m: the largest distance up to START_DISTANCE_M at which the followed wall leads far enough
    (`wallride.sim.map_start`).
    """

    name: str
    geometry: Geometry
    start: Pose
    side: Side = "left"
    lap: Lap | None = None
    description: str = ""
    room_m: float = START_DISTANCE_M

    @property
    def bounds_m(self) -> tuple[float, float, float, float]:
        """(x_min, y_min, x_max, y_max) of the walls."""
        outline = self.outline_m
        x, y = outline[:, [0, 2]], outline[:, [1, 3]]
        return float(x.min()), float(y.min()), float(x.max()), float(y.max())

    @property
    def outline_m(self) -> Floats:
        """Segments (x0, y0, x1, y1), shape (k, 4), to draw."""
        return self.geometry.outline_m

    def cast(self, x_m: float | Floats, y_m: float | Floats, bearing_rad: Floats) -> Floats:
        """Return exact distances to the walls, shape (n,); see Surroundings."""
        return self.geometry.cast(x_m, y_m, bearing_rad)

    def clearance(self, pose: Pose, footprint: Footprint = CAR) -> float:
        """Return the distance between the car's outline and the nearest wall, 0 in contact."""
        return self.geometry.clearance(pose, footprint)

    def collides(self, pose: Pose, footprint: Footprint = CAR) -> bool:
        """Return whether the car's outline touches a wall."""
        return self.clearance(pose, footprint) <= 0.0

    def wall_distance_m(self, pose: Pose, side: Side | None = None) -> float:
        """Return the true distance from a point to the nearest wall on one side (default: the followed one).

        Nearest of the exact casts from 30 to 150 degrees on that side, every 0.25 degrees (too far by a share of
        2.4e-6 at most); inf when there is no wall.
        """
        bearings = pose.yaw_rad + side_sign(side or self.side) * _SIDE_BEARINGS_RAD
        return float(self.cast(pose.x_m, pose.y_m, bearings).min())

    def start_at(self, *, distance_m: float | None = None, toward_wall_rad: float = 0.0) -> Pose:
        """Return the start turned toward the followed wall (negative: away), optionally at another distance from it."""
        sign = side_sign(self.side)
        at = self.start if distance_m is None else self.start.ahead(0.0, sign * (self.room_m - distance_m))
        return Pose(at.x_m, at.y_m, at.yaw_rad + sign * toward_wall_rad)

    def mirrored(self) -> "World":
        """Return the mirrored world: y negated, and the followed wall on the other side."""
        return replace(
            self,
            geometry=self.geometry.mirrored(),
            start=self.start.mirrored(),
            side=other_side(self.side),
            lap=self.lap.mirrored() if self.lap else None,
        )


def wall_distances_m(world: Surroundings, poses: Floats, side: Side) -> Floats:
    """Return the true distance to the nearest wall on one side (30 to 150 degrees) for poses (n, 3), shape (n,)."""
    aside = side_sign(side) * _EACH_DEGREE_RAD
    distances = np.empty(len(poses))
    for first in range(0, len(poses), _POSES_AT_ONCE):
        some = poses[first : first + _POSES_AT_ONCE]
        x_m, y_m = np.repeat(some[:, 0], len(aside)), np.repeat(some[:, 1], len(aside))
        ranges = world.cast(x_m, y_m, (some[:, 2:] + aside).ravel())
        distances[first : first + len(some)] = ranges.reshape(len(some), -1).min(axis=1)
    return distances
