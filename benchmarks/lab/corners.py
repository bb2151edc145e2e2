"""`benchmarks.lab corners`: corners and corridors of real buildings, and straight lanes that turn into a narrower one.

Buildings: the places of `benchmarks.lab.building_places` on the maps, 9 m each. With `--method ball,prototype` each
run is compared with the prototype's on the same course, floor, side and seed, for places tuned on and places held out.

Lanes: 8 m of a lane FIRST_LANE_M wide, of which the car drives 6 m, then a corner by an angle into a lane of another
width. "out": away from the followed wall (an inside corner), "in": round it (an outside corner).
"""

import math
from collections.abc import Sequence
from functools import lru_cache
from pathlib import Path

import numpy as np

from benchmarks.lab.building_places import BuildingStart, building, is_held_out, places_on
from wallride.sim.car.vehicle import VehicleSettings
from wallride.sim.lab.cell import Cell, CellChoice, Experiment, Figures, TabledCell
from wallride.sim.lab.figures import Row, by_law, chosen, common, distinct, errors, number, text
from wallride.sim.lab.laws import drive_case
from wallride.sim.virtual.closed_loop import Case, SimulatedRun
from wallride.sim.world.place import World
from wallride.sim.world.pose import Pose, Side
from wallride.sim.world.segments import SegmentGeometry, chain

WAY_M = 9.0
MAX_SPEED_MPS = 3.0
FIRST_LANE_M, STRAIGHT_M, AFTER_M = 2.5, 6.0, 12.0
LANE_WAY_M = 12.0
TURNS_DEG = (60, 75, 90, 110, 130, 150)
LANES_M = (1.2, 1.5, 1.8, 2.0)
WAYS = ("out", "in")
LANES = {
    f"{way} {turn_deg} deg, {lane_m:g} m": (way, turn_deg, lane_m)
    for way in WAYS
    for turn_deg in TURNS_DEG
    for lane_m in LANES_M
}
"""Lanes by name: direction, the angle [deg], the width behind the corner."""
QUICK_LANES = ("out 110 deg, 1.5 m", "in 110 deg, 1.5 m")
ALIKE = ("scenario", "speed_mps", "mu", "side", "seed", "desired_m")
"""Fields in which compared runs of two laws agree."""
COMPARED, BASELINE = "ball", "prototype"


def cells(choice: CellChoice) -> list[Cell]:
    """Return the cells: lanes at all speeds, buildings up to FASTEST_MPS."""
    maps = choice.maps[:1] if choice.quick else choice.maps
    planned = choice.cells(
        "benchmarks.lab.corners", [*(QUICK_LANES if choice.quick else LANES), *_names(maps, choice.desired_m)]
    )
    return [
        cell
        for cell in planned
        if cell.scenario in LANES or (cell.speed_mps <= MAX_SPEED_MPS and _place(cell) is not None)
    ]


def _names(maps: Sequence[str], desired_m: float) -> list[str]:
    """Return the names of the places of a map on either side."""
    sides: tuple[Side, Side] = ("left", "right")
    most = {path: max(len(places_on(path, side, desired_m)) for side in sides) for path in maps}
    return [f"{path} {place}" for path, count in most.items() for place in range(count)]


def _place(cell: Cell) -> BuildingStart | None:
    path, _, wanted = cell.scenario.rpartition(" ")
    return next((place for place in places_on(path, cell.side, cell.desired_m) if place.number == int(wanted)), None)


def run(cell: Cell) -> SimulatedRun:
    """Drive one cell."""
    return drive_case(cell, case_of(cell))


def case_of(cell: Cell) -> Case:
    """Return the run of a cell."""
    vehicle, place = VehicleSettings(grip_mu=cell.mu), None
    if cell.scenario in LANES:
        world, way_m = lane(cell.scenario, cell.side), LANE_WAY_M
    else:
        world, way_m, place = building(cell.scenario.rpartition(" ")[0], cell.side), WAY_M, _place(cell)
    return Case(
        world, place.pose if place is not None else None, desired_m=cell.desired_m, distance_m=way_m,
        duration_s=4.0 * way_m / max(cell.speed_mps, 0.5) + 5.0, standing_s=3.0, vehicle=vehicle, seed=cell.seed,
    )  # fmt: skip


