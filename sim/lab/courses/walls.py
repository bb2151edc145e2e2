"""Courses of `lab walls`: start, followed wall and length of each run.

t1 to t5 are the lab report's tests: close to a wall or far, facing it or away, and a corner. It gives no numbers; ours
are 0.5 and 1.5 times the wanted distance from a straight wall, 20 degrees, and an inside corner.
"Clean" means 0.02 m of noise and 2 % of wild beams; "dirty" adds smudges on the window from the first scan on, "rough"
30 mrad of mechanical trim, 60 ms from scan to wire and 30 mm of noise.
"""

import math
from dataclasses import dataclass, replace
from functools import lru_cache

import numpy as np

from wallride.sim.car.vehicle import VehicleSettings
from wallride.sim.lab.cell import DESIRED_M
from wallride.sim.lab.limit import Task, Wall
from wallride.sim.virtual.closed_loop import ROUGH_BEAMS, Case
from wallride.sim.world.beams import LidarSettings
from wallride.sim.world.place import World
from wallride.sim.world.pose import CAR, Floats, Footprint, Pose, Side, side_sign
from wallride.sim.world.segments import SegmentGeometry
from wallride.sim.world.worlds import load_world

SEEN_WITHIN_RAD = math.radians(4.0)
"""Maximum angle to the normal; other beams are reflected away (control-and-safety notes: "within about 4 deg")."""
SLANT_RAD = math.radians(20.0)
ROUGH_LATENCY_S, ROUGH_TRIM_RAD, ROUGH_NOISE_M = 0.06, 0.03, 0.03
SMUDGES = ((-97.0, -94.5, 0.05), (40.0, 41.0, 0.12), (88.0, 89.5, 0.20))
"""(from, to) [deg] and range [m]: 2 to 5 mm wide, one of them in the sector of the wall search."""
_PANE_FROM_M, _PANE_TO_M = 3.0, 7.0


@dataclass(frozen=True, slots=True, eq=False)
class GlassWall:
    """World, part of whose wall is glass, with nothing behind it: a car hits it anywhere.

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


@dataclass(frozen=True, slots=True)
class Course:
    """Wall and start, for a wall on the left.

    distance, toward_rad, ahead_m: the start; distance is a share of the wanted one. way_m: length of the run.
    wall_segments: how many of the world's first segments are the followed wall; 0: a straight one at y = 1, whose doors
    and panes do not count.
    """

    world: str
    distance: float = 1.0
    toward_rad: float = 0.0
    ahead_m: float = 0.0
    way_m: float = 9.0
    wall_segments: int = 0
    glass: bool = False

    def start(self, world: World, desired_m: float) -> Pose:
        """Return the start pose of the run."""
        return world.start_at(distance_m=self.distance * desired_m, toward_wall_rad=self.toward_rad).ahead(self.ahead_m)


COURSES = {
    "t1": Course("straight", 0.5, SLANT_RAD, way_m=8.5, wall_segments=1),
    "t2": Course("straight", 0.5, -SLANT_RAD, way_m=8.5, wall_segments=1),
    "t3": Course("straight", 1.5, SLANT_RAD, way_m=8.5, wall_segments=1),
    "t4": Course("straight", 1.5, -SLANT_RAD, way_m=8.5, wall_segments=1),
    "t5": Course("inside_corner", ahead_m=2.0, wall_segments=2),
    "outside_corner": Course("outside_corner", ahead_m=1.5, wall_segments=2),
    "doorway": Course("doorway", ahead_m=2.0),
    "glass": Course("straight", glass=True),
    "u_turn": Course("u_turn", ahead_m=2.0, way_m=15.0, wall_segments=3),
    "u_turn_inner": Course("u_turn_inner", ahead_m=2.0, way_m=12.0, wall_segments=3),
    "curved": Course("curved", ahead_m=-3.0, way_m=24.0, wall_segments=-1),
}
"""Clean courses by name."""

STRAIGHT_COURSES = ("t1", "t2", "t3", "t4")
REPORT_COURSES = (*STRAIGHT_COURSES, "t5")
SPOILT = ("dirty", "rough")
ALL_COURSES = (*COURSES, *(f"{name} {spoilt}" for spoilt in SPOILT for name in REPORT_COURSES))


@lru_cache(maxsize=64)
def world_of(name: str, side: Side) -> World:
    """Return a built-in world; made once per process."""
    return load_world(name, side=side)


def case_of(scenario: str, speed_mps: float, mu: float, side: Side, seed: int, desired_m: float = DESIRED_M) -> Case:
    """Return the run of a course, "t1" or "t1 dirty"."""
    name, _, spoilt = scenario.partition(" ")
    return _spoil(course_case(COURSES[name], speed_mps, mu, side, seed, desired_m), spoilt, side)


def course_case(course: Course, speed_mps: float, mu: float, side: Side, seed: int, desired_m: float) -> Case:
    """Return the clean run of any course."""
    world = world_of(course.world, side)
    return Case(
        world,
        _start(course, side, desired_m),
        speed_mps,
        desired_m,
        side,
        distance_m=course.way_m,
        duration_s=4.0 * course.way_m / max(speed_mps, 0.5) + 5.0,
        standing_s=3.0,
        vehicle=VehicleSettings(grip_mu=mu),
        seed=seed,
        truth=None if course.wall_segments else world_of("straight", side),
        surroundings=_glazed(side) if course.glass else None,
    )


def limit_task(scenario: str, speed_mps: float, mu: float, desired_m: float = DESIRED_M) -> Task | None:
    """Return the optimal control problem of a course, the clean one's for its variants; None where it is 0."""
    course = COURSES[scenario.partition(" ")[0]]
    return course_task(course, speed_mps, mu, desired_m) if course.wall_segments else None


