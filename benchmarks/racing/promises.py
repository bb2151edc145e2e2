"""Laps on a race line by the true pose, judged by the arc or by the promised path, with sudden boxes or without.

Run: python -m benchmarks.racing.promises --data DATA [--places levine ...] [--boxes 20]

The driver knows the true pose and steers by the law of a path follower (delay, tyres); it promises the line from where
it is. The line is planned with `--lateral` of mu g, `--brake` and `--keep`, by default at what the tyres and the
motor's ramp hold. `--boxes` gives a drive for each: with even seeds a box of 0.3 m appears on the line or beside
it, with odd ones a box of 35 x 32 cm stands there from the start. Exit code 1 where the car touched anything that a
full brake avoids.
"""

import argparse
import cmath
import math
import sys
from collections.abc import Iterator
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.racing.maps import world_of
from wallride.drivers.api import Drive, MotorState, Scan
from wallride.runtime.arbitration.command import Source
from wallride.runtime.control.guidance import Guidance, Promise
from wallride.runtime.control.laws import LawStack
from wallride.runtime.control.perception.geometry import Floats, Places
from wallride.runtime.control.vehicle import GRAVITY_MPS2, CarSettings
from wallride.runtime.settings.tree import load_settings
from wallride.sim.car.vehicle import Vehicle, VehicleSettings
from wallride.sim.lab.safety import impact_mps
from wallride.sim.racing.free_space import FreeSpace
from wallride.sim.racing.raceline import RaceLine, race_line
from wallride.sim.racing.ring import ring_of
from wallride.sim.racing.speed_profile import Grip
from wallride.sim.virtual.closed_loop import FULL_BRAKE_MPS2, Case, SimulatedRun, drive
from wallride.sim.world.obstacles import LIDAR_AHEAD_M, Box, Obstacle, StandingObstacle, sudden_box
from wallride.sim.world.pose import CAR, Pose

PLACES = ("levine", "berlin", "track_porto", "hangar", "skirk", "loop")
RADIUS_M = 0.933
DELAY_S, LAG_S, JOINS_M, JOINS_S = 0.045, 0.1, 1.2, 0.5
STEERS_PER_S, DAMPS = 5.0, 0.9
FRONT_PER_RAD, REAR_PER_RAD = 4.718, 5.456
MOST_ASIDE_M = 0.4
REACTION_S = 0.06
HARDER_MPS = 0.15


@dataclass(frozen=True, slots=True)
class PlannedDrive:
    """One drive. promises: judged by the promised path. box: seed of a sudden box, -1: laps."""

    place: str
    data: Path
    mu: float
    promises: bool
    seed: int
    box: int = -1
    lateral: float = 0.85
    brake_mps2: float = 4.6
    keep_m: float = 0.32
    speed_mps: float = 6.0
    floor: float = 1.0
    laps: int = 3