@lru_cache(maxsize=64)
def lane(name: str, side: Side) -> World:
    """Return the world of a lane; the followed wall is on `side`, at y = 1 m before it is mirrored."""
    way, turn_deg, lane_m = LANES[name]
    turn_rad = math.radians(-turn_deg if way == "out" else turn_deg)
    corner = np.array([STRAIGHT_M, 1.0])
    ahead, after = np.array([1.0, 0.0]), np.array([math.cos(turn_rad), math.sin(turn_rad)])
    right, right_after = np.array([0.0, -1.0]), np.array([after[1], -after[0]])
    # The other wall: parallel to both legs; it turns where its two lines cross.
    first, second = corner + FIRST_LANE_M * right, corner + lane_m * right_after
    on = np.linalg.solve(np.column_stack([ahead, -after]), second - first)
    other = first + on[0] * ahead
    begin, end_m = corner - (STRAIGHT_M + 2.0) * ahead, AFTER_M
    mine = [tuple(begin), tuple(corner), tuple(corner + end_m * after)]
    opposite = [tuple(begin + FIRST_LANE_M * right), tuple(other), tuple(corner + end_m * after + lane_m * right_after)]
    world = World(name, SegmentGeometry(np.array([*chain(mine), *chain(opposite)])), Pose(0.0, 0.0, 0.0))
    return world if side == "left" else world.mirrored()


def measure(cell: Cell) -> Figures:
    """Drive one cell."""
    done = run(cell)
    figures: Figures = {**common(done), **errors(done)}
    figures["held_out"] = figures["start"] = figures["corner"] = None
    place = _place(cell) if cell.scenario not in LANES else None
    if place is not None:
        name = Path(cell.scenario.rpartition(" ")[0]).stem
        figures |= {
            "held_out": is_held_out(name, place.number),
            "start": place.start,
            "corner": place.corner,
            "start_m": [number(part) for part in (place.pose.x_m, place.pose.y_m, place.pose.yaw_rad)],
        }
    return figures


def tables(rows: Sequence[Row]) -> list[TabledCell]:
    """Return the lanes, the buildings, and the comparison of two laws."""
    lanes = [row for row in rows if row["held_out"] is None]
    buildings = [row for row in rows if row["held_out"] is not None]
    made = [_lane_table(some, law) for law, some in by_law(lanes)]
    if buildings:
        made.append(_building_table(buildings))
        pairs = compared(buildings)
        if pairs:
            made.append(_comparison(pairs))
    return made


def _lane_table(rows: Sequence[Row], law: str) -> TabledCell:
    speeds, mus = sorted(distinct(rows, "speed_mps")), sorted(distinct(rows, "mu"))
    lines = [
        (name, *(_lane_figure(chosen(rows, scenario=name, speed_mps=v, mu=mu)) for mu in mus for v in speeds))
        for name in distinct(rows, "scenario")
    ]
    columns = ("lane", *(f"{v:g} m/s, {mu:g}" for mu in mus for v in speeds))
    note = f"{sum(row['collided'] for row in rows)} of {len(rows)} runs with a contact"
    return TabledCell(f"{law}: contacts, runs that end in a stop, mean |error| [m]", columns, tuple(lines), (note,))


def _lane_figure(rows: Sequence[Row]) -> str:
    touched = [row["impact_mps"] for row in rows if row["collided"]]
    if touched:
        return f"X {len(touched)} of {len(rows)}, {max(touched):.1f} m/s"
    stands = sum(row["stopped_for_good"] for row in rows)
    return f"stands {stands} of {len(rows)}" if stands else text(_median(rows))


