"""Obstacles that are not part of the building: standing, appearing suddenly in front of the car, or walking.

An `ObstacleWorld` is a world with obstacles in it, at one moment: `update` advances it, then its queries are those of a
world.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from wallride.sim.world.place import Surroundings, World
from wallride.sim.world.pose import CAR, Floats, Footprint, Pose
from wallride.sim.world.segments import SegmentGeometry, box

LIDAR_AHEAD_M = 0.27
"""Distance from the rear axle to the origin of distances "ahead of the lidar"."""


@dataclass(frozen=True, slots=True)
class Round:
    """Circle: a pole or a leg."""

    radius_m: float


@dataclass(frozen=True, slots=True)
class Box:
    """Rectangle; its length lies along its own heading."""

    length_m: float
    width_m: float


@dataclass(frozen=True, slots=True)
class StandingObstacle:
    """Obstacle at a fixed place, from a time on."""

    pose: Pose
    from_s: float = -math.inf


@dataclass(frozen=True, slots=True)
class SuddenObstacle:
    """Appears before the car, with its near face `ahead_m` from the lidar, square to the car's heading.

    It appears at the first update at which the car is at least this fast and it is at least this late, and then
    stays where it is in the world. left_m: its centre's offset from the car's middle line.
    """

    ahead_m: float
    left_m: float = 0.0
    min_speed_mps: float = 0.0
    from_s: float = -math.inf


@dataclass(frozen=True, slots=True)
class ConstantMotion:
    """Constant velocity in the world between two times."""

    x_mps: float
    y_mps: float
    from_s: float = -math.inf
    until_s: float = math.inf

    def moved_s(self, since_s: float, now_s: float) -> float:
        """Return the duration of its motion between two times."""
        return max(0.0, min(now_s, self.until_s) - max(since_s, self.from_s))


@dataclass(frozen=True, slots=True)
class Obstacle:
    """Shape of an obstacle, rule of its appearance, and its motion."""

    shape: Round | Box
    appearance: StandingObstacle | SuddenObstacle
    motion: ConstantMotion | None = None

    @property
    def half_length_m(self) -> float:
        """Return the distance from its centre to its near face."""
        return self.shape.radius_m if isinstance(self.shape, Round) else self.shape.length_m / 2

    def mirrored(self) -> "Obstacle":
        """Return the same standing or walking thing with y negated."""
        if not isinstance(self.appearance, StandingObstacle):
            raise TypeError("only standing things can be mirrored")
        appearance = replace(self.appearance, pose=self.appearance.pose.mirrored())
        motion = replace(self.motion, y_mps=-self.motion.y_mps) if self.motion is not None else None
        return replace(self, appearance=appearance, motion=motion)


def pole(x_m: float, y_m: float, radius_m: float = 0.02) -> Obstacle:
    """Return a pole that stands from the start."""
    return Obstacle(Round(radius_m), StandingObstacle(Pose(x_m, y_m, 0.0)))


def person(x_m: float, y_m: float, motion: ConstantMotion, radius_m: float = 0.2) -> Obstacle:
    """Return a person who is at x, y when the motion begins."""
    return Obstacle(Round(radius_m), StandingObstacle(Pose(x_m, y_m, 0.0), motion.from_s), motion)


def sudden_box(
    ahead_m: float, *, width_m: float = 0.5, depth_m: float = 0.3, left_m: float = 0.0, min_speed_mps: float = 0.0,
    from_s: float = -math.inf,
) -> Obstacle:  # fmt: skip
    """Return a box across the car's way that appears `ahead_m` from the lidar; see Sudden."""
    return Obstacle(Box(depth_m, width_m), SuddenObstacle(ahead_m, left_m, min_speed_mps, from_s))


@dataclass(slots=True)
class _Present:
    """An obstacle that has appeared: the place of its centre then, and the time."""

    obstacle: Obstacle
    pose: Pose
    since_s: float

    def at(self, now_s: float) -> Pose:
        """Return its present place."""
        motion = self.obstacle.motion
        if motion is None:
            return self.pose
        moved_s = motion.moved_s(self.since_s, now_s)
        return Pose(self.pose.x_m + motion.x_mps * moved_s, self.pose.y_m + motion.y_mps * moved_s, self.pose.yaw_rad)