class LineDriver:
    """Drives a line by the true pose of a vehicle, and promises it."""

    def __init__(self, line: RaceLine, mu: float, *, promises: bool) -> None:
        self._line, self._grip_mps2, self._promises = line, mu * GRAVITY_MPS2, promises
        self._places: Places = line.x_m + 1j * line.y_m
        self._steering_rad = 0.0
        self.vehicle: Vehicle | None = None
        self.aside_m: list[float] = []

    def meet(self, vehicle: Vehicle) -> None:
        """Take the vehicle, whose pose is known."""
        self.vehicle = vehicle

    def follow(self, scan: Scan, motor: MotorState | None) -> Guidance:
        """Answer one scan."""
        assert self.vehicle is not None  # noqa: S101 - met before
        pose, speed_mps = self.vehicle.pose, max(motor.speed_mps if motor else 0.0, 0.0)
        turn_radps, v = self.vehicle.twist.yaw_rate_radps, max(speed_mps, 1.0)
        rolls_rad = self._steering_rad - self._understeer_rad(v * turn_radps)
        asked_radps = v * math.tan(rolls_rad) / CarSettings().wheelbase_m
        change_radps = (1.0 - math.exp(-DELAY_S / LAG_S)) * (asked_radps - turn_radps)
        turned_rad = (turn_radps + 0.5 * change_radps) * DELAY_S
        way_rad = pose.yaw_rad + 0.5 * turned_rad - self._rear_rad(v * turn_radps)
        place = complex(pose.x_m, pose.y_m) + speed_mps * DELAY_S * cmath.exp(1j * way_rad)
        drive = self._answer(place, pose.yaw_rad + turned_rad, v)
        self._steering_rad = drive.steering_rad
        at = self._nearest(complex(pose.x_m, pose.y_m))
        self.aside_m.append(abs(self._aside_m(at, complex(pose.x_m, pose.y_m))))
        promise = self._promise(pose, speed_mps, scan.stamp_s) if self._promises else None
        return Guidance(drive, math.nan, self.aside_m[-1], math.nan, "race line", promise=promise)

    def _nearest(self, place: complex) -> int:
        return int(np.abs(self._places - place).argmin())

    def _aside_m(self, at: int, place: complex) -> float:
        return float(((place - self._places[at]) * cmath.exp(-1j * float(self._line.yaw_rad[at]))).imag)

    def _answer(self, place: complex, yaw_rad: float, v: float) -> Drive:
        at, line = self._nearest(place), self._line
        bend = float(line.curvature_radpm[at])
        off_m = min(max(self._aside_m(at, place), -MOST_ASIDE_M), MOST_ASIDE_M)
        off_rad = math.remainder(yaw_rad - self._rear_rad(v * v * bend) - float(line.yaw_rad[at]), math.tau)
        turn = self._at(line.curvature_radpm, at, 0.04 * v + 0.05)
        turn -= 2 * DAMPS * STEERS_PER_S / v * math.sin(off_rad) + (STEERS_PER_S / v) ** 2 * off_m
        steering_rad = math.atan(CarSettings().wheelbase_m * turn) + self._understeer_rad(v * v * turn)
        most_rad = CarSettings().max_steering_rad
        return Drive(self._at(line.speed_mps, at, 0.1 * v), min(max(steering_rad, -most_rad), most_rad))

    def _rear_rad(self, aside_mps2: float) -> float:
        return _slip_rad(REAR_PER_RAD, aside_mps2, self._grip_mps2)

    def _understeer_rad(self, aside_mps2: float) -> float:
        return _slip_rad(FRONT_PER_RAD, aside_mps2, self._grip_mps2) - self._rear_rad(aside_mps2)

    def _at(self, values: Floats, at: int, ahead_m: float) -> float:
        steps = ahead_m / (self._line.length_m / len(values))
        return float(values[(at + round(steps)) % len(values)])

    def _promise(self, pose: Pose, speed_mps: float, stamp_s: float) -> Promise:
        """Return the line, joined from place, course and curvature of the car by a polynomial of its offset."""
        assert self.vehicle is not None  # noqa: S101 - met before
        line, count = self._line, len(self._places)
        here, v = complex(pose.x_m, pose.y_m), max(speed_mps, 1.0)
        at, step_m = self._nearest(here), line.length_m / count
        bend = self.vehicle.twist.yaw_rate_radps / v
        course_rad = pose.yaw_rad - self._rear_rad(v * v * bend)
        along_m = ((here - self._places[at]) * cmath.exp(-1j * float(line.yaw_rad[at]))).real
        first = 1 if along_m > -step_m / 2 else 0
        index = (at + first + np.arange(math.ceil(max(3.0, 0.15 * v + v * v / 6.0 + 1.0) / step_m))) % count
        way_m = step_m * (first + np.arange(index.size)) - along_m
        joins_m = max(JOINS_M, JOINS_S * v)
        u = np.minimum(way_m / joins_m, 1.0)
        slope = math.tan(math.remainder(course_rad - float(line.yaw_rad[at]), math.tau))
        offs_m = (
            self._aside_m(at, here) * (1 - 10 * u**3 + 15 * u**4 - 6 * u**5)
            + slope * joins_m * (u - 6 * u**3 + 8 * u**4 - 3 * u**5)
            + (bend - float(line.curvature_radpm[at])) * joins_m**2 * 0.5 * (u**2 - 3 * u**3 + 3 * u**4 - u**5)
        )
        path = self._places[index] + 1j * np.exp(1j * line.yaw_rad[index]) * offs_m
        seen = np.append(0.0, (path - here) * cmath.exp(-1j * pose.yaw_rad))
        speeds_mps = np.append(line.speed_mps[at], line.speed_mps[index])
        return Promise(np.stack([seen.real, seen.imag]), speeds_mps, 0.03, stamp_s)


