"""`lab covers`: a lidar whose front is covered or silent, from the start or from a moment while driving.

Every cover lies over the beams within an angle of straight ahead. The limit of avoidance is driven: the same run
once more, with a full brake from the first covered scan on. A contact that this run does not have is a failure; so is
every contact of a car that is covered from the start, where it could have stayed.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from wallride.drivers.api import MotorState, Scan
from wallride.runtime.arbitration.command import SafetyAssessment, Verdict
from wallride.runtime.control.guidance import Guard
from wallride.runtime.control.vehicle import GRAVITY_MPS2
from wallride.sim.car.vehicle import VehicleSettings
from wallride.sim.lab import laws
from wallride.sim.lab.cell import Cell, CellChoice, Experiment, Figures, TabledCell
from wallride.sim.lab.courses.walls import world_of
from wallride.sim.lab.figures import TOUCH_ABOVE_MPS, Row, by_law, chosen, common, distinct, number, text, worst
from wallride.sim.lab.laws import drive_case
from wallride.sim.lab.safety import stopping_m
from wallride.sim.virtual.closed_loop import ROUGH_BEAMS, Case, SimulatedRun, drive
from wallride.sim.world.beams import NO_RETURN_MM, LidarSettings, Millimetres
from wallride.sim.world.obstacles import ConstantMotion, Obstacle, Round, StandingObstacle, person
from wallride.sim.world.pose import CAR, Pose, side_sign

COVERS_MM = (3, 30, 60, 85, 100, 120, 140, 160, 170, None)
"""Ranges of the covered beams; None: no return."""
HALF_WIDTHS_DEG = (10, 30, 45, 60, 90, 119, 135)
MOMENTS = ("from the start", "driving")
WORLDS = ("dead end", "wall", "loop", "person stands", "person steps in")
QUICK_COVERS_MM, QUICK_HALF_WIDTHS_DEG, QUICK_WORLDS = (30, 120, 160, None), (10, 45, 90), ("dead end", "person stands")
COVER_NOISE_MM = 5.0
LASTS_S = 8.0
_WALL_AHEAD_M = {"dead end": 12.0, "wall": 8.0}
_PERSON_AHEAD_M = 9.0
_PERSON_RADIUS_M = 0.2
_LATENCY_S = 0.1
_SETTLED_S = 1.0
_MORE_ROOM_M = 2.5


@dataclass(frozen=True, slots=True)
class Cover:
    """Cover of the lidar: beams within half_width_deg of ahead read this from a time on, None: no return."""

    reads_mm: int | None
    half_width_deg: float
    from_s: float
    seed: int
    lidar: LidarSettings = ROUGH_BEAMS

    def __call__(self, reported_mm: Millimetres, now_s: float) -> Millimetres:
        """Return the covered ranges; two beams in a hundred remain outliers."""
        if now_s < self.from_s:
            return reported_mm
        lidar = self.lidar
        random = np.random.default_rng((self.seed, round(1000 * now_s)))
        covered = np.abs(np.linspace(lidar.first_deg, lidar.last_deg, lidar.beams)) <= self.half_width_deg + 1e-6
        covered &= random.random(lidar.beams) >= lidar.outlier_share
        if self.reads_mm is None:
            return np.where(covered, NO_RETURN_MM, reported_mm)
        reads_mm = np.maximum(0, np.rint(random.normal(self.reads_mm, COVER_NOISE_MM, lidar.beams)).astype(np.int64))
        return np.where(covered, reads_mm, reported_mm)


@dataclass(slots=True)
class Braker:
    """A guard that brakes in full from a time on, whatever the other guard decides: the physical limit."""

    guard: Guard
    from_s: float

    def look(self, scan: Scan, motor: MotorState | None) -> SafetyAssessment:
        """Let the guard look; then stop."""
        assessment = self.guard.look(scan, motor)
        return assessment if scan.stamp_s < self.from_s else Verdict(0.0, 0.0, "covered")

    def learn(self) -> None:
        """Let the guard learn."""
        self.guard.learn()


def cells(choice: CellChoice) -> list[Cell]:
    """Return what is to be run."""
    covers_mm = QUICK_COVERS_MM if choice.quick else COVERS_MM
    widths_deg = QUICK_HALF_WIDTHS_DEG if choice.quick else HALF_WIDTHS_DEG
    worlds = QUICK_WORLDS if choice.quick else WORLDS
    names = [
        f"{'silent' if reads_mm is None else f'{reads_mm} mm'}: {width_deg} deg: {moment}: {world}"
        for reads_mm in covers_mm
        for width_deg in widths_deg
        for moment in MOMENTS
        for world in worlds
    ]
    return choice.cells("covers", names)


def run(cell: Cell) -> SimulatedRun:
    """Drive one cell."""
    return drive_case(cell, case_of(cell))


def best(cell: Cell) -> SimulatedRun:
    """Drive one cell with a full brake from the first covered scan on."""
    case = case_of(cell)
    if cell.law.endswith("+none"):
        raise TypeError(f"{cell.law}: there is no safety to be covered; leave +none away")
    stack = laws.stack_in(cell, case)
    return drive(case, stack.follower, Braker(stack.judge, _cover(cell).from_s))


def case_of(cell: Cell) -> Case:
    """Return the run of a cell."""
    world = cell.scenario.split(": ")[3]
    cover = _cover(cell)
    names = {"dead end": "dead_end", "wall": "inside_corner", "loop": "loop"}
    return Case(
        world_of(names.get(world, "straight"), cell.side),
        start_speed_mps=cell.speed_mps if cover.from_s > 0.0 else 0.0,
        duration_s=max(cover.from_s, 0.0) + LASTS_S,
        standing_s=3.0,
        vehicle=VehicleSettings(grip_mu=cell.mu),
        obstacles=_people(cell, cover.from_s),
        seed=cell.seed,
        cover=cover,
    )


def _cover(cell: Cell) -> Cover:
    reads, width, moment, world = cell.scenario.split(": ")
    reads_mm = None if reads == "silent" else int(reads.split()[0])
    width_deg = float(width.split()[0])
    if moment == "from the start":
        return Cover(reads_mm, width_deg, 0.0, cell.seed)
    # While driving: far enough before the wall or the person to stop, another distance for each seed.
    random = np.random.default_rng((cell.seed, round(10 * cell.speed_mps), round(width_deg)))
    room_m = stopping_m(cell.speed_mps, _LATENCY_S, cell.mu * GRAVITY_MPS2) + random.uniform(0.05, _MORE_ROOM_M)
    ahead_m = _WALL_AHEAD_M.get(world, _PERSON_AHEAD_M - _PERSON_RADIUS_M) - CAR.front_m
    way_m = ahead_m - room_m if world != "loop" else random.uniform(1.0, 16.0)
    return Cover(reads_mm, width_deg, max(_SETTLED_S, way_m / cell.speed_mps), cell.seed)


def _people(cell: Cell, from_s: float) -> tuple[Obstacle, ...]:
    world = cell.scenario.split(": ")[3]
    sign = side_sign(cell.side)
    if world == "person stands":
        near_m = 1.5 if from_s <= 0.0 else _PERSON_AHEAD_M
        return (Obstacle(Round(_PERSON_RADIUS_M), StandingObstacle(Pose(near_m, 0.1 * sign, 0.0))),)
    if world == "person steps in":
        near_m = 2.0 if from_s <= 0.0 else _PERSON_AHEAD_M
        walk = ConstantMotion(0.0, 0.8 * sign, from_s, from_s + 1.0)
        aside = person(near_m, -0.7 * sign, walk, _PERSON_RADIUS_M)
        return (Obstacle(aside.shape, StandingObstacle(Pose(near_m, -0.7 * sign, 0.0)), walk),)
    return ()


def measure(cell: Cell) -> Figures:
    """Drive one cell, and after a contact once more with a full brake, to find out whether it was avoidable."""
    done = run(cell)
    figures = common(done)
    avoidable = bool(figures["collided"])
    if avoidable:
        contact = best(cell).contact
        avoidable = contact is None or contact.speed_mps <= TOUCH_ABOVE_MPS
    from_s = _cover(cell).from_s
    reads, width, moment, world = cell.scenario.split(": ")
    return {
        **figures,
        "cover": reads,
        "half_width_deg": int(width.split()[0]),
        "moment": moment,
        "world": world,
        "avoidable": avoidable,
        "way_after_m": number(_way_after_m(done, from_s)),
        "stands": bool(abs(done.speed_mps[-1, 0]) < TOUCH_ABOVE_MPS),
        "says": done.reasons[-1],
    }


def _way_after_m(done: SimulatedRun, from_s: float) -> float:
    places = done.pose[done.time_s >= from_s, :2]
    return float(np.hypot(*np.diff(places, axis=0).T).sum()) if len(places) > 1 else math.nan


def tables(rows: Sequence[Row]) -> list[TabledCell]:
    """Return one table per law: a row per cover, a column per width."""
    made = []
    for law, some in by_law(rows):
        widths_deg = sorted(distinct(some, "half_width_deg"))
        lines = []
        for moment in distinct(some, "moment"):
            for cover in distinct(some, "cover"):
                those = chosen(some, moment=moment, cover=cover)
                lines.append((f"{cover}, {moment}", *(_cell(chosen(those, half_width_deg=deg)) for deg in widths_deg)))
        avoidable, touched = (sum(row[what] for row in some) for what in ("avoidable", "collided"))
        note = f"{avoidable} of {len(some)} runs with a contact that a brake avoids; {touched} with any contact"
        columns = ("cover", *(f"+-{deg} deg" for deg in widths_deg))
        made.append(TabledCell(f"{law}: avoidable contacts, most way after", columns, tuple(lines), (note,)))
    return made


def _cell(rows: Sequence[Row]) -> str:
    if not rows:
        return "-"
    return f"{sum(row['avoidable'] for row in rows)} of {len(rows)}, {text(worst(rows, 'way_after_m'), 1)} m"


EXPERIMENT = Experiment(measure, cells, tables)
