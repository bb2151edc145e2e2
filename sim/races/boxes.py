"""Boxes in a race: one that stands on the line or moves, as in races' entry test, or one that appears before the car.

A box is 35 cm long and 32 cm wide. The standing one is on the line or 15 cm beside it, at a place that the seed
chooses. The moving one is there when a car that meets none would be: on its way across the line, or ahead along it. The
sudden one appears at the 28 distances and least speeds of `lab safety`, which the seed chooses, too. The
car drives its first lap at the full speed of its line. What a box may be hit with that appears or begins to move is
measured: in the same race, the car brakes in full from the first scan on that shows it.
"""

from dataclasses import replace
from typing import Final

import numpy as np

from wallride.runtime.control.line_following.race_line import CourseLine
from wallride.sim.lab.cell import Figures
from wallride.sim.lab.figures import number
from wallride.sim.lab.safety import DISTANCES_M
from wallride.sim.races.mapped_lap import KeyframePoses
from wallride.sim.virtual.closed_loop import Case, SimulatedRun
from wallride.sim.world.obstacles import Box, ConstantMotion, Obstacle, StandingObstacle, sudden_box
from wallride.sim.world.pose import Pose

STANDING, MOVING, SUDDEN = "standing", "moving", "sudden"
LENGTH_M, WIDTH_M = 0.35, 0.32
STANDING_ASIDE_M, SUDDEN_ASIDE_M = (0.0, 0.15, -0.15), (0.0, 0.2, -0.2)
FIRST_M, LAST_M = 12.0, 2.0
"""Way from the start, where the car has its speed (at most the first 0.4 of the lap), and before the lap's end."""
FIRST_SHARE = 0.4
LEAST_MPS, APPEARS_S = (1.0, 2.0, 3.0, 4.0), (3.0, 15.0)
LASTS_S, STANDS_S, WAY_LAPS = 60.0, 8.0, 1.3
"""Duration of a drive, the standstill that ends it, and its way: time to back out and go round a box."""
MOVES_MPS, ASIDE_M, AHEAD_M, AHEAD_S = (0.3, 1.0), 1.0, 2.5, 1.5
"""Speeds of a moving box, its longest way to and from the line, its longest way ahead, begun before the car comes."""
FROM_WALL_M, NEAR_M = 0.25, 0.3
"""Distance of its middle from walls, where it begins and ends; and from where the car is nearest, where it comes."""
FULL_SPEED: Final = "first_lap_share"
"""The setting of `line` that slows the first lap down."""


def with_box(case: Case, kind: str, line: CourseLine, poses: KeyframePoses, alone: SimulatedRun | None = None) -> Case:
    """Return a race with a box of its seed. poses: of the map's keyframes. alone: the race without one, for MOVING."""
    random = np.random.default_rng(case.seed)
    box = _sudden(random, case.seed) if kind == SUDDEN else _standing(random, line, poses)
    if alone is not None:
        box = _moving(random, box, case, alone)
    return replace(timed(case, line), obstacles=(box,))


def timed(case: Case, line: CourseLine) -> Case:
    """Return a race that ends as one with a box does."""
    return replace(case, duration_s=LASTS_S, standing_s=STANDS_S, distance_m=WAY_LAPS * line.length_m)


def _standing(random: np.random.Generator, line: CourseLine, poses: KeyframePoses) -> Obstacle:
    first_m = min(FIRST_M, FIRST_SHARE * line.length_m)
    at = int(np.argmin(np.abs(line.along_m - random.uniform(first_m, line.length_m - LAST_M))))
    yaw_rad = float(line.yaw_rad[at])
    place_m = line.places_m[at] + 1j * float(random.choice(STANDING_ASIDE_M)) * np.exp(1j * yaw_rad)
    in_world = KeyframePoses(poses.found, poses.true)
    x_m, y_m, turned_rad = in_world.of(np.array([[place_m.real, place_m.imag, yaw_rad]]))[0]
    return Obstacle(Box(LENGTH_M, WIDTH_M), StandingObstacle(Pose(float(x_m), float(y_m), float(turned_rad))))