@dataclass(slots=True)
class ObstacleWorld(Surroundings):
    """World with obstacles. None has appeared before the first `update`."""

    world: World
    obstacles: Sequence[Obstacle] = ()
    _present: list[_Present] = field(default_factory=list, init=False)
    _waiting: list[Obstacle] = field(init=False)
    _things: SegmentGeometry = field(default_factory=SegmentGeometry, init=False)

    def __post_init__(self) -> None:
        self._waiting = list(self.obstacles)

    @property
    def appeared(self) -> int:
        """Return the number of obstacles that have appeared."""
        return len(self._present)

    @property
    def obstacle_outline_m(self) -> Floats:
        """Return the segments (x0, y0, x1, y1), shape (k, 4), of the obstacles that have appeared, to draw."""
        return self._things.outline_m

    def distances_m(self, now_s: float, car: Pose) -> dict[Obstacle, float]:
        """Return the distance from the car's rear axle to the centre of each obstacle that has appeared."""
        places = [(present.obstacle, present.at(now_s)) for present in self._present]
        return {obstacle: math.hypot(at.x_m - car.x_m, at.y_m - car.y_m) for obstacle, at in places}

    def put(self, obstacle: Obstacle) -> None:
        """Add an obstacle, which appears at the first update from its moment on."""
        self._waiting.append(obstacle)

    def clear(self) -> None:
        """Remove all obstacles, pending ones included."""
        self._waiting.clear()
        self._present.clear()
        self._things = SegmentGeometry()

    def update(self, now_s: float, car: Pose, speed_mps: float) -> None:
        """Advance to now: obstacles appear and move. Time must not run backwards."""
        news = [(obstacle, where) for obstacle in self._waiting if (where := _appears(obstacle, now_s, car, speed_mps))]
        for obstacle, where in news:
            self._waiting.remove(obstacle)
            self._present.append(_Present(obstacle, where, now_s))
        if news or any(present.obstacle.motion for present in self._present):
            self._things = _geometry(self._present, now_s)

    def cast(self, x_m: float | Floats, y_m: float | Floats, bearing_rad: Floats) -> Floats:
        """Return the distance to the nearest wall or obstacle along each bearing, shape (n,)."""
        walls_m = self.world.cast(x_m, y_m, bearing_rad)
        return np.minimum(walls_m, self._things.cast(x_m, y_m, bearing_rad)) if self._present else walls_m

    def clearance(self, pose: Pose, footprint: Footprint = CAR) -> float:
        """Return the distance between the car's outline and the nearest wall or obstacle, 0 in contact."""
        return min(self.world.clearance(pose, footprint), self._things.clearance(pose, footprint))

    def collides(self, pose: Pose, footprint: Footprint = CAR) -> bool:
        """Return whether the car's outline touches a wall or an obstacle."""
        return self.clearance(pose, footprint) <= 0.0


def _appears(obstacle: Obstacle, now_s: float, car: Pose, speed_mps: float) -> Pose | None:
    """Return the place where an obstacle appears now, or None while it does not."""
    appearance = obstacle.appearance
    if now_s < appearance.from_s:
        return None
    if isinstance(appearance, StandingObstacle):
        return appearance.pose
    if abs(speed_mps) < appearance.min_speed_mps:
        return None
    return car.ahead(LIDAR_AHEAD_M + appearance.ahead_m + obstacle.half_length_m, appearance.left_m)


def _geometry(present: Sequence[_Present], now_s: float) -> SegmentGeometry:
    segments: list[Floats] = []
    circles: list[tuple[float, float, float]] = []
    for item in present:
        at, shape = item.at(now_s), item.obstacle.shape
        if isinstance(shape, Round):
            circles.append((at.x_m, at.y_m, shape.radius_m))
        else:
            segments.append(box(at.x_m, at.y_m, shape.length_m, shape.width_m, at.yaw_rad))
    return SegmentGeometry(np.array(segments), np.array(circles))
