"""Boxes in a race: one that stands on the line, as in the entry test of races, or one that appears before the car.

A box is 35 cm long and 32 cm wide. The standing one is on the line or 15 cm beside it, at a place that the seed
chooses. The sudden one appears at the 28 distances and least speeds of `lab safety`, which the seed chooses, too. The
car drives its first lap at the line's full speed. What a sudden box may be hit with is measured: in the same race, the
car brakes in full from the first scan on that shows it.
"""

from dataclasses import dataclass, replace
from typing import Final

import numpy as np

from wallride.drivers.api import MotorState, Scan
from wallride.runtime.arbitration.command import NO_LIMIT_MPS, SafetyAssessment, Verdict
from wallride.runtime.control.guidance import Guard
from wallride.runtime.control.line_following.race_line import CourseLine
from wallride.sim.lab.cell import Figures
from wallride.sim.lab.figures import number
from wallride.sim.lab.safety import DISTANCES_M
from wallride.sim.races.mapped_lap import KeyframePoses
from wallride.sim.virtual.closed_loop import STEP_S, Case, SimulatedRun
from wallride.sim.world.obstacles import Box, Obstacle, StandingObstacle, sudden_box
from wallride.sim.world.pose import Pose

STANDING, SUDDEN = "standing", "sudden"
LENGTH_M, WIDTH_M = 0.35, 0.32
STANDING_ASIDE_M, SUDDEN_ASIDE_M = (0.0, 0.15, -0.15), (0.0, 0.2, -0.2)
FIRST_M, LAST_M = 12.0, 2.0
"""Way from the start, where the car has its speed (at most the first 0.4 of the lap), and before the lap's end."""
FIRST_SHARE = 0.4
LEAST_MPS, APPEARS_S = (1.0, 2.0, 3.0, 4.0), (3.0, 15.0)
LASTS_S, STANDS_S, WAY_LAPS = 35.0, 2.0, 1.3
"""Duration of a drive, the standstill that ends it, and its way."""
FULL_SPEED: Final = "first_lap_share"
"""The setting of `line` that slows the first lap down."""
FREE: Final = Verdict(NO_LIMIT_MPS, NO_LIMIT_MPS, "no guard")


@dataclass(frozen=True, slots=True)
class BrakingGuard:
    """A guard that brakes in full from a time on; before, it judges as another one does, or not at all."""

    guard: Guard | None
    from_s: float

    def look(self, scan: Scan, motor: MotorState | None) -> SafetyAssessment:
        """Return the judgement of a scan."""
        if scan.stamp_s >= self.from_s - STEP_S / 2:
            return Verdict(0.0, NO_LIMIT_MPS, "full brake")
        return self.guard.look(scan, motor) if self.guard is not None else FREE

    def learn(self) -> None:
        """Learn as the other one does."""
        if self.guard is not None:
            self.guard.learn()


def with_box(case: Case, kind: str, line: CourseLine, poses: KeyframePoses) -> Case:
    """Return a race with a box of its seed. poses: of the map's keyframes."""
    random = np.random.default_rng(case.seed)
    box = _standing(random, line, poses) if kind == STANDING else _sudden(random, case.seed)
    return replace(case, obstacles=(box,), duration_s=LASTS_S, standing_s=STANDS_S, distance_m=WAY_LAPS * line.length_m)


def _standing(random: np.random.Generator, line: CourseLine, poses: KeyframePoses) -> Obstacle:
    first_m = min(FIRST_M, FIRST_SHARE * line.length_m)
    at = int(np.argmin(np.abs(line.along_m - random.uniform(first_m, line.length_m - LAST_M))))
    yaw_rad = float(line.yaw_rad[at])
    place_m = line.places_m[at] + 1j * float(random.choice(STANDING_ASIDE_M)) * np.exp(1j * yaw_rad)
    in_world = KeyframePoses(poses.found, poses.true)
    x_m, y_m, turned_rad = in_world.of(np.array([[place_m.real, place_m.imag, yaw_rad]]))[0]
    return Obstacle(Box(LENGTH_M, WIDTH_M), StandingObstacle(Pose(float(x_m), float(y_m), float(turned_rad))))


def _sudden(random: np.random.Generator, seed: int) -> Obstacle:
    distances = len(DISTANCES_M)
    return sudden_box(
        DISTANCES_M[seed % distances], width_m=WIDTH_M, depth_m=LENGTH_M, left_m=float(random.choice(SUDDEN_ASIDE_M)),
        min_speed_mps=LEAST_MPS[seed // distances % len(LEAST_MPS)], from_s=float(random.uniform(*APPEARS_S)),
    )  # fmt: skip


def shown_at(run: SimulatedRun) -> int | None:
    """Return the index of the first scan that could show the box, None where it did not appear."""
    shown = np.flatnonzero(run.appeared)
    return int(shown[0]) if shown.size else None


def box_figures(run: SimulatedRun, braked: SimulatedRun | None) -> Figures:
    """Return how a box was met: at the speed when a sudden one shows; at most at the drive's highest, where one stands.

    braked: the drive with a full brake, None where none was needed.
    """
    fastest_mps = float(run.speed_mps[:, 0].max())
    shown, hit_mps = shown_at(run), run.contact.speed_mps if run.contact is not None else 0.0
    brake_mps = braked.contact.speed_mps if braked is not None and braked.contact is not None else 0.0
    return {
        "box_shown": shown is not None,
        "met_at_mps": number(run.speed_mps[shown, 0] if shown else fastest_mps) if shown is not None else None,
        "hit_mps": number(hit_mps),
        "brake_mps": number(brake_mps),
        "excess_mps": number(hit_mps - brake_mps),
    }