def _slip_rad(stiffness_per_rad: float, aside_mps2: float, grip_mps2: float) -> float:
    x = min(abs(aside_mps2) / grip_mps2, 0.97)
    return math.copysign(x / (1.0 - x**4) ** 0.25 / stiffness_per_rad, aside_mps2)


@lru_cache(maxsize=16)
def planned(place: str, data: Path, grip: Grip, keep_m: float) -> RaceLine:
    """Return the line of a place."""
    world = world_of(place, data)
    return race_line(ring_of(world), FreeSpace(world.outline_m), grip, keep_m=keep_m, radius_m=RADIUS_M)


def driven(one: PlannedDrive) -> tuple[SimulatedRun, LineDriver, RaceLine, LawStack]:
    """Drive the laps, or until a box is met."""
    world = world_of(one.place, one.data)
    grip = Grip(one.mu, one.lateral, one.brake_mps2 / (one.mu * GRAVITY_MPS2), speed_mps=one.speed_mps)
    line = planned(one.place, one.data, grip, one.keep_m)
    settings = load_settings(None, [f"car.max_speed_mps={one.speed_mps}", f"safety.grip_mu={max(one.mu, 0.5)}"])
    rng = np.random.default_rng(one.box if one.box >= 0 else one.seed)
    at = int(rng.integers(len(line.x_m))) if one.box >= 0 else 0
    obstacles: tuple[Obstacle, ...] = ()
    if one.box >= 0 and one.box % 2:
        place = (at + int(rng.integers(60, 140))) % len(line.x_m)
        left_m, yaw_rad = float(rng.choice((0.0, 0.2, -0.2))), float(line.yaw_rad[place])
        x_m, y_m = line.x_m[place] - left_m * math.sin(yaw_rad), line.y_m[place] + left_m * math.cos(yaw_rad)
        obstacles = (Obstacle(Box(0.35, 0.32), StandingObstacle(Pose(float(x_m), float(y_m), yaw_rad))),)
    elif one.box >= 0:
        obstacles = (
            sudden_box(
                float(rng.uniform(0.4, 2.5)), width_m=0.3, left_m=float(rng.choice((0.0, 0.2, -0.2, 0.35, -0.35))),
                from_s=float(rng.uniform(2.0, 6.0)),
            ),
        )  # fmt: skip
    start = Pose(float(line.x_m[at]), float(line.y_m[at]), float(line.yaw_rad[at]))
    case = Case(
        world, start, distance_m=(one.laps + 0.2) * line.length_m, duration_s=9.0 if one.box >= 0 else 200.0,
        standing_s=1.0 if one.box >= 0 else 5.0, seed=one.seed, obstacles=obstacles, car=settings.car,
        vehicle=VehicleSettings(grip_mu=one.mu * one.floor),
    )  # fmt: skip
    driver = LineDriver(line, one.mu, promises=one.promises)
    laws = LawStack(settings.wall_follow, settings.safety, settings.car, driver=lambda _: _Named(driver))
    return drive(case, laws.follower, laws.judge, driver.meet), driver, line, laws


class _Named:
    """A driver with what the table of laws asks for."""

    path_m = None

    def __init__(self, driver: LineDriver) -> None:
        self.follow = driver.follow

    def tune(self, settings: object) -> None:
        """Change nothing."""


def figures(one: PlannedDrive) -> dict[str, Any]:
    """Return what a drive was like."""
    run, driver, line, laws = driven(one)
    stops = [stop for stop in run.stops if stop.winner is Source.SAFETY and stop.speed_mps > 0.3]
    row = {
        "place": one.place, "promises": one.promises, "theory_s": line.lap_s, "stops": len(stops),
        "capped": float(run.capped.mean()), "contact": run.contact is not None, "refused": laws.guard.memory.promises,
        "p99_m": float(np.percentile(driver.aside_m, 99)),
    }  # fmt: skip
    reasons: dict[str, int] = {}
    for reason, capped in zip(run.reasons, run.capped, strict=True):
        if capped:
            reasons[reason] = reasons.get(reason, 0) + 1
    row["reasons"] = dict(sorted(reasons.items(), key=lambda item: -item[1])[:5])
    if one.box < 0:
        way_m = np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(run.pose[:, :2], axis=0).T))])
        ends = np.interp(line.length_m * np.arange(1, one.laps + 1), way_m, run.time_s, right=np.nan)
        row["laps_s"] = np.diff(ends).round(2).tolist()
    else:
        row |= _met(one, run)
    return row


