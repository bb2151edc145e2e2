"""One drive of the lab report's section 3: a test of five starts, with the gains and the laws of its cell.

Four starts beside a straight wall, at half and at one and a half times the wanted distance, 30 degrees toward the wall
or away from it; and an inside corner. "t1 traced" is the same run as "t1", with its way for the figures; "t1 clean" has
a lidar without noise and outliers.
"""

import json
import math
from collections.abc import Mapping
from dataclasses import replace
from functools import lru_cache
from pathlib import Path
from typing import Any

import numpy as np

from sim.lab.cell import DESIRED_M, Cell, CellChoice, Experiment, Figures, TabledCell
from sim.lab.courses.walls import Course, course_case, course_task
from sim.lab.figures import common, errors, number
from sim.lab.laws import drive_case
from sim.lab.limit import least_mean_error_m
from sim.lab.walls import LOST_ABOVE_M
from sim.virtual.closed_loop import SimulatedRun
from sim.world.beams import LidarSettings

NAME = "report.trials"
"""The experiment's name for the pool."""
SLANT_RAD = math.radians(30.0)
WAY_M = 8.5
TESTS = {
    "t1": Course("straight", 0.5, SLANT_RAD, way_m=WAY_M, wall_segments=1),
    "t2": Course("straight", 0.5, -SLANT_RAD, way_m=WAY_M, wall_segments=1),
    "t3": Course("straight", 1.5, SLANT_RAD, way_m=WAY_M, wall_segments=1),
    "t4": Course("straight", 1.5, -SLANT_RAD, way_m=WAY_M, wall_segments=1),
    "t5": Course("inside_corner", ahead_m=2.0, wall_segments=2),
}
ABOUT = {
    "t1": "close, toward the wall",
    "t2": "close, away from it",
    "t3": "far, toward the wall",
    "t4": "far, away from it",
    "t5": "inside corner",
}
TRACED, CLEAN = "traced", "clean"
CLEAN_BEAMS = LidarSettings(noise_std_m=0.0, outlier_share=0.0)
LIMITS_FILE = Path(__file__).with_name("limits.json")
LIMIT_SPEEDS_MPS = (1.0, 2.0, 3.0, 4.0)
LIMIT_MU = 0.8


def run(cell: Cell) -> SimulatedRun:
    """Drive one cell."""
    course = TESTS[cell.scenario.partition(" ")[0]]
    case = course_case(course, cell.speed_mps, cell.mu, cell.side, cell.seed, cell.desired_m)
    if not cell.scenario.endswith(CLEAN):
        return drive_case(cell, case)
    of_the_car = tuple(one for one in cell.conditions if not one.startswith("lidar."))
    return drive_case(replace(cell, conditions=of_the_car), replace(case, lidar=CLEAN_BEAMS))


def measure(cell: Cell) -> Figures:
    """Drive one cell; outcome: "driven", "contact", "stands" or "lost"."""
    done = run(cell)
    figures = {**common(done), **errors(done)}
    steady_m = figures["steady_error_m"]
    outcome = "driven"
    if done.contact is not None:
        outcome = "contact"
    elif figures["stopped_for_good"] or done.distance_m < 0.5:
        outcome = "stands"
    elif steady_m is None or steady_m > LOST_ABOVE_M or done.distance_m < done.case.distance_m:
        outcome = "lost"
    figures["test"] = cell.scenario.partition(" ")[0]
    figures["outcome"] = outcome
    figures["limit_m"], figures["limit_known"] = limit_m(cell)
    if cell.scenario.endswith(TRACED):
        figures["trace"] = _trace(done)
    return figures


def _trace(done: SimulatedRun) -> Mapping[str, list[float | None]]:
    """Return time [s], x, y [m], yaw [rad] and error [m] of every second scan; the error is None without a wall."""
    columns = {
        "time_s": done.time_s,
        "x_m": done.pose[:, 0],
        "y_m": done.pose[:, 1],
        "yaw_rad": done.pose[:, 2],
        "error_m": done.error_m,
    }
    return {name: [number(value) for value in np.asarray(values)[::2]] for name, values in columns.items()}


def limit_m(cell: Cell) -> tuple[float | None, bool]:
    """Return the least mean error of any steering [m], None where none is free of contact; and whether it is known."""
    key = _key(cell.scenario.partition(" ")[0], cell.speed_mps, cell.mu, cell.desired_m)
    return _kept().get(key), key in _kept()


def _key(test: str, speed_mps: float, mu: float, desired_m: float) -> str:
    return f"{test} {speed_mps:g} m/s mu {mu:g} at {desired_m:g} m"


@lru_cache(maxsize=1)
def _kept() -> dict[str, float | None]:
    kept: dict[str, float | None] = json.loads(LIMITS_FILE.read_text()) if LIMITS_FILE.is_file() else {}
    return kept


def compute_limits() -> None:
    """Write the limits of the tests on the default floor: `python -m sim.lab.report.trials`, some minutes."""
    kept: dict[str, float | None] = {}
    for speed_mps in LIMIT_SPEEDS_MPS:
        for test, course in TESTS.items():
            found_m = least_mean_error_m(course_task(course, speed_mps, LIMIT_MU, DESIRED_M))
            kept[_key(test, speed_mps, LIMIT_MU, DESIRED_M)] = number(found_m)
            LIMITS_FILE.write_text(json.dumps(kept, indent=0, sort_keys=True) + "\n")


def _no_cells(_: CellChoice) -> list[Cell]:
    return []


def _no_tables(_: Any) -> list[TabledCell]:  # noqa: ANN401 - the report has a page of its own
    return []


EXPERIMENT = Experiment(_no_cells, measure, _no_tables)

if __name__ == "__main__":
    compute_limits()
