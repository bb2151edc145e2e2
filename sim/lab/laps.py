"""`lab laps`: the rectangular loop, its inner wall, and real maps; from a standstill, at the law's own speed."""

from collections.abc import Sequence
from functools import lru_cache
from pathlib import Path

from wallride.sim.car.vehicle import VehicleSettings
from wallride.sim.lab.cell import DESIRED_M, Cell, CellChoice, Experiment, Figures, TabledCell
from wallride.sim.lab.figures import (
    Row,
    by_law_and_friction,
    chosen,
    common,
    distinct,
    errors,
    mean,
    number,
    speed_table,
    text,
)
from wallride.sim.lab.laws import drive_case
from wallride.sim.virtual.closed_loop import Case, SimulatedRun
from wallride.sim.world.generated_tracks import generated_track
from wallride.sim.world.lap import LapCounter
from wallride.sim.world.place import World
from wallride.sim.world.pose import Side
from wallride.sim.world.worlds import load_world

LOOPS = ("loop", "loop_inner")
GENERATED = ("generated outer", "generated inner")
"""Tracks generated from the seed (`wallride.sim.world.generated_tracks`); the followed wall is outer or inner."""
LAPS = 3
"""Number of laps, the first from a standstill; the best of the others counts."""
FOLLOWED_S = 60.0


def cells(choice: CellChoice) -> list[Cell]:
    """Return what is to be run."""
    if choice.generated:
        return choice.cells("laps", GENERATED)
    return choice.cells("laps", [*LOOPS, *choice.maps] if not choice.quick else ["loop"])


def run(cell: Cell) -> SimulatedRun:
    """Drive one cell: some laps of a closed course, or 60 s where a lap is not defined."""
    world = load_lap_world(cell.scenario, cell.side, cell.seed)
    counts = world.lap is not None and cell.scenario not in GENERATED
    case = Case(
        world,
        desired_m=min(cell.desired_m, world.room_m),
        distance_m=(LAPS + 0.1) * world.lap.length_m if world.lap is not None and counts else float("inf"),
        duration_s=120.0 if counts else FOLLOWED_S,
        standing_s=5.0,
        vehicle=VehicleSettings(grip_mu=cell.mu),
        seed=cell.seed,
    )
    return drive_case(cell, case)


def measure(cell: Cell) -> Figures:
    """Drive one cell."""
    done = run(cell)
    times_s = lap_times_s(done)
    return {
        **common(done),
        **errors(done),
        "desired_m": number(done.case.desired_m),
        "laps": len(times_s),
        "lap_times_s": times_s,
        "best_lap_s": min(times_s[1:] or times_s, default=None),
    }


def lap_times_s(done: SimulatedRun) -> list[float]:
    """Return the time of each whole lap."""
    lap = done.case.world.lap
    if lap is None:
        return []
    counter, last_s = LapCounter(lap), 0.0
    times_s: list[float] = []
    for time_s, (x_m, y_m, _) in zip(done.time_s, done.pose, strict=True):
        if counter.update(float(x_m), float(y_m)) >= len(times_s) + 1:
            times_s.append(round(float(time_s) - last_s, 3))
            last_s = float(time_s)
    return times_s


def maps_in(folder: Path) -> tuple[str, ...]:
    """Return the paths of all maps in a folder."""
    return tuple(str(path) for path in sorted(folder.glob("*.yaml")))


@lru_cache(maxsize=4)
def load_lap_world(name: str, side: Side, seed: int) -> World:
    """Return the world of a course; the generated ones are of this seed."""
    if name not in GENERATED:
        return load_world(name, side=side)
    world = generated_track(seed, inner=name == GENERATED[1])
    return world if side == "left" else world.mirrored()


def tables(rows: Sequence[Row]) -> list[TabledCell]:
    """Return one table per law and friction: a row per course and side, a column per speed."""
    made = []
    for title, some in by_law_and_friction(rows):
        lines = [
            ((_course(name, some, side), side), chosen(some, scenario=name, side=side))
            for name in distinct(some, "scenario")
            for side in distinct(some, "side")
        ]
        note = f"{sum(row['collided'] for row in some)} of {len(some)} runs with a contact"
        what = f"{title}: best lap, or way in 60 s; mean |error| [m]"
        made.append(speed_table(what, ("course", "side"), lines, _figure, (note,)))
    return made


def _course(name: str, rows: Sequence[Row], side: Side) -> str:
    """Return the course's name, and the requested distance if it is not the default."""
    course, (asked_m, *_) = Path(name).stem, distinct(chosen(rows, scenario=name, side=side), "desired_m")
    return course if asked_m == DESIRED_M else f"{course}, {asked_m:g} m"


def _figure(rows: Sequence[Row]) -> str:
    touched = [row for row in rows if row["collided"]]
    if touched:
        return f"X after {text(mean(touched, 'distance_m'), 0)} m"
    laps = mean(rows, "best_lap_s")
    way = f"{laps:.2f} s" if rows and number(laps) is not None else f"{text(mean(rows, 'distance_m'), 0)} m"
    stands = ", stands" if any(row["stopped_for_good"] for row in rows) else ""
    return f"{way}, {text(mean(rows, 'mean_error_m'))}{stands}"


EXPERIMENT = Experiment(measure, cells, tables)
