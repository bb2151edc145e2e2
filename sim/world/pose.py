"""Pose, velocity and footprint of the car.

Frames: the world is x, y, counter-clockwise; a pose is that of the middle of the rear axle, x forward, y left.
"""

import math
from dataclasses import dataclass
from typing import Literal

import numpy as np
import numpy.typing as npt

Floats = npt.NDArray[np.float64]
Booleans = npt.NDArray[np.bool_]
Side = Literal["left", "right"]


def side_sign(side: Side) -> float:
    """Return +1.0 for the left and -1.0 for the right, the signs of y in the car's frame."""
    return 1.0 if side == "left" else -1.0


def other_side(side: Side) -> Side:
    """Return the opposite side."""
    return "right" if side == "left" else "left"


@dataclass(frozen=True, slots=True)
class Pose:
    """Position and heading of the rear axle in the world."""

    x_m: float
    y_m: float
    yaw_rad: float

    def ahead(self, forward_m: float, left_m: float = 0.0) -> "Pose":
        """Return the pose of a point fixed to the car, same heading."""
        cos, sin = math.cos(self.yaw_rad), math.sin(self.yaw_rad)
        return Pose(self.x_m + cos * forward_m - sin * left_m, self.y_m + sin * forward_m + cos * left_m, self.yaw_rad)

    def mirrored(self) -> "Pose":
        """Return the pose mirrored along the world's x axis."""
        return Pose(self.x_m, -self.y_m, -self.yaw_rad)


@dataclass(frozen=True, slots=True)
class Twist:
    """Velocity of the rear axle in the car's own frame; `lateral_mps` is non-zero only when the rear slides."""

    speed_mps: float = 0.0
    yaw_rate_radps: float = 0.0
    lateral_mps: float = 0.0


STANDING = Twist()


@dataclass(frozen=True, slots=True)
class Footprint:
    """The car's outline: a rectangle in its own frame. Defaults: the car of the lab, bumper 0.15 m before the lidar."""

    rear_m: float = -0.13
    front_m: float = 0.42
    half_width_m: float = 0.15

    @property
    def reach_m(self) -> float:
        """Return the distance from the rear axle to the outline's farthest corner."""
        return math.hypot(max(-self.rear_m, self.front_m), self.half_width_m)

    def corners(self) -> Floats:
        """Return the corners in the car's frame, shape (4, 2), counter-clockwise from the front left."""
        rear, front, half = self.rear_m, self.front_m, self.half_width_m
        return np.array([[front, half], [rear, half], [rear, -half], [front, -half]])

    def distance_to(self, x_m: Floats, y_m: Floats) -> Floats:
        """Return the distance from the outline to points in the car's frame; 0 inside. Any shape, same shape out."""
        outside_x = np.maximum(np.maximum(self.rear_m - x_m, x_m - self.front_m), 0.0)
        outside_y = np.maximum(np.abs(y_m) - self.half_width_m, 0.0)
        return np.hypot(outside_x, outside_y)


CAR = Footprint()


def into_frame(pose: Pose, x_m: Floats, y_m: Floats) -> tuple[Floats, Floats]:
    """Return world points in the frame of a pose."""
    cos, sin = math.cos(pose.yaw_rad), math.sin(pose.yaw_rad)
    dx, dy = x_m - pose.x_m, y_m - pose.y_m
    return cos * dx + sin * dy, cos * dy - sin * dx
