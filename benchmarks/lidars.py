"""The car by each emulated lidar. Run: python -m benchmarks.lidars [--lidars x2,a2] [--allowed] [--hazards] [--real].

Through the bytes of each, in virtual time, at 1 m/s or with --allowed at what each lidar allows, 2 m/s at most: the
mean error to the wall of the loop with a VESC, its ratio to the UST-10LX's at the same speed, and with a PCA9685, whose
car has its speed from the scans; for how much of the way these do not tell it; contacts in the corners and the doorway.
--hazards: those of `wallride lab hazards` that are touched on both sides by a navigator who ignores them, half a minute
for each lidar and seed. --boxes: sudden boxes of `wallride lab safety` that are hit. Of both count those that a full
brake from the first scan that shows them would not have touched. --real: p50 from the last byte of a scan to the
motor's command, and the processor time of the process for each scan, in real time. Exit code 1 after a contact.
"""

import argparse
import asyncio
import logging
import math
import sys
from collections.abc import Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass, replace
from typing import Final

import numpy as np

from tests.system.pwm_drive import PwmDrive
from wallride.drivers.api import Scan
from wallride.runtime.control.guidance import Follower
from wallride.runtime.settings.tree import load_settings
from wallride.sim.car.vehicle import Vehicle
from wallride.sim.devices.lidar_kinds import HOKUYO, assignments, device_for
from wallride.sim.lab.cell import Cell
from wallride.sim.lab.courses.sudden import BrakingGuard, case_of, navigator_of, scenarios
from wallride.sim.lab.hazards import HAZARDS, case_of_hazard
from wallride.sim.lab.laws import build, settings_of, stack_of
from wallride.sim.live.record import Record
from wallride.sim.live.scenes import WorldScene
from wallride.sim.live.session import RuntimeStart, SimulatorSession
from wallride.sim.live.stop_request import StopRequest
from wallride.sim.races.mapped_lap import KeepingFollower
from wallride.sim.scenario.simulated_car import find_config
from wallride.sim.virtual.closed_loop import Case, SimulatedRun, drive
from wallride.sim.world.beams import LidarSettings
from wallride.sim.world.pose import Side
from wallride.sim.world.worlds import load_world

LIDARS: Final = (HOKUYO, "a1", "a2", "a3", "c1", "s1", "s2", "s3", "x2", "x4", "x4-pro", "g4", "g6", "tg")
SPEED_MPS: Final = 1.0
MOST_MPS: Final = 2.0
STANDS_MPS: Final = 0.01
GRIP_MU: Final = 0.8
BOXES_AHEAD_M: Final = (0.6, 0.9, 1.2)
BEAMS: Final = LidarSettings(noise_std_m=0.01, outlier_share=0.005)
LOOP_S, SETTLED_S = 30.0, 5.0
PLACES: Final = ("inside_corner", "outside_corner", "doorway")
PLACE_S: Final = 10.0
SHORT_S, LONG_S = 6.0, 16.0
"""Two drives in real time, whose difference is without the start of the process."""


@dataclass(frozen=True, slots=True)
class LidarFigures:
    """What came of a lidar in virtual time, at speed_mps. errors_m: with a VESC, with a PCA9685.

    ratio: of the first to the UST-10LX's. blind: share of the time. touched: places. hazards, boxes: of how many drives
    which touched something.
    """

    speed_mps: float
    errors_m: tuple[float, float]
    ratio: float
    blind: float
    touched: tuple[str, ...]
    hazards: "Touches"
    boxes: "Touches"


@dataclass(frozen=True, slots=True)
class Touches:
    """Of `drives` those that touched something. 0: none was driven."""

    drives: int = 0
    names: tuple[str, ...] = ()

    def __str__(self) -> str:
        return f"{len(self.names)} of {self.drives}" if self.drives else "-"


@dataclass(frozen=True, slots=True)
class Wanted:
    """What is to be driven, with these seeds. allowed: at the speed that each lidar allows."""

    seeds: tuple[int, ...] = (1,)
    allowed: bool = False
    hazards: bool = False
    boxes: bool = False


