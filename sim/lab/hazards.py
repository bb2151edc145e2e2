"""`lab hazards`: obstacles that the navigator ignores, and normal drives in which a stop is needless.

A hazard run is good when nothing is touched while the car moves. A normal run is one of the clean courses of
`lab walls`, driven by the law itself: every stop by safety is needless there, and so is every reduction of speed.
"""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass

from wallride.sim.car.vehicle import VehicleSettings
from wallride.sim.lab.cell import Cell, CellChoice, Experiment, Figures, TabledCell
from wallride.sim.lab.courses.sudden import BlindDriver
from wallride.sim.lab.courses.walls import COURSES, SLANT_RAD, STRAIGHT_COURSES, case_of, world_of
from wallride.sim.lab.figures import Row, by_law, chosen, common, distinct, text
from wallride.sim.lab.laws import drive_case
from wallride.sim.lab.limits import limit_m
from wallride.sim.virtual.closed_loop import Case, SimulatedRun
from wallride.sim.world.obstacles import Box, ConstantMotion, Obstacle, Round, StandingObstacle, person, pole
from wallride.sim.world.pose import CAR, Pose, side_sign

NORMAL = "normal "
AT_M = 4.0
"""Distance of the obstacles ahead of the rear axle's start."""
_WALKING_MPS = 1.5
_CUT_RAD = 0.3


@dataclass(frozen=True, slots=True)
class Hazard:
    """A world, the obstacles in it, and the turn of the blind navigator. For a car that starts at the origin.

    things: of the speed, because a person has to arrive at the same time as the car.
    turns_after_m: when the navigator begins to steer by steering_rad, left positive.
    """

    things: Callable[[float], tuple[Obstacle, ...]] = lambda _: ()
    world: str = "straight"
    slant_rad: float = 0.0
    steering_rad: float = 0.0
    turns_after_m: float = 0.0


def _box(x_m: float, y_m: float, length_m: float = 0.3, width_m: float = 0.4) -> Obstacle:
    return Obstacle(Box(length_m, width_m), StandingObstacle(Pose(x_m, y_m, 0.0)))


def _walker(speed_mps: float, from_y_m: float, until_m: float = 10.0) -> tuple[Obstacle, ...]:
    """Return a person who crosses, and is in the middle of the way when the bumper comes to AT_M, or stays there."""
    arrives_s = (AT_M - CAR.front_m) / speed_mps
    walking_mps = min(_WALKING_MPS, abs(from_y_m) / arrives_s)
    starts_s = arrives_s - abs(from_y_m) / walking_mps
    way = -walking_mps if from_y_m > 0 else walking_mps
    motion = ConstantMotion(0.0, way, starts_s, starts_s + until_m / walking_mps)
    return (person(AT_M, from_y_m, motion),)


def _comer(from_x_m: float, y_m: float, walking_mps: float = _WALKING_MPS) -> tuple[Obstacle, ...]:
    """Return a person who walks straight at the car all the time and does not stop for it."""
    return (person(from_x_m, y_m, ConstantMotion(-walking_mps, 0.0)),)


HAZARDS = {
    "box": Hazard(lambda _: (_box(AT_M, 0.0),)),
    "box at the edge": Hazard(lambda _: (_box(AT_M, -0.3),)),
    "pole 2 cm": Hazard(lambda _: (pole(AT_M, 0.0, 0.01),)),
    "pole 2 cm at the edge": Hazard(lambda _: (pole(AT_M, 0.13, 0.01),)),
    "pole 5 cm": Hazard(lambda _: (pole(AT_M, -0.05, 0.025),)),
    "chair legs": Hazard(lambda _: tuple(pole(AT_M + x, y, 0.012) for x in (0.0, 0.4) for y in (-0.1, 0.3))),
    "narrow gap": Hazard(lambda _: (_box(AT_M, 0.35, width_m=0.5), _box(AT_M, -0.35, width_m=0.5))),
    "person stands": Hazard(lambda _: (Obstacle(Round(0.2), StandingObstacle(Pose(AT_M, 0.1, 0.0))),)),
    "person crosses": Hazard(lambda speed_mps: _walker(speed_mps, -2.6)),
    "person stops in the way": Hazard(lambda speed_mps: _walker(speed_mps, -2.6, until_m=2.6)),
    "person comes": Hazard(lambda _: _comer(10.0, 0.0)),
    "person comes at the edge": Hazard(lambda _: _comer(9.0, 0.3, 1.2)),
    "dead end": Hazard(world="dead_end"),
    "wall across": Hazard(world="inside_corner"),
    "wall aslant": Hazard(slant_rad=SLANT_RAD),
    "corner cut": Hazard(world="l_turn_inner", steering_rad=_CUT_RAD, turns_after_m=4.6),
    "bend into a pole": Hazard(lambda _: (pole(3.9, -0.9, 0.02),), steering_rad=-0.12, turns_after_m=1.0),
}
"""Obstacles that the navigator ignores, on the left as on the right side (mirrored)."""

