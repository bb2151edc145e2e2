"""Pane of glass in a wall: a lidar sees it only at nearly normal incidence, a car hits it anywhere."""

import math
from dataclasses import dataclass

import numpy as np

from wallride.sim.world.place import World
from wallride.sim.world.pose import CAR, Floats, Footprint, Pose
from wallride.sim.world.segments import SegmentGeometry

SEEN_WITHIN_RAD = math.radians(4.0)
"""Maximum angle to the normal; other beams are reflected away (control-and-safety notes: "within about 4 deg")."""


@dataclass(frozen=True, slots=True, eq=False)
class GlassWall:
    """World, part of whose wall is glass, with nothing behind it.

    pane_m: (x0, y0, x1, y1), lying in a wall of the world.
    """

    world: World
    pane_m: tuple[float, float, float, float]

    def cast(self, x_m: float | Floats, y_m: float | Floats, bearing_rad: Floats) -> Floats:
        """Return distances as `World.cast`; inf where a beam meets the pane aslant."""
        walls_m = self.world.cast(x_m, y_m, bearing_rad)
        pane_m = SegmentGeometry(np.array(self.pane_m)).cast(x_m, y_m, bearing_rad)
        on_glass = pane_m <= walls_m + 1e-6
        x0, y0, x1, y1 = self.pane_m
        along_rad = math.atan2(y1 - y0, x1 - x0)
        square = np.abs(np.sin(bearing_rad - along_rad)) >= math.cos(SEEN_WITHIN_RAD)
        return np.where(on_glass & ~square, np.inf, walls_m)

    def clearance(self, pose: Pose, footprint: Footprint = CAR) -> float:
        """Return the distance to the walls, glass or not."""
        return self.world.clearance(pose, footprint)
