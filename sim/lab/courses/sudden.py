"""Sudden obstacles with a driver at the wheel: their shapes, places, and the drivers' reactions.

`lab safety` names such a run by four terms, "human corridor 0.3-left 0.9m"; the last is the distance from the lidar.

    driver   follower: the car's own wall follower, which swerves when it sees the box
             human: under `safety.binds_teleop`; full lock away from the followed wall, begun 0.1 s before the box shows
    place    corridor: 2 m wide, the car in its middle. wall: the followed one at 1 m, the other side 3 m away
    box      0.3 and 0.8 m wide, centred or beside the car's middle line, and one across the whole way
"""

import math
from dataclasses import dataclass

from wallride.drivers.api import Drive, MotorState, Scan
from wallride.runtime.arbitration.command import NO_LIMIT_MPS, SafetyAssessment, Source, Verdict
from wallride.runtime.control.guidance import Follower, Guard, Guidance
from wallride.runtime.control.vehicle import CarSettings
from wallride.sim.car.vehicle import VehicleSettings
from wallride.sim.lab.cell import Cell
from wallride.sim.lab.courses.walls import world_of
from wallride.sim.virtual.closed_loop import STEP_S, Case
from wallride.sim.world.obstacles import sudden_box
from wallride.sim.world.pose import side_sign

APPEARS_S = 0.5
HUMAN_BEGINS_S = APPEARS_S - 0.1
LASTS_S = 4.0
FREE = Verdict(NO_LIMIT_MPS, NO_LIMIT_MPS, "no guard")
PLACES = {"corridor": "corridor", "wall": "straight"}
"""The worlds by the names of the places."""
BOXES = {
    "0.3-centred": (0.3, 0.0),
    "0.3-left": (0.3, 0.2),
    "0.3-right": (0.3, -0.2),
    "0.8-centred": (0.8, 0.0),
    "0.8-left": (0.8, 0.45),
    "0.8-right": (0.8, -0.45),
    "full-width": (4.0, 0.0),
}
"""Width and place to the left of the car's middle line [m]; the ones beside it overlap the car by 10 cm."""


@dataclass(slots=True)
class BlindDriver:
    """Open-loop driver: one speed, straight on until `turns_at_s`, then one steering angle."""

    speed_mps: float
    steering_rad: float = 0.0
    turns_at_s: float = 0.0

    def follow(self, scan: Scan, motor: MotorState | None) -> Guidance:  # noqa: ARG002 - blind
        """Return the same command for every scan."""
        steering_rad = self.steering_rad if scan.stamp_s >= self.turns_at_s else 0.0
        return Guidance(Drive(self.speed_mps, steering_rad), math.nan, math.nan, math.nan, "blind")


@dataclass(frozen=True, slots=True)
class SuddenRun:
    """One of the runs by its terms; driver "blind" drives straight on beside a wall and meets a box of 0.5 m."""

    driver: str
    place: str
    box: str
    ahead_m: float

    @classmethod
    def named(cls, scenario: str) -> "SuddenRun":
        """Return the run that a cell's scenario names."""
        if scenario.endswith(" m"):
            return cls("blind", "wall", "0.5 m", float(scenario.removesuffix(" m")))
        driver, place, box, ahead = scenario.split()
        return cls(driver, place, box, float(ahead.removesuffix("m")))


def scenarios(distances_m: tuple[float, ...], *, quick: bool) -> list[str]:
    """Return the names of all runs with a driver that reacts; quick: the boxes of 0.8 m in the corridor."""
    places = ["corridor"] if quick else list(PLACES)
    boxes = [box for box in BOXES if not quick or box.startswith("0.8")]
    return [
        f"{driver} {place} {box} {ahead_m:.1f}m"
        for driver in ("follower", "human")
        for place in places
        for box in boxes
        for ahead_m in distances_m
    ]


def case_of(cell: Cell) -> Case:
    """Return the run of a cell."""
    sudden = SuddenRun.named(cell.scenario)
    width_m, left_m = BOXES.get(sudden.box, (0.5, 0.0))
    return Case(
        world_of(PLACES[sudden.place], cell.side),
        None,
        cell.speed_mps,
        duration_s=APPEARS_S + LASTS_S,
        standing_s=1.0,
        vehicle=VehicleSettings(grip_mu=cell.mu),
        obstacles=(sudden_box(sudden.ahead_m, width_m=width_m, left_m=left_m, from_s=APPEARS_S),),
        seed=cell.seed,
        driver=Source.TELEOP if sudden.driver == "human" else Source.NAVIGATION,
    )


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


def navigator_of(cell: Cell) -> Follower | None:
    """Return the driver of a run; None for the follower of the cell's law."""
    match SuddenRun.named(cell.scenario).driver:
        case "blind":
            return BlindDriver(cell.speed_mps)
        case "human":
            away_rad = -side_sign(cell.side) * CarSettings().max_steering_rad
            return BlindDriver(cell.speed_mps, away_rad, HUMAN_BEGINS_S)
        case _:
            return None
