"""One drive of the lab report's evaluation: a test of five starts, with the gains and the law of its cell.

Four starts beside a wall, near and far, turned toward it or away from it, and a corner (an inside one). The scenario
"t1 near=0.5 far=1.5 slant=20 way=4" has the start conditions; "traced" behind it keeps the way for the figures.
"""

import json
import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import lru_cache
from pathlib import Path
from typing import Literal

import numpy as np

from wallride.drivers.api import MotorState, Scan
from wallride.runtime.control.guidance import Follower, Guidance
from wallride.runtime.control.report.measures import WallMeasures, measured
from wallride.sim.lab import laws
from wallride.sim.lab.cell import DESIRED_M, Cell, Experiment, Figures
from wallride.sim.lab.courses.walls import Course, course_case, course_task
from wallride.sim.lab.figures import common, errors, number
from wallride.sim.lab.limit import least_mean_error_m
from wallride.sim.virtual.closed_loop import SimulatedRun

NAME = "report.drives"
"""The experiment's name for the pool."""
TRACED = "traced"
ABOUT = {
    "t1": "close, toward the wall",
    "t2": "close, away from it",
    "t3": "far, toward the wall",
    "t4": "far, away from it",
    "t5": "inside corner",
}
LOST_ABOVE_M = 0.9
"""Minimum true error at the end of a run that lost its wall; with Kp 0 a far start ends 0.7 m off and is driven."""
NO_ROOM_BELOW_M = 0.05
"""Way up to which a contact is the start's fault: no steering has an effect yet."""
LIMITS_FILE = Path(__file__).with_name("limits.json")
LIMIT_SPEED_MPS, LIMIT_MU = 2.0, 0.8
CORNER_AHEAD_M = 5.0
"""Shift of the corner's start, which leaves 3 m to the wall ahead."""


@dataclass(frozen=True, slots=True)
class Starts:
    """Start conditions of the tests, which the report does not give. near, far: shares of the wanted distance.

    slant_deg: toward the wall or away from it. way_m: length of a run.
    """

    near: float = 0.5
    far: float = 1.5
    slant_deg: float = 20.0
    way_m: float = 4.0

    def scenario(self, test: str) -> str:
        """Return the scenario of a test."""
        return f"{test} near={self.near:g} far={self.far:g} slant={self.slant_deg:g} way={self.way_m:g}"

    def course(self, test: str) -> Course:
        """Return the course of a test."""
        if test == "t5":
            return Course("inside_corner", ahead_m=CORNER_AHEAD_M, way_m=self.way_m, wall_segments=2)
        near, toward = test in {"t1", "t2"}, test in {"t1", "t3"}
        slant_rad = math.radians(self.slant_deg if toward else -self.slant_deg)
        return Course("straight", self.near if near else self.far, slant_rad, way_m=self.way_m, wall_segments=1)


def read_scenario(scenario: str) -> tuple[str, Starts]:
    """Return the test and the starts that a scenario names."""
    test, *words = scenario.split()
    told = {name: float(value) for name, _, value in (word.partition("=") for word in words) if value}
    return test, Starts(told["near"], told["far"], told["slant"], told["way"])


@dataclass(slots=True)
class AnswerKeeper:
    """A follower whose answers are kept, with what the report's law reads from the same scans."""

    follower: Follower
    side: Literal["left", "right"]
    error_m: list[float] = field(default_factory=list)
    walls: list[WallMeasures | None] = field(default_factory=list)

    def follow(self, scan: Scan, motor: MotorState | None) -> Guidance:
        """Return the follower's guidance."""
        guidance = self.follower.follow(scan, motor)
        self.error_m.append(guidance.error_m)
        self.walls.append(measured(scan, self.side))
        return guidance


def run(cell: Cell) -> tuple[SimulatedRun, AnswerKeeper]:
    """Drive one cell."""
    test, starts = read_scenario(cell.scenario)
    case = course_case(starts.course(test), cell.speed_mps, cell.mu, cell.side, cell.seed, cell.desired_m)
    follower, guard = laws.build(cell.law, cell.side, cell.desired_m, cell.speed_mps, cell.settings)
    kept = AnswerKeeper(follower, cell.side)
    return laws.drive_case(cell, case, kept, guard), kept


