"""Limits of the lab's standard cells: `python -m benchmarks.lab.limits` completes `sim/lab/limits.json`.

The report's tests, t1 to t5, at DRIVEN_MU, where laws are measured to the percent, come from `driven_mean_error_m`,
which goes on from the search of `wallride.sim.lab.limit` with `wallride.sim.car.vehicle` itself, whose speed sags and
whose load shifts in bends. That takes half a minute and raises the answer by 0 to 5 %. All others come from
`least_mean_error_m`.
"""

import json
import math
import sys
from dataclasses import replace
from functools import lru_cache
from itertools import product

import numpy as np

from wallride.sim.car.vehicle import SpeedDemand, Vehicle
from wallride.sim.lab.cell import DESIRED_M
from wallride.sim.lab.courses.walls import COURSES, REPORT_COURSES, limit_task
from wallride.sim.lab.limit import SPEED_STEP_MPS, SteeringProblem, Task, best_steering, least_mean_error_m
from wallride.sim.lab.limits import FILE, kept, key
from wallride.sim.world.pose import Floats

STEP_S = 0.0025
TRUST_RAD = (0.1, 0.03)
SPEEDS_MPS = (1.0, 2.0, 3.0, 4.0)
MUS = (0.8, 0.5, 1.0)
DRIVEN_MU = 0.8
KEPT = (*((mu, DESIRED_M) for mu in MUS), (DRIVEN_MU, 0.7))
"""Friction and wanted distance of the limits in the file."""

MIRRORED = {"t1": "t4", "t2": "t3"}
"""Starts on the other side of the wanted distance: a mirrored path has the same cost."""


class DrivenProblem(SteeringProblem):
    """The same problem with the simulator's own vehicle, at the speed that its motor's speed control keeps."""

    def paths(self, steering_rad: Floats) -> Floats:
        """Return the rear axle's places after each knot for a batch of steerings (b, n), shape (b, n, 2)."""
        task, parts = self.task, math.ceil(self.knot_s / STEP_S)
        step_s = self.knot_s / parts
        moments_s = (np.arange(self.knots * parts) + 0.5) * step_s - (task.delay_s - task.vehicle.steering_delay_s)
        knots_s = np.arange(self.knots + 1) * self.knot_s
        demand = SpeedDemand(task.speed_mps)
        places = np.empty((len(steering_rad), self.knots, 2))
        for row, knots_rad in enumerate(steering_rad):
            vehicle = Vehicle(task.vehicle)
            vehicle.place(task.start, speed_mps=task.speed_mps)
            commands = np.interp(moments_s, knots_s, np.concatenate([[0.0], knots_rad])).tolist()
            for step, command_rad in enumerate(commands):
                vehicle.step(step_s, demand, command_rad)
                if (step + 1) % parts == 0:
                    places[row, step // parts] = vehicle.x_m, vehicle.y_m
        return places


@lru_cache(maxsize=64)
def driven_mean_error_m(task: Task) -> float:
    """Return what `least_mean_error_m` returns, for the whole vehicle model."""
    problem = DrivenProblem(task)
    faster = replace(task, speed_mps=task.speed_mps + SPEED_STEP_MPS)
    guesses = [problem.possible(np.array(best_steering(near)[1])) for near in (task, faster)]
    found = [problem.improved(guess, trust_rad) for guess in guesses for trust_rad in TRUST_RAD]
    cost, steering_rad = min(found, key=lambda one: one[0])
    return math.nan if problem.touches(steering_rad) else cost


def _found_m(name: str, speed_mps: float, mu: float, desired_m: float) -> float:
    task = limit_task(name, speed_mps, mu, desired_m)
    if task is None:
        return 0.0
    found_m = least_mean_error_m(task)
    if name not in REPORT_COURSES or (mu, desired_m) != (DRIVEN_MU, DESIRED_M) or math.isnan(found_m):
        return found_m
    same = limit_task(MIRRORED.get(name, name), speed_mps, mu)  # the same except for the wall that could be touched
    return driven_mean_error_m(same or task)


def compute_all() -> None:
    """Compute what is missing in the file; delete it first to compute everything."""
    limits = dict(kept())
    for (mu, desired_m), name, speed_mps in product(KEPT, COURSES, SPEEDS_MPS):
        cell = key(name, speed_mps, mu, desired_m)
        if cell not in limits:
            found_m = _found_m(name, speed_mps, mu, desired_m)
            limits[cell] = None if math.isnan(found_m) else round(found_m, 4)
            FILE.write_text(json.dumps(limits, indent=0, sort_keys=True) + "\n")
            sys.stderr.write(f"{cell}: {limits[cell]}\n")


if __name__ == "__main__":
    compute_all()
