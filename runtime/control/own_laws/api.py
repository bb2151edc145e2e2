"""What a law of the user is given and what it answers; public as `wallride.laws`.

SI units throughout. Frames: lidar (x forward, y left, angles counter-clockwise from ahead) and base_link, the middle of
the rear axle (x forward, y left); REP-103 and REP-105.
"""

import math
from dataclasses import dataclass
from typing import Literal

import numpy as np

from wallride.drivers.section import Section
from wallride.runtime.control.perception.geometry import Floats


class LawSettings(Section):
    """Base class of a law's settings: a pydantic model, closed to unknown keys; every key needs a default."""


@dataclass(frozen=True, slots=True, eq=False)
class LawScan:
    """One lidar revolution. All arrays have one row per beam, from the right to the left.

    stamp_s: monotonic time of the measurement.
    angles_rad: (n,) bearing of each beam in the lidar frame, 0 ahead, positive to the left; read-only.
    ranges_m: (n,) distance from the lidar; NaN where there is no information: no echo, dirt on the window, an outlier,
        or a part of the car itself. NaN is neither an obstacle nor free space.
    lidar_x_m, lidar_y_m: distance of the lidar ahead of the rear axle, and left of the middle line.
    """

    stamp_s: float
    angles_rad: Floats
    ranges_m: Floats
    lidar_x_m: float
    lidar_y_m: float = 0.0

    def points_m(self) -> Floats:
        """Return the end points of the beams in base_link, shape (2, n): x ahead, y to the left; NaN as in ranges_m."""
        x_m = self.ranges_m * np.cos(self.angles_rad) + self.lidar_x_m
        return np.stack([x_m, self.ranges_m * np.sin(self.angles_rad) + self.lidar_y_m])


@dataclass(frozen=True, slots=True)
class LawState:
    """The car at the time of a scan, and what is wanted of it.

    speed_mps: of the wheels, positive forward. steering_rad: last commanded, positive to the left.
    x_m, y_m, yaw_rad: odometry of the rear axle since the start; drifts.
    side, desired_distance_m, desired_speed_mps: the settings `wall_follow.side`, `.desired_distance_m`, `.speed_mps`.
    """

    speed_mps: float
    steering_rad: float
    x_m: float
    y_m: float
    yaw_rad: float
    side: Literal["left", "right"]
    desired_distance_m: float
    desired_speed_mps: float


@dataclass(frozen=True, slots=True, eq=False)
class LawGuidance:
    """Answer of a follower: how to drive until the next scan.

    speed_mps: positive forward; exactly 0 brakes. steering_rad: angle of the front wheels, positive to the left. Both
        are clamped to the car's limits.
    distance_m: from the rear axle to the followed wall, for plots and the report; NaN where it is not known.
    reason: a short constant text for status and log, e.g. "gap".
    path_m, path_mps: the way that it will drive, (2, n) in base_link from (0, 0) on, points 0.1 to 0.5 m apart, and the
        speed at each, (n,): safety then judges that in place of the arc of steering_rad, if it is kept.
    """

    speed_mps: float
    steering_rad: float
    distance_m: float = math.nan
    reason: str = ""
    path_m: Floats | None = None
    path_mps: Floats | None = None


@dataclass(frozen=True, slots=True)
class LawLimit:
    """Answer of a safety law: the maximum speed until the next scan, whatever is commanded and by which source.

    forward_mps, reverse_mps: >= 0; 0 is a stop that brakes, infinity no objection. reason: a short constant text.
    """

    forward_mps: float = math.inf
    reverse_mps: float = math.inf
    reason: str = ""