QUICK_HAZARDS = ("box", "pole 2 cm", "person crosses", "dead end")
QUICK_NORMAL = ("t2", "t5")


def cells(choice: CellChoice) -> list[Cell]:
    """Return what is to be run."""
    hazards = QUICK_HAZARDS if choice.quick else tuple(HAZARDS)
    normal = QUICK_NORMAL if choice.quick else tuple(COURSES)
    planned = choice.cells("hazards", [*hazards, *(NORMAL + name for name in normal)])
    return [cell for cell in planned if not _hopeless(cell)]


def _hopeless(cell: Cell) -> bool:
    """Return whether contact is unavoidable from a start this near to a wall at this speed: a stop is not needless."""
    name = cell.scenario.removeprefix(NORMAL)
    return name in STRAIGHT_COURSES and math.isnan(limit_m(name, cell.speed_mps, cell.mu))


def run(cell: Cell) -> SimulatedRun:
    """Drive one cell."""
    if cell.scenario.startswith(NORMAL):
        case = case_of(cell.scenario.removeprefix(NORMAL), cell.speed_mps, cell.mu, cell.side, cell.seed)
        return drive_case(cell, case)
    return drive_case(cell, *case_of_hazard(cell))


def case_of_hazard(cell: Cell) -> tuple[Case, BlindDriver]:
    """Return the drive of a cell of HAZARDS, and its navigator."""
    hazard = HAZARDS[cell.scenario]
    sign = side_sign(cell.side)
    world = world_of(hazard.world, cell.side)
    case = Case(
        world,
        Pose(0.0, 0.0, sign * hazard.slant_rad),
        cell.speed_mps,
        distance_m=12.0,
        duration_s=12.0 / cell.speed_mps + 6.0,
        standing_s=2.0,
        vehicle=VehicleSettings(grip_mu=cell.mu),
        obstacles=tuple(thing.mirrored() if sign < 0 else thing for thing in hazard.things(cell.speed_mps)),
        seed=cell.seed,
    )
    turns_at_s = hazard.turns_after_m / cell.speed_mps
    return case, BlindDriver(cell.speed_mps, sign * hazard.steering_rad, turns_at_s)


def measure(cell: Cell) -> Figures:
    """Drive one cell."""
    done = run(cell)
    normal = cell.scenario.startswith(NORMAL)
    figures = common(done)
    return {**figures, "normal": normal, "needless_stop": normal and figures["safety_stops"] > 0}


def tables(rows: Sequence[Row]) -> list[TabledCell]:
    """Return one table per law: a row per hazard and per normal drive."""
    made = []
    for law, some in by_law(rows):
        mus = sorted(distinct(some, "mu"))
        hazards, normal = chosen(some, normal=False), chosen(some, normal=True)
        order = [name for name in HAZARDS if name in distinct(hazards, "scenario")]
        lines = [(name, *(_touched(chosen(hazards, scenario=name, mu=mu)) for mu in mus)) for name in order]
        touched = sum(row["collided"] for row in hazards)
        made.append(
            TabledCell(
                f"{law}: hazards touched while moving, of runs",
                ("hazard", *(f"mu {mu:g}" for mu in mus)),
                tuple(lines),
                (f"{touched} of {len(hazards)} hazard runs with a contact",),
            )
        )
        made.append(_needless(law, normal))
    return made


def _touched(rows: Sequence[Row]) -> str:
    touched = [row for row in rows if row["collided"]]
    if not touched:
        return f"0 of {len(rows)}"
    speeds = ", ".join(f"{speed:g}" for speed in sorted({row["speed_mps"] for row in touched}))
    return f"{len(touched)} of {len(rows)} (at {speeds} m/s)"


def _needless(law: str, rows: Sequence[Row]) -> TabledCell:
    lines = []
    for name in distinct(rows, "scenario"):
        some = chosen(rows, scenario=name)
        lost = 100 * sum(row["speed_lost"] or 0.0 for row in some) / len(some)
        stopped, good = (sum(row[what] for row in some) for what in ("needless_stop", "stopped_for_good"))
        lines.append((name, f"{stopped} of {len(some)}", str(good), text(lost, 1)))
    stopped = sum(row["needless_stop"] for row in rows)
    lost = 100 * sum(row["speed_lost"] or 0.0 for row in rows) / max(1, len(rows))
    return TabledCell(
        f"{law}: normal drives",
        ("drive", "with a needless stop", "for good", "speed lost %"),
        tuple(lines),
        (f"{stopped} of {len(rows)} normal runs with a needless stop, {lost:.1f} % of the speed lost",),
    )


EXPERIMENT = Experiment(measure, cells, tables)
