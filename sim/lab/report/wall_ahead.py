"""One of the 25 safety trials: the car rides along a wall toward another that closes its way.

The report rides along a wall and varies start distance and speed; the wall ahead is ours, as are the distances to it.
The scenario "3 m" is the range ahead at the start. A trial is passed when the car was driven and nothing is touched: it
stands before the wall, or has turned away from it.
"""

import math
from collections.abc import Mapping
from typing import Any

from wallride.sim.lab import laws
from wallride.sim.lab.cell import Cell, Experiment, Figures
from wallride.sim.lab.courses.walls import world_of
from wallride.sim.lab.figures import common
from wallride.sim.virtual.closed_loop import ROUGH_BEAMS, Case
from wallride.sim.world.obstacles import LIDAR_AHEAD_M
from wallride.sim.world.place import World
from wallride.sim.world.pose import Side
from wallride.sim.world.segments import SegmentGeometry

NAME = "report.wall_ahead"
DISTANCES_M = (1.0, 2.0, 3.0, 5.0, 8.0)
SPEEDS_MPS = (0.5, 1.0, 2.0, 3.0, 4.0)
PAST_M = 4.0
"""Way that a run goes on beyond its start distance."""


def case_of(cell: Cell) -> Case:
    """Return the run of a trial."""
    world, ahead_m = world_of("inside_corner", cell.side), float(cell.scenario.removesuffix(" m"))
    start = world.start_at(distance_m=cell.desired_m)
    return Case(
        world,
        start.ahead(_to_the_wall_m(world, cell.side) - LIDAR_AHEAD_M - ahead_m - start.x_m),
        cell.speed_mps,
        cell.desired_m,
        cell.side,
        distance_m=ahead_m + PAST_M,
        duration_s=4.0 * (ahead_m + PAST_M) / cell.speed_mps + 5.0,
        standing_s=2.0,
        vehicle=Case(world, None, 0.0).vehicle.model_copy(update={"grip_mu": cell.mu}),
        lidar=ROUGH_BEAMS,
        seed=cell.seed,
    )


def _to_the_wall_m(world: World, side: Side) -> float:
    geometry = world_of("inside_corner", side).geometry
    if not isinstance(geometry, SegmentGeometry):
        raise TypeError(f"{world.name}: its walls are not segments")
    return float(geometry.segments_m[:, [0, 2]].max())


def was_driven(law: str, figures: Mapping[str, Any]) -> bool:
    """Tell whether the follower ever asked for a speed: one that never does avoids nothing.

    Of the report's law by the letter the turn of its safety is a stop, in the follower's place.
    """
    return figures["speed_lost"] is not None or law.startswith("report+")


def measure(cell: Cell) -> Figures:
    """Drive one trial."""
    done = laws.drive_case(cell, case_of(cell))
    figures = common(done)
    passed = done.contact is None and was_driven(cell.law, figures)
    return {**figures, "passed": passed, "stood": math.isclose(done.speed_mps[-1, 0], 0.0, abs_tol=0.05)}


EXPERIMENT = Experiment(measure)
