"""Several cars in one world: each sees and hits the outlines of the others."""

from collections.abc import Sequence

import numpy as np

from wallride.runtime.control.laws import LiveLaws
from wallride.runtime.settings.tree import Settings
from wallride.sim.car.vehicle import Vehicle
from wallride.sim.live.session import SessionError
from wallride.sim.virtual.closed_loop import Case, drive
from wallride.sim.world.obstacles import Obstacle, ObstacleWorld
from wallride.sim.world.place import World
from wallride.sim.world.pose import CAR, Floats, Footprint, Pose
from wallride.sim.world.segments import SegmentGeometry

APART_M = 3.0
"""Distance of the starts where the world has no lap; on a lap the cars stand evenly."""
APART_SHARE = 0.15
"""Share of the distance by which a start may be moved, out of a corner."""


class TrafficWorld(ObstacleWorld):
    """A world with obstacles, and with the other cars where they are at this moment."""

    def __init__(self, world: World, obstacles: Sequence[Obstacle], others: Sequence[Vehicle]) -> None:
        super().__init__(world, list(obstacles))
        self._others = tuple(others)

    def cast(self, x_m: float | Floats, y_m: float | Floats, bearing_rad: Floats) -> Floats:
        """Return the distance to the nearest wall, obstacle or car along each bearing, shape (n,)."""
        return np.minimum(super().cast(x_m, y_m, bearing_rad), self._cars().cast(x_m, y_m, bearing_rad))

    def clearance(self, pose: Pose, footprint: Footprint = CAR) -> float:
        """Return the distance between the car's outline and the nearest wall, obstacle or car, 0 in contact."""
        return min(super().clearance(pose, footprint), self._cars().clearance(pose, footprint))

    @property
    def obstacle_outline_m(self) -> Floats:
        """Return the segments of obstacles and cars, to draw."""
        return np.vstack([self._things.outline_m, self._cars().outline_m])

    def _cars(self) -> SegmentGeometry:
        return SegmentGeometry(np.array([outline_m(vehicle.pose) for vehicle in self._others]).reshape(-1, 4))


def outline_m(pose: Pose, footprint: Footprint = CAR) -> Floats:
    """Return a car's outline in the world as segments (x0, y0, x1, y1), shape (4, 4)."""
    corners = [(at.x_m, at.y_m) for at in (pose.ahead(x_m, y_m) for x_m, y_m in footprint.corners())]
    return np.array([[*corners[i], *corners[(i + 1) % 4]] for i in range(4)])


def starts(world: World, count: int, settings: Settings) -> list[Pose]:
    """Return a start for each car, along the way that a car alone drives; the first is the world's own.

    ValueError when the car does not come that far, SessionError where a law of the user's has failed on it.
    """
    gap_m = world.lap.length_m / count if world.lap is not None else APART_M
    laws = LiveLaws(settings.wall_follow, settings.safety, settings.car)
    way_m = gap_m * (count - 1)
    follow = settings.wall_follow
    case = Case(
        world, side=follow.side, desired_m=follow.desired_distance_m, distance_m=way_m + gap_m / 2,
        duration_s=10.0 + 4.0 * (way_m + gap_m) / max(0.1, follow.speed_mps), standing_s=3.0,
    )  # fmt: skip
    run = drive(case, laws, laws)
    poses = np.vstack([[world.start.x_m, world.start.y_m, world.start.yaw_rad], run.pose])
    driven_m = np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(poses[:, :2], axis=0).T))])
    if laws.own_law_fault:
        raise SessionError(f"{laws.own_law_fault}; a car alone drove {driven_m[-1]:.0f} m, to find the starts")
    if driven_m[-1] < way_m or run.contact is not None:
        raise ValueError(
            f"{world.name} has no place for {count} cars: a car alone ends after {driven_m[-1]:.0f} m of {way_m:.0f} m"
        )
    off_line_m = np.abs(np.concatenate([[0.0], run.error_m]))
    places = [0, *(_near(driven_m, off_line_m, gap_m * k, APART_SHARE * gap_m) for k in range(1, count))]
    return [Pose(*(float(number) for number in poses[place])) for place in places]


def _near(driven_m: Floats, off_line_m: Floats, at_m: float, within_m: float) -> int:
    """Return the place near a way at which the car is best on its line: it sets off as a car that drives."""
    return int(np.argmin(np.where(np.abs(driven_m - at_m) <= within_m, off_line_m, np.inf)))
