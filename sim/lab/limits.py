"""The physical limits of the standard cells, computed once by `benchmarks/lab/limits.py` and kept in a file."""

import json
import math
from functools import lru_cache
from pathlib import Path

from wallride.sim.lab.cell import DESIRED_M
from wallride.sim.lab.courses.walls import limit_task
from wallride.sim.lab.limit import least_mean_error_m

FILE = Path(__file__).with_name("limits.json")


def limit_m(scenario: str, speed_mps: float, mu: float, desired_m: float = DESIRED_M) -> float:
    """Return the least mean error of a course [m], NaN when no way without contact was found.

    Computed when the file does not have it, which takes ten seconds or more.
    """
    cell = key(scenario, speed_mps, mu, desired_m)
    if cell in kept():
        known = kept()[cell]
        return math.nan if known is None else known
    task = limit_task(scenario, speed_mps, mu, desired_m)
    return least_mean_error_m(task) if task is not None else 0.0


def key(scenario: str, speed_mps: float, mu: float, desired_m: float = DESIRED_M) -> str:
    """Return the name of a limit in the file."""
    asked = "" if desired_m == DESIRED_M else f" at {desired_m:g} m"
    return f"{scenario.partition(' ')[0]} {speed_mps:g} m/s mu {mu:g}{asked}"


@lru_cache(maxsize=1)
def kept() -> dict[str, float | None]:
    """Return the limits of the file by `key`, None where no way without contact was found."""
    if not FILE.is_file():
        return {}
    limits: dict[str, float | None] = json.loads(FILE.read_text())
    return limits
