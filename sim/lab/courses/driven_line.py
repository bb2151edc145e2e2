"""A course for the law `line` in any world of the lab: a map of its walls, and the way that was driven in it as line.

The way is driven once in the world without obstacles and without safety, by the driver that the other laws have there:
`ball`, or the blind one of a hazard. It becomes a line with the speeds that `wallride line` gives by default. So what
is put in the way stands on the line as it stands in the way of the others, and the map does not have it.
"""

from dataclasses import replace
from functools import lru_cache
from typing import Final

import numpy as np
from scipy.ndimage import gaussian_filter1d

from wallride.runtime.control.guidance import Follower
from wallride.runtime.control.line_following.course import RaceCourse
from wallride.runtime.control.line_following.race_line import CourseLine
from wallride.runtime.control.localization.line_field import LineField, line_field
from wallride.runtime.control.localization.localizer import Localizer
from wallride.runtime.control.localization.wall_points import MapCells, WallPoints
from wallride.runtime.control.perception.geometry import Places
from wallride.sim.racing.speed_profile import Grip, speeds_mps
from wallride.sim.virtual.closed_loop import Case, drive
from wallride.sim.world.place import World
from wallride.sim.world.segments import SegmentGeometry

CELL_M: Final = 0.05
STEP_M, SMOOTH_STEPS = 0.1, 3.0
"""Distance of the line's points, and standard deviation of the weights by which its heading is smoothed."""
LONGER: Final = 1.5
"""Duration and way of the drive over those of the case: a car by the line may be faster."""
ON_M: Final = 10.0
"""Straight way after the end of the drive, so that a line that meets a wall goes on into it."""


def course_in(case: Case, driver: Follower, speed_mps: float, *, blind: bool) -> RaceCourse:
    """Return map and line of a case. driver: whose way becomes the line, at this speed at most; blind: through walls.

    The line does not close: its end is as far from its begin as the car got.
    """
    world = replace(case.world, geometry=SegmentGeometry()) if blind else case.world
    alone = replace(
        case, world=world, obstacles=(), cover=None, surroundings=None, duration_s=LONGER * case.duration_s,
        distance_m=LONGER * case.distance_m,
    )  # fmt: skip
    poses = drive(alone, driver, None).pose
    field, start = _field(case.world), case.start or case.world.start
    localizer = Localizer(field, case.car, (start.x_m, start.y_m, start.yaw_rad))
    line = line_along(poses[:, 0] + 1j * poses[:, 1], Grip(case.vehicle.grip_mu, speed_mps=speed_mps))
    return RaceCourse(case.world.name, field, localizer, line)


def line_along(places: Places, grip: Grip) -> CourseLine:
    """Return a line along a driven way. places: x + iy, (n,)."""
    way_m = np.concatenate([[0.0], np.cumsum(np.abs(np.diff(places)))])
    evenly = np.interp(np.arange(0.0, way_m[-1], STEP_M), way_m, places)
    driven_rad = np.unwrap(np.angle(np.diff(evenly)))
    yaw_rad = np.append(driven_rad, np.full(round(ON_M / STEP_M), driven_rad[-1]))
    yaw_rad = gaussian_filter1d(yaw_rad, SMOOTH_STEPS, mode="nearest")
    along = places[0] + np.concatenate([[0.0], np.cumsum(STEP_M * np.exp(1j * yaw_rad))[:-1]])
    curvature_radpm = np.gradient(yaw_rad, STEP_M)
    steps_m = np.append(np.full(along.size - 1, STEP_M), abs(along[0] - along[-1]))
    return CourseLine(
        along, STEP_M * np.arange(along.size), yaw_rad, curvature_radpm, speeds_mps(curvature_radpm, steps_m, grip),
        float(steps_m.sum()),
    )  # fmt: skip


@lru_cache(maxsize=16)
def _field(world: World) -> LineField:
    """Return the field of a world's walls, each seen from both sides."""
    begins, ends = (world.outline_m[:, at] + 1j * world.outline_m[:, at + 1] for at in (0, 2))
    steps = np.maximum(1, np.ceil(np.abs(ends - begins) / CELL_M)).astype(np.int64)
    wall = np.repeat(np.arange(steps.size), steps)
    number = np.arange(wall.size) - np.repeat(np.cumsum(steps) - steps, steps)
    places = begins[wall] + (ends - begins)[wall] * (number + 0.5) / steps[wall]
    normals = 1j * (ends - begins)[wall] / np.abs(ends - begins)[wall]
    corner_m = complex(places.real.min(), places.imag.min()) - CELL_M * (1 + 1j)
    there = (places - corner_m) / CELL_M
    column, row = there.real.astype(np.int64), there.imag.astype(np.int64)
    walls = np.zeros((int(row.max()) + 2, int(column.max()) + 2), dtype=np.bool_)
    walls[row, column] = True
    points = WallPoints(np.tile(places, 2), np.concatenate([normals, -normals]))
    return line_field(points, MapCells(walls, ~walls, CELL_M, corner_m))
