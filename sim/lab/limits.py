"""The physical limits of the standard cells, computed once and kept in a file.

`python -m wallride.sim.lab.limits` completes the file.

The report's tests, t1 to t5, at DRIVEN_MU, where laws are measured to the percent, come from `driven_mean_error_m`, all
others from `least_mean_error_m`.
"""

import json
import math
import sys
from functools import lru_cache
from itertools import product
from pathlib import Path

from wallride.sim.lab.cell import DESIRED_M
from wallride.sim.lab.courses.walls import COURSES, REPORT_COURSES, limit_task
from wallride.sim.lab.limit import Task, driven_mean_error_m, least_mean_error_m

FILE = Path(__file__).with_name("limits.json")
SPEEDS_MPS = (1.0, 2.0, 3.0, 4.0)
MUS = (0.8, 0.5, 1.0)
DRIVEN_MU = 0.8
KEPT = (*((mu, DESIRED_M) for mu in MUS), (DRIVEN_MU, 0.7))
"""Friction and wanted distance of the limits in the file."""

MIRRORED = {"t1": "t4", "t2": "t3"}
"""Starts on the other side of the wanted distance: a mirrored path has the same cost."""
REFERENCE_M = {
    "t1": {1.0: 0.091, 2.0: 0.118, 3.0: 0.174},
    "t2": {1.0: 0.038, 2.0: 0.038, 3.0: 0.050, 4.0: 0.049},
    "t3": {1.0: 0.035, 2.0: 0.040, 3.0: 0.047, 4.0: 0.052},
    "t4": {1.0: 0.091, 2.0: 0.119, 3.0: 0.174, 4.0: 0.257},
    "t5": {1.0: 0.021, 2.0: 0.022, 3.0: 0.034, 4.0: 0.074},
}
"""Limits that another simulator's search found, mu 0.8 (design notes, section 3)."""


def limit_m(scenario: str, speed_mps: float, mu: float, desired_m: float = DESIRED_M) -> float:
    """Return the least mean error of a course [m], NaN when no way without contact was found.

    Computed when the file does not have it, which takes ten seconds or more.
    """
    cell = key(scenario, speed_mps, mu, desired_m)
    if cell in _kept():
        known = _kept()[cell]
        return math.nan if known is None else known
    task = limit_task(scenario, speed_mps, mu, desired_m)
    return _least_m(task) if task is not None else 0.0


@lru_cache(maxsize=64)
def _least_m(task: Task) -> float:
    return least_mean_error_m(task)


def key(scenario: str, speed_mps: float, mu: float, desired_m: float = DESIRED_M) -> str:
    """Return the name of a limit in the file."""
    asked = "" if desired_m == DESIRED_M else f" at {desired_m:g} m"
    return f"{scenario.partition(' ')[0]} {speed_mps:g} m/s mu {mu:g}{asked}"


def _found_m(name: str, speed_mps: float, mu: float, desired_m: float) -> float:
    task = limit_task(name, speed_mps, mu, desired_m)
    if task is None:
        return 0.0
    found_m = least_mean_error_m(task)
    if name not in REPORT_COURSES or (mu, desired_m) != (DRIVEN_MU, DESIRED_M) or math.isnan(found_m):
        return found_m
    same = limit_task(MIRRORED.get(name, name), speed_mps, mu)  # the same except for the wall that could be touched
    return _driven_m(same or task)


@lru_cache(maxsize=64)
def _driven_m(task: Task) -> float:
    return driven_mean_error_m(task)


@lru_cache(maxsize=1)
def _kept() -> dict[str, float | None]:
    if not FILE.is_file():
        return {}
    kept: dict[str, float | None] = json.loads(FILE.read_text())
    return kept


def compute_all() -> None:
    """Compute what is missing in the file; delete it first to compute everything."""
    kept = dict(_kept())
    for (mu, desired_m), name, speed_mps in product(KEPT, COURSES, SPEEDS_MPS):
        cell = key(name, speed_mps, mu, desired_m)
        if cell not in kept:
            found_m = _found_m(name, speed_mps, mu, desired_m)
            kept[cell] = None if math.isnan(found_m) else round(found_m, 4)
            FILE.write_text(json.dumps(kept, indent=0, sort_keys=True) + "\n")
            sys.stderr.write(f"{cell}: {kept[cell]}\n")


if __name__ == "__main__":
    compute_all()