def measure(cell: Cell) -> Figures:
    """Drive one cell; outcome: "driven", "contact", "no room" (the start touches the wall), "stands" or "lost".

    law_error_m: mean of the law's own |distance - wanted| over all samples, None where it has no distance. The
        report's figure of merit, but that it does not say whether it takes the magnitude; law_error_signed_m does not.
    true_error_m: the same of the true distance from the rear axle.
    """
    done, kept = run(cell)
    true, own_m = errors(done), np.array(kept.error_m)
    own_m = own_m[np.isfinite(own_m)]
    steady_m = true["steady_error_m"]
    figures = common(done)
    outcome = "driven"
    if done.contact is not None:
        outcome = "contact" if done.distance_m > NO_ROOM_BELOW_M else "no room"
    elif figures["stopped_for_good"] or done.distance_m < 0.5:
        outcome = "stands"
    elif steady_m is None or steady_m > LOST_ABOVE_M or done.distance_m < done.case.distance_m:
        outcome = "lost"
    limit_m = _kept().get(_key(cell))
    figures |= {
        "test": cell.scenario.partition(" ")[0],
        "outcome": outcome,
        "law_error_m": number(np.abs(own_m).mean()) if own_m.size else None,
        "law_error_signed_m": number(own_m.mean()) if own_m.size else None,
        "true_error_m": true["mean_error_m"],
        "limit_m": limit_m,
    }
    if cell.scenario.endswith(TRACED):
        figures["trace"] = _trace(done, kept)
    return figures


def _trace(done: SimulatedRun, kept: AnswerKeeper) -> Mapping[str, list[float | None]]:
    """Return a run's way by scan: time, pose, both errors, the distances of the report's law, the turn radius."""
    walls = [wall or WallMeasures(*(math.nan,) * 6) for wall in kept.walls]
    steering_rad = done.command[:, 1]
    with np.errstate(divide="ignore"):
        radius_m = done.case.car.wheelbase_m / np.abs(np.tan(steering_rad))
    columns = {
        "time_s": done.time_s,
        "x_m": done.pose[:, 0],
        "y_m": done.pose[:, 1],
        "yaw_rad": done.pose[:, 2],
        "law_error_m": kept.error_m,
        "true_error_m": done.error_m,
        "ahead_m": [wall.ahead_m for wall in walls],
        "nearest_m": [wall.three_smallest_m for wall in walls],
        "line_m": [wall.line_m for wall in walls],
        "turn_radius_m": radius_m,
    }
    return {name: [number(value) for value in np.asarray(values)] for name, values in columns.items()}


def _key(cell: Cell) -> str:
    scenario = cell.scenario.removesuffix(f" {TRACED}")
    return f"{scenario} {cell.speed_mps:g} m/s mu {cell.mu:g} at {cell.desired_m:g} m"


@lru_cache(maxsize=1)
def _kept() -> dict[str, float | None]:
    kept: dict[str, float | None] = json.loads(LIMITS_FILE.read_text())
    return kept


def compute_limits() -> None:
    """Write the least true mean errors of any steering: `python -m wallride.sim.lab.report.drives`, about a minute."""
    kept: dict[str, float | None] = {}
    for test in ABOUT:
        cell = Cell(NAME, Starts().scenario(test), "report+none", LIMIT_SPEED_MPS, LIMIT_MU, "left", 0)
        task = course_task(Starts().course(test), LIMIT_SPEED_MPS, LIMIT_MU, DESIRED_M)
        kept[_key(cell)] = number(least_mean_error_m(task))
    LIMITS_FILE.write_text(json.dumps(kept, indent=0, sort_keys=True) + "\n")


EXPERIMENT = Experiment(measure)

if __name__ == "__main__":
    compute_limits()
