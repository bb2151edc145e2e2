"""One drive of a tuning trial: a course under conditions sampled from its seed, and its cost.

    cost = error / limit + 10 (contact or not finished) + 0.5 per stop of safety + 0.1 s/rad mean |steering rate|

error: mean |distance - wanted|; limit: the least of any steering on that floor (`wallride.sim.lab.limits`), at least 3
cm. The shape is that of the design notes, section 7: one cost over all scenarios instead of an average of optima.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from wallride.sim.lab.cell import DESIRED_M, Cell, Experiment, Figures
from wallride.sim.lab.courses.walls import case_of
from wallride.sim.lab.figures import Row, common, errors, number
from wallride.sim.lab.laws import drive_case
from wallride.sim.lab.limits import limit_m
from wallride.sim.lab.walls import LOST_ABOVE_M
from wallride.sim.scenario.conditions import named_value
from wallride.sim.virtual.closed_loop import SimulatedRun
from wallride.sim.world.beams import LidarSettings
from wallride.sim.world.pose import Side

NAME = "tuning.drive"
"""The experiment's name for the pool."""
Scenario = tuple[str, float]
"""A course of `lab walls`, and the requested speed [m/s]."""
SCENARIOS: tuple[Scenario, ...] = (
    ("t1", 1.0), ("t2", 3.0), ("t3", 2.0), ("t4", 2.0), ("t5", 2.0), ("outside_corner", 2.0), ("doorway", 3.0),
    ("u_turn", 3.0),
)  # fmt: skip
HELD_OUT: tuple[Scenario, ...] = (
    ("t1", 2.0), ("t2", 2.0), ("t3", 3.0), ("t4", 1.0), ("t5", 3.0), ("outside_corner", 1.0), ("doorway", 2.0),
    ("u_turn_inner", 2.0), ("curved", 3.0),
)  # fmt: skip
"""Courses and speeds that no trial drives."""
MUS, NOISES_M, LATENCIES_S = (0.5, 0.8, 1.0), (0.01, 0.02, 0.03, 0.05), (0.02, 0.035, 0.05)
MAX_TRIM_RAD = 0.02
OWN_PARTS = ("none", "none", "posts", "mounts", "cables")
SIDES: tuple[Side, ...] = ("left", "right")
MIN_LIMIT_M = 0.03
FAILED_COST, STOP_COST, COMFORT_COST_S_PER_RAD = 10.0, 0.5, 0.1


@dataclass(frozen=True, slots=True)
class SampledConditions:
    """Conditions of one drive. latency_s: from a scan to the motor's wire."""

    mu: float
    side: Side
    noise_m: float
    latency_s: float
    trim_rad: float
    own_parts: str

    @classmethod
    def of(cls, seed: int) -> "SampledConditions":
        """Return the conditions of a seed."""
        rng = np.random.default_rng([seed, 22])
        mu, side, noise_m, latency_s, parts = (
            int(rng.integers(len(some))) for some in (MUS, SIDES, NOISES_M, LATENCIES_S, OWN_PARTS)
        )
        trim_rad = round(float(rng.uniform(-MAX_TRIM_RAD, MAX_TRIM_RAD)), 4)
        return cls(MUS[mu], SIDES[side], NOISES_M[noise_m], LATENCIES_S[latency_s], trim_rad, OWN_PARTS[parts])


def cells(
    law: str, settings: Sequence[str], seed: int, scenarios: Sequence[Scenario], conditions: tuple[str, ...] = ()
) -> list[Cell]:
    """Return the drives of one trial; the same seed gives the same conditions, whatever the settings are.

    conditions: of every drive, in place of the sampled ones.
    """
    mu, own_parts = named_value(conditions, "vehicle.grip_mu"), named_value(conditions, "lidar.own_parts")
    made = []
    for index, (course, speed_mps) in enumerate(scenarios):
        own = 1000 * seed + index
        sampled = SampledConditions.of(own)
        made.append(
            Cell(NAME, course, law, speed_mps, mu or sampled.mu, sampled.side, own, DESIRED_M,
                 own_parts or sampled.own_parts, tuple(settings), conditions)
        )  # fmt: skip
    return made


def run(cell: Cell) -> SimulatedRun:
    """Drive one cell."""
    sampled = SampledConditions.of(cell.seed)
    case = case_of(cell.scenario, cell.speed_mps, cell.mu, cell.side, cell.seed, cell.desired_m)
    lidar = LidarSettings(noise_std_m=sampled.noise_m, outlier_share=0.02)
    vehicle = case.vehicle.model_copy(update={"trim_rad": sampled.trim_rad})
    return drive_case(
        cell, replace(case, lidar=lidar, vehicle=vehicle, latency_s=sampled.latency_s, standing_s=3.0)
    )  # fmt: skip


def measure(cell: Cell) -> Figures:
    """Drive one cell; its cost, and what it consists of."""
    done = run(cell)
    figures = {**common(done), **errors(done)}
    steady_m, error_m = figures["steady_error_m"], figures["mean_error_m"]
    lost = steady_m is None or steady_m > LOST_ABOVE_M
    figures["completed"] = done.contact is None and done.distance_m >= done.case.distance_m and not lost
    nearest_mu = min(MUS, key=lambda mu: abs(mu - cell.mu))  # of another floor the limit takes minutes to compute
    known_m = limit_m(cell.scenario, cell.speed_mps, nearest_mu, cell.desired_m)
    limit = MIN_LIMIT_M if math.isnan(known_m) else max(known_m, MIN_LIMIT_M)
    ratio = FAILED_COST if error_m is None else min(error_m / limit, FAILED_COST)
    rate_radps = (
        float(np.abs(np.diff(done.command[:, 1])).mean() * done.case.lidar.rate_hz) if len(done.time_s) > 1 else 0.0
    )
    figures["error_per_limit"] = number(ratio)
    figures["steering_rate_radps"] = number(rate_radps)
    figures["cost"] = number(
        ratio
        + FAILED_COST * (not figures["completed"])
        + STOP_COST * figures["safety_stops"]
        + COMFORT_COST_S_PER_RAD * rate_radps
    )
    return figures


def cost_of(rows: Sequence[Row]) -> float:
    """Return the cost of a trial: the mean over its drives."""
    return math.fsum(row["cost"] for row in rows) / len(rows)


EXPERIMENT = Experiment(measure)