def course_task(course: Course, speed_mps: float, mu: float, desired_m: float) -> Task:
    """Return the optimal control problem of a course with a followed wall."""
    world = world_of(course.world, "left")
    vehicle = VehicleSettings(grip_mu=mu)
    start = course.start(world, desired_m)
    return Task(followed_wall(course), start, speed_mps, course.way_m, desired_m, vehicle=vehicle)


def followed_wall(course: Course) -> Wall:
    """Return the segments of the followed wall."""
    geometry = world_of(course.world, "left").geometry
    if not isinstance(geometry, SegmentGeometry):
        raise TypeError(f"the limit of {course.world} cannot be computed: its walls are not segments")
    count = course.wall_segments if course.wall_segments > 0 else len(geometry.segments_m) // 2
    return tuple((float(a), float(b), float(c), float(d)) for a, b, c, d in geometry.segments_m[:count])


def _start(course: Course, side: Side, desired_m: float) -> Pose:
    start = course.start(world_of(course.world, "left"), desired_m)
    return start if side == "left" else start.mirrored()


@lru_cache(maxsize=2)
def _glazed(side: Side) -> GlassWall:
    sign = side_sign(side)
    return GlassWall(world_of("straight", side), (_PANE_FROM_M, sign, _PANE_TO_M, sign))


def _spoil(case: Case, how: str, side: Side) -> Case:
    match how:
        case "dirty":
            smudges = SMUDGES if side == "left" else tuple((-to, -begin, range_m) for begin, to, range_m in SMUDGES)
            return replace(case, lidar=ROUGH_BEAMS.model_copy(update={"dirty_sectors": smudges}))
        case "rough":
            lidar = LidarSettings(noise_std_m=ROUGH_NOISE_M, outlier_share=0.02)
            vehicle = case.vehicle.model_copy(update={"trim_rad": ROUGH_TRIM_RAD})
            return replace(case, lidar=lidar, vehicle=vehicle, latency_s=ROUGH_LATENCY_S)
        case _:
            return case