def _moving(random: np.random.Generator, box: Obstacle, case: Case, alone: SimulatedRun) -> Obstacle:
    """Return a box that is where a standing one is when the car comes there: on its way across, or ahead, by seed."""
    assert isinstance(box.appearance, StandingObstacle)  # noqa: S101 - `_standing` makes no other
    there = box.appearance.pose
    near_m = np.hypot(alone.pose[:, 0] - there.x_m, alone.pose[:, 1] - there.y_m)
    comes_s = float(alone.time_s[np.flatnonzero(near_m <= near_m.min() + NEAR_M)[0]])
    speed_mps = float(random.uniform(*MOVES_MPS))
    ways_rad = there.yaw_rad + np.array([0.0, np.pi / 2, -np.pi / 2])
    ahead_m, left_m, right_m = case.world.cast(there.x_m, there.y_m, ways_rad) - FROM_WALL_M
    if case.seed % 2:
        yaw_rad, before_m, after_m = there.yaw_rad, 0.0, min(AHEAD_M, ahead_m)
        comes_s -= AHEAD_S
    else:
        yaw_rad = there.yaw_rad + (np.pi / 2 if right_m > left_m else -np.pi / 2)
        before_m, after_m = (min(ASIDE_M, way_m) for way_m in (max(left_m, right_m), min(left_m, right_m)))
    way = np.exp(1j * yaw_rad)
    motion = ConstantMotion(
        speed_mps * way.real, speed_mps * way.imag, comes_s - before_m / speed_mps, comes_s + after_m / speed_mps
    )
    begin = Pose(there.x_m - before_m * way.real, there.y_m - before_m * way.imag, there.yaw_rad)
    return Obstacle(box.shape, StandingObstacle(begin), motion)


def _sudden(random: np.random.Generator, seed: int) -> Obstacle:
    distances = len(DISTANCES_M)
    return sudden_box(
        DISTANCES_M[seed % distances], width_m=WIDTH_M, depth_m=LENGTH_M, left_m=float(random.choice(SUDDEN_ASIDE_M)),
        min_speed_mps=LEAST_MPS[seed // distances % len(LEAST_MPS)], from_s=float(random.uniform(*APPEARS_S)),
    )  # fmt: skip


def shown_at(run: SimulatedRun) -> int | None:
    """Return the index of the first scan that could show the box, None where it did not appear."""
    shown = np.flatnonzero(run.appeared)
    return int(shown[0]) if shown.size else None


def surprises_at_s(run: SimulatedRun, case: Case) -> float | None:
    """Return when the first scan shows a box that appears, or one that begins to move; None for one that stands."""
    (box,), shown = case.obstacles, shown_at(run)
    if shown is None or (isinstance(box.appearance, StandingObstacle) and box.motion is None):
        return None
    begins_s = box.motion.from_s if box.motion is not None else 0.0
    return max(float(run.time_s[shown]), begins_s)


def box_figures(run: SimulatedRun, braked: SimulatedRun | None) -> Figures:
    """Return how a box was met: at the speed when a sudden one shows; at most at the drive's highest, where one stands.

    braked: the drive with a full brake, None where none was needed.
    """
    fastest_mps = float(run.speed_mps[:, 0].max())
    shown, hit_mps = shown_at(run), run.contact.speed_mps if run.contact is not None else 0.0
    brake_mps = braked.contact.speed_mps if braked is not None and braked.contact is not None else 0.0
    return {
        "box_shown": shown is not None,
        "met_at_mps": number(run.speed_mps[shown, 0] if shown else fastest_mps) if shown is not None else None,
        "hit_mps": number(hit_mps),
        "brake_mps": number(brake_mps),
        "excess_mps": number(hit_mps - brake_mps),
    }