def main(arguments: Sequence[str] | None = None) -> int:
    """Drive all, and print the table."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--lidars", default=",".join(LIDARS))
    parser.add_argument("--workers", type=int, default=1)
    parser.add_argument("--seeds", default="1", help="with commas; the loop and the places have the first one")
    parser.add_argument("--allowed", action="store_true", help=f"as fast as each allows, up to {MOST_MPS:g} m/s")
    parser.add_argument("--hazards", action="store_true")
    parser.add_argument("--boxes", action="store_true")
    parser.add_argument("--real", action="store_true", help="also in real time: needs an idle computer")
    options = parser.parse_args(arguments)
    logging.disable(logging.CRITICAL)
    wanted = Wanted(tuple(map(int, options.seeds.split(","))), options.allowed, options.hazards, options.boxes)
    words, failed = options.lidars.split(","), False
    print("| lidar | m/s | VESC | of UST-10LX | PCA9685 | blind | corners, doorway | hazards | boxes | p50 | CPU |")
    times_ms = [asyncio.run(timed(word)) if options.real else None for word in words]  # while nothing else runs
    with ProcessPoolExecutor(options.workers) as pool:
        for word, one, time_ms in zip(words, pool.map(driven, words, [wanted] * len(words)), times_ms, strict=True):
            print(_row(word, one, time_ms), flush=True)
            failed = failed or bool(one.touched or one.hazards.names or one.boxes.names)
    return int(failed)


def _row(word: str, one: LidarFigures, times_ms: tuple[float, float] | None) -> str:
    """Return a line of the table, and one for each hazard or box that was touched."""
    times = "- | -" if times_ms is None else f"{times_ms[0]:.2f} ms | {times_ms[1]:.2f} ms"
    row = (
        f"| {word} | {one.speed_mps:.1f} | {one.errors_m[0]:.3f} m | {one.ratio:.2f} | {one.errors_m[1]:.3f} m"
        f" | {100 * one.blind:.0f} % | {', '.join(one.touched) or 'clear'} | {one.hazards} | {one.boxes} | {times} |"
    )
    return "\n".join([row, *(f"    touched: {name}" for name in one.hazards.names + one.boxes.names)])


def driven(word: str, wanted: Wanted) -> LidarFigures:
    """Return how the car drives by a lidar."""
    turning, seed = "" if word == HOKUYO else word, wanted.seeds[0]
    speed_mps = min(allowed_mps(turning), MOST_MPS) if wanted.allowed else SPEED_MPS
    loop, usual = (_wall(kind, "loop", speed_mps, LOOP_S, seed) for kind in (turning, ""))
    pwm = PwmDrive("loop", speed_mps, word, BEAMS, seed)
    seen = pwm.run(LOOP_S)
    seen = seen[seen[:, 0] > SETTLED_S]
    places = {place: _wall(turning, place, speed_mps, PLACE_S, seed) for place in PLACES}
    touched = [place for place, run in places.items() if run.contact is not None]
    touched += ["loop"] * (loop.contact is not None) + ["loop with a PCA9685"] * pwm.touched
    hazards = [cell for name in HAZARDS for cell in _cells("hazards", name, speed_mps, wanted.seeds)]
    boxes = [cell for name in _boxes() for cell in _cells("safety", name, speed_mps, wanted.seeds)]
    return LidarFigures(
        speed_mps,
        (_error_m(loop), float(np.abs(seen[:, 2] - 1.0).mean())),
        _error_m(loop) / _error_m(usual),
        float(seen[:, 3].mean()),
        tuple(touched),
        _touches(turning, hazards) if wanted.hazards else Touches(),
        _touches(turning, boxes) if wanted.boxes else Touches(),
    )


def allowed_mps(turning: str) -> float:
    """Return the speed that a lidar allows: the bound that the car's status names after a second."""
    laws = stack_of("ball", settings_of("ball", "left", 1.0, SPEED_MPS))
    drive(Case(load_world("corridor", side="left"), turning=turning, duration_s=1.0), laws.follower, laws.judge)
    return laws.guard.reach.limit.forward_mps


def _wall(turning: str, world: str, speed_mps: float, duration_s: float, seed: int) -> SimulatedRun:
    follower, guard = build("ball", "left", 1.0, speed_mps)
    place = load_world(world, side="left")
    return drive(Case(place, turning=turning, lidar=BEAMS, duration_s=duration_s, seed=seed), follower, guard)