def _met(one: PlannedDrive, run: SimulatedRun) -> dict[str, Any]:
    """Return how a box was met. avoidable: touched harder than a full brake along the course from its first scan on."""
    shown = np.flatnonzero(run.appeared)
    if one.box % 2:  # seen in time
        return {"met": True, "hit_mps": run.contact.speed_mps if run.contact else 0.0, "brake_mps": 0.0}
    if not shown.size:
        return {"met": False, "hit_mps": 0.0, "brake_mps": 0.0}
    first = int(shown[0])
    speed_mps = float(run.speed_mps[first, 0])
    gap_m = run.case.obstacles[0].appearance.ahead_m + LIDAR_AHEAD_M - CAR.front_m  # type: ignore[union-attr]
    brake_mps2 = min(FULL_BRAKE_MPS2, one.mu * one.floor * GRAVITY_MPS2)
    hit_mps = run.contact.speed_mps if run.contact is not None else 0.0
    return {"met": True, "hit_mps": hit_mps, "brake_mps": impact_mps(speed_mps, gap_m, REACTION_S, brake_mps2),
            "at_mps": speed_mps}  # fmt: skip


def _drives(options: argparse.Namespace) -> Iterator[PlannedDrive]:
    for place in options.places:
        for promises in (False, True) if options.both else (True,):
            for number in range(max(1, options.boxes)):
                box = options.seed + number if options.boxes else -1
                yield PlannedDrive(
                    place, options.data, options.mu, promises, options.seed + number, box, options.lateral,
                    options.brake, options.keep, options.speed, options.floor,
                )  # fmt: skip


def main() -> int:
    """Measure and print."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").split("\n", 1)[0])
    parser.add_argument("--data", type=Path, required=True, help="folder with maps/")
    parser.add_argument("--places", nargs="*", default=PLACES)
    parser.add_argument("--mu", type=float, default=0.8)
    parser.add_argument("--floor", type=float, default=1.0, help="friction of the floor over the planned one")
    parser.add_argument("--lateral", type=float, default=0.85)
    parser.add_argument("--brake", type=float, default=4.6)
    parser.add_argument("--keep", type=float, default=0.32)
    parser.add_argument("--speed", type=float, default=6.0)
    parser.add_argument("--boxes", type=int, default=0)
    parser.add_argument("--seed", type=int, default=9000)
    parser.add_argument("--jobs", type=int, default=1)
    parser.add_argument("--no-arc", dest="both", action="store_false", help="with promises only")
    options = parser.parse_args()
    bad = 0
    with ProcessPoolExecutor(options.jobs) as pool:
        for row in pool.map(figures, _drives(options)):
            harder = row.get("hit_mps", 0.0) > row.get("brake_mps", 0.0) + HARDER_MPS
            bad += harder or (row["contact"] and not options.boxes)
            print(shown(row) + ("  <-- avoidable" if harder else ""), flush=True)
    return int(bad > 0)


def shown(row: dict[str, Any]) -> str:
    """Return a row of the table."""
    record = row["refused"]
    kind = "promise" if row["promises"] else "arc"
    head = f"{row['place']:12} {kind:8} stops {row['stops']:2}  capped {100 * row['capped']:3.0f} %"
    if "laps_s" in row:
        return (
            f"{head}  laps {row['laps_s']} theory {row['theory_s']:.2f} s, {100 * row['p99_m']:.0f} cm p99, contact "
            f"{row['contact']}, refused {record.refused} ({record.reason}) {row['reasons']}"
        )
    return f"{head}  at {row.get('at_mps', 0):.2f} m/s hit {row['hit_mps']:.2f} a full brake {row['brake_mps']:.2f}"


if __name__ == "__main__":
    sys.exit(main())