def _building_table(rows: Sequence[Row]) -> TabledCell:
    speeds = sorted(distinct(rows, "speed_mps"))
    lines = []
    for law in distinct(rows, "law"):
        for path in dict.fromkeys(_map_of(row) for row in rows):
            some = [row for row in chosen(rows, law=law) if _map_of(row) == path]
            figures = (text(_median(chosen(some, speed_mps=speed))) for speed in speeds)
            touched, stands = sum(row["collided"] for row in some), sum(row["stopped_for_good"] for row in some)
            lines.append((law, path, str(len(some)), *figures, str(touched), str(stands)))
    columns = ("law", "map", "runs", *(f"{speed:g} m/s" for speed in speeds), "contacts", "stands")
    return TabledCell("buildings: median of the mean |error| [m]", columns, tuple(lines))


def compared(rows: Sequence[Row]) -> list[tuple[Row, Row]]:
    """Return the runs of COMPARED, each with that of BASELINE on the same course."""
    baseline = {tuple(row[name] for name in ALIKE): row for row in rows if _follower(row) == BASELINE}
    found = ((row, baseline.get(tuple(row[name] for name in ALIKE))) for row in rows if _follower(row) == COMPARED)
    return [(row, other) for row, other in found if other is not None]


def not_worse(mine: Row, other: Row) -> bool:
    """Return whether a run is as good as another: no worse error, and no contact that the other does not have."""
    if mine["collided"] or other["collided"]:
        return bool(other["collided"] and not mine["collided"])
    return bool((mine["mean_error_m"] or math.inf) <= (other["mean_error_m"] or math.inf))


def ratio(mine: Row, other: Row) -> float:
    """Return a run's mean error as a multiple of another's, NaN where one has none."""
    if mine["mean_error_m"] is None or not other["mean_error_m"]:
        return math.nan
    return float(mine["mean_error_m"] / other["mean_error_m"])


def _comparison(pairs: Sequence[tuple[Row, Row]]) -> TabledCell:
    kinds = {
        "tuned on": [pair for pair in pairs if not pair[0]["held_out"]],
        "held out": [pair for pair in pairs if pair[0]["held_out"]],
    }
    lines = []
    for held, group in kinds.items():
        parts = {"all": group}
        parts |= {f"{v:g} m/s": [p for p in group if p[0]["speed_mps"] == v] for v in _values(group, "speed_mps")}
        parts |= {f"mu {mu:g}": [p for p in group if p[0]["mu"] == mu] for mu in _values(group, "mu")}
        parts |= {f"start {name}": [p for p in group if p[0]["start"] == name] for name in _values(group, "start")}
        parts["no corner"] = [p for p in group if not p[0]["corner"]]
        lines += [(held, what, *_compared(some)) for what, some in parts.items() if some]
    columns = ("places", "runs", "count", "not worse", "median ratio", "ball m/s", "prototype m/s")
    return TabledCell(f"buildings: {COMPARED} beside {BASELINE}, mean |error|", columns, tuple(lines))


def _compared(pairs: Sequence[tuple[Row, Row]]) -> tuple[str, ...]:
    good = sum(not_worse(*pair) for pair in pairs)
    ratios = [ratio(*pair) for pair in pairs]
    speeds = (np.mean([pair[side]["mean_speed_mps"] for pair in pairs]) for side in (0, 1))
    return (
        str(len(pairs)),
        f"{100 * good / len(pairs):.0f} %",
        text(float(np.nanmedian(ratios)), 2),
        *(text(float(speed), 2) for speed in speeds),
    )


def _values(pairs: Sequence[tuple[Row, Row]], name: str) -> list[float]:
    return sorted(distinct([pair[0] for pair in pairs], name))


def _median(rows: Sequence[Row]) -> float:
    found = [row["mean_error_m"] for row in rows if row["mean_error_m"] is not None]
    return float(np.median(found)) if found else math.nan


def _map_of(row: Row) -> str:
    return Path(row["scenario"].rpartition(" ")[0]).stem


def _follower(row: Row) -> str:
    return str(row["law"]).partition("+")[0]


EXPERIMENT = Experiment(measure, cells, tables)