def _error_m(run: SimulatedRun) -> float:
    errors_m = run.error_m[run.time_s > SETTLED_S]
    return float(np.abs(errors_m[np.isfinite(errors_m)]).mean())


def _boxes() -> list[str]:
    """Return the sudden boxes of `lab safety`: a blind driver's, and the car's own follower's."""
    names = [f"{ahead_m:.1f} m" for ahead_m in BOXES_AHEAD_M]
    return names + [name for name in scenarios(BOXES_AHEAD_M, quick=False) if name.startswith("follower")]


def _cells(experiment: str, name: str, speed_mps: float, seeds: Sequence[int]) -> list[Cell]:
    sides: tuple[Side, ...] = ("left", "right")
    return [Cell(experiment, name, "ball", speed_mps, GRIP_MU, side, seed) for side in sides for seed in seeds]


def _touches(turning: str, cells: Sequence[Cell]) -> Touches:
    """Drive cells; return those that touched, while the car moved, what a full brake would not have touched."""
    names = []
    for cell in cells:
        case, blind = case_of_hazard(cell) if cell.experiment == "hazards" else (case_of(cell), navigator_of(cell))
        case = replace(case, turning=turning)
        run, shown = _watched(cell, case, blind)
        at_mps = _touch_mps(run)
        if at_mps and not (case.obstacles and _touch_mps(_braked(cell, case, blind, shown))):
            names.append(f"{cell.scenario}, {cell.side}, seed {cell.seed}, at {at_mps:.2f} m/s")
    return Touches(len(cells), tuple(names))


def _watched(cell: Cell, case: Case, navigator: Follower | None) -> tuple[SimulatedRun, list[Scan]]:
    """Drive a case; return it, and the scans that the car was shown."""
    follower, guard = build(cell.law, cell.side, case.desired_m, cell.speed_mps)
    keeper = KeepingFollower(navigator or follower)
    return drive(case, keeper, guard), keeper.scans


def _braked(cell: Cell, case: Case, navigator: Follower | None, shown: Sequence[Scan]) -> SimulatedRun:
    """Return the same drive that brakes in full from the first scan on that shows something of the obstacles.

    shown: the scans of the drive. Without the obstacles it has the same noise, and the same scans up to that one.
    """
    _, empty = _watched(cell, replace(case, obstacles=()), navigator)
    differ = (
        one.stamp_s for one, other in zip(shown, empty, strict=False)
        if not np.array_equal(one.ranges_m, other.ranges_m, equal_nan=True)
    )  # fmt: skip
    follower, _ = build(cell.law, cell.side, case.desired_m, cell.speed_mps)
    return drive(case, navigator or follower, BrakingGuard(None, next(differ, math.inf)))


def _touch_mps(run: SimulatedRun) -> float:
    """Return the speed at which the car touched something, 0 where it did not or stood."""
    speed_mps = run.contact.speed_mps if run.contact is not None else 0.0
    return speed_mps if speed_mps > STANDS_MPS else 0.0


async def timed(word: str) -> tuple[float, float]:
    """Return p50 from scan to motor and the processor time for each scan, both in ms."""
    short, long = [await _timed(word, duration_s) for duration_s in (SHORT_S, LONG_S)]
    cpu_ms = 1000.0 * (long.cpu_s - short.cpu_s) / (long.scans - short.scans)
    return float(long.latency.summary_ms()["p50"] or math.nan), cpu_ms


async def _timed(word: str, duration_s: float) -> Record:
    world = load_world("loop", side="left")
    vehicle = Vehicle(pose=world.start)
    scene = WorldScene(world, "left", BEAMS, None, 1)
    scene.turning = device_for(word)
    wanted = [
        *assignments(word),
        f"wall_follow.speed_mps={SPEED_MPS}",
        "telemetry.any_port=true",
        "recording.enabled=false",
    ]
    config = find_config()
    session = SimulatorSession(scene, vehicle, load_settings(config, wanted).motor)
    return await session.run(RuntimeStart(config, wanted), duration_s, StopRequest(), lambda _: None)


if __name__ == "__main__":
    sys.exit(main())
