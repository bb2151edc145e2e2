"""`lab rooms --generated`: rooms generated from a seed, driven by the complete laws, and whether a way on existed.

A run lasts a minute. For a car that stands for good the search over poses (`wallride.sim.way_on`) determines whether a
way on existed from its place; every other car has shown that one did.
"""

from collections.abc import Sequence

import numpy as np

from wallride.sim.car.vehicle import VehicleSettings
from wallride.sim.lab.cell import Cell, CellChoice, Experiment, Figures, TabledCell
from wallride.sim.lab.figures import Row, by_law, chosen, common, distinct, mean, number, text, worst
from wallride.sim.lab.rooms import GIVEN_UP_S, STANDS_BELOW_MPS, STUCK_S, build, tries
from wallride.sim.virtual.closed_loop import Case, SimulatedRun, drive
from wallride.sim.virtual.way_on import way_on
from wallride.sim.world.generated_rooms import generated_room, kind_of
from wallride.sim.world.pose import Pose
from wallride.sim.world.segments import SegmentGeometry

DURATION_S = 60.0
MAX_SPEED_MPS = 3.0
SCENARIO = "generated"
STOOD_S = 0.5
"""Minimum duration of a stand; shorter ones are changes of direction."""
WENT_ON_M = 1.0
LEGEND: tuple[str, ...] = (
    "stands though a way exists: ends in a standstill of 10 s or more where a search over poses finds a way on",
    "way m: mean way driven. tries: attempts to back out. came out of: standstills that the car ended by itself,",
    "after s: how long these took on average; latest s: the longest",
)


def cells(choice: CellChoice) -> list[Cell]:
    """Return what is to be run: one room per seed, at up to 3 m/s."""
    return [cell for cell in choice.cells("generated_rooms", [SCENARIO]) if cell.speed_mps <= MAX_SPEED_MPS]


def run(cell: Cell) -> SimulatedRun:
    """Drive one cell."""
    world = generated_room(cell.seed)
    case = Case(
        world if cell.side == "left" else world.mirrored(), side=cell.side, duration_s=DURATION_S,
        standing_s=GIVEN_UP_S, vehicle=VehicleSettings(grip_mu=cell.mu), seed=cell.seed,
    )  # fmt: skip
    return drive(case, *build(cell, case))


def measure(cell: Cell) -> Figures:
    """Drive one cell."""
    done = run(cell)
    figures = common(done)
    moves = np.flatnonzero(np.abs(done.speed_mps[:, 0]) > STANDS_BELOW_MPS)
    stood_s = float(done.time_s[-1] - (done.time_s[moves[-1]] if moves.size else 0.0))
    stuck = stood_s > STUCK_S and not figures["collided"]
    return figures | {
        "kind": kind_of(cell.seed),
        "stuck": stuck,
        "way_exists": _way_exists(done) if stuck else True,
        "tries": tries(done.reasons),
        "last_words": done.reasons[-1],
        "stands": len(stands := stood_until_on_s(done)),
        "mean_until_on_s": number(float(np.mean(stands))) if stands else None,
        "latest_on_s": number(max(stands)) if stands else None,
    }


def _way_exists(done: SimulatedRun) -> bool:
    x_m, y_m, yaw_rad = done.pose[-1]
    geometry = done.case.world.geometry
    if not isinstance(geometry, SegmentGeometry):
        raise TypeError("a generated room is made of segments")
    return way_on(geometry, Pose(float(x_m), float(y_m), float(yaw_rad))).exists


def stood_until_on_s(done: SimulatedRun) -> list[float]:
    """Return, for each stand that the car came out of, the time until it was WENT_ON_M away for good.

    A stand begins when the car stands for STOOD_S; manoeuvres in between belong to it. One that lasts is left out.
    """
    period_s = 1.0 / done.case.lidar.rate_hz
    still = np.abs(done.speed_mps[:, 0]) < STANDS_BELOW_MPS
    edges = np.flatnonzero(np.diff(np.concatenate(([0], still.view(np.int8), [0]))))
    found: list[float] = []
    clear = 0
    for first, last in zip(edges[::2].tolist(), edges[1::2].tolist(), strict=True):
        if first < clear or (last - first) * period_s < STOOD_S or not done.time_s[first]:
            continue
        away_m = np.hypot(*(done.pose[first:, :2] - done.pose[first, :2]).T)
        gone = np.flatnonzero(away_m > WENT_ON_M)
        if not gone.size:
            break
        clear = first + int(gone[0])
        found.append(float(done.time_s[clear] - done.time_s[first]))
    return found


def tables(rows: Sequence[Row]) -> list[TabledCell]:
    """Return one table per law: a row per kind of room, and one for all of them."""
    made = []
    for law, some in by_law(rows):
        lines = [_line(chosen(some, kind=kind), kind) for kind in sorted(distinct(some, "kind"))]
        columns = (
            "room", "runs", "touched", "worst m/s", "stands though a way exists", "stands, no way", "way m", "tries",
            "came out of", "after s", "latest s", "last words of who stands",
        )  # fmt: skip
        made.append(TabledCell(f"{law}: generated rooms", columns, (*lines, _line(some, "all")), LEGEND))
    return made


def _line(rows: Sequence[Row], kind: str) -> tuple[str, ...]:
    had = [row for row in rows if row["way_exists"]]
    stuck = [row for row in had if row["stuck"]]
    words = sorted({row["last_words"] for row in rows if row["stuck"]})
    until_s = mean(rows, "mean_until_on_s")
    return (
        kind,
        str(len(rows)),
        str(sum(row["collided"] for row in rows)),
        text(worst([row for row in rows if row["collided"]], "impact_mps"), 2),
        f"{len(stuck)} of {len(had)}" + (f" ({100 * len(stuck) / len(had):.0f} %)" if had else ""),
        str(len(rows) - len(had)),
        text(mean(rows, "distance_m"), 0),
        str(sum(row["tries"] for row in rows)),
        str(sum(row["stands"] for row in rows)),
        text(until_s, 1),
        text(worst(rows, "latest_on_s"), 1),
        "; ".join(words),
    )


EXPERIMENT = Experiment(measure, cells, tables)
