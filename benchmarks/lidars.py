"""The car by each emulated lidar at 1 m/s. Run: python -m benchmarks.lidars [--lidars x2,a2] [--hazards] [--real].

Through the bytes of each, in virtual time: the mean error to the wall of the loop with a VESC and with a PCA9685, whose
car has its speed from the scans; for how much of the way these do not tell it; contacts in the corners and the doorway.
--hazards: those of `wallride lab hazards` that are touched on both sides by a navigator who ignores them, two minutes
for each lidar. --real: p50 from the last byte of a scan to the motor's command, and the processor time of the process
for each scan, in real time. Exit code 1 after a contact.
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
from wallride.runtime.settings.tree import load_settings
from wallride.sim.car.vehicle import Vehicle
from wallride.sim.devices.lidar_kinds import HOKUYO, assignments, device_for
from wallride.sim.lab.cell import Cell
from wallride.sim.lab.hazards import HAZARDS, case_of_hazard
from wallride.sim.lab.laws import build, drive_case
from wallride.sim.live.record import Record
from wallride.sim.live.scenes import WorldScene
from wallride.sim.live.session import RuntimeStart, SimulatorSession
from wallride.sim.live.stop_request import StopRequest
from wallride.sim.scenario.simulated_car import find_config
from wallride.sim.virtual.closed_loop import Case, SimulatedRun, drive
from wallride.sim.world.beams import LidarSettings
from wallride.sim.world.worlds import load_world

LIDARS: Final = (HOKUYO, "a1", "a2", "a3", "c1", "s1", "s2", "s3", "x2", "x4", "x4-pro", "g4", "g6", "tg")
SPEED_MPS: Final = 1.0
BEAMS: Final = LidarSettings(noise_std_m=0.01, outlier_share=0.005)
LOOP_S, SETTLED_S = 30.0, 5.0
PLACES: Final = ("inside_corner", "outside_corner", "doorway")
PLACE_S: Final = 10.0
SHORT_S, LONG_S = 6.0, 16.0
"""Two drives in real time, whose difference is without the start of the process."""


@dataclass(frozen=True, slots=True)
class LidarFigures:
    """What came of a lidar in virtual time. errors_m: with a VESC, with a PCA9685. blind: share of the time.

    touched: places. hazards: None where they were not driven.
    """

    errors_m: tuple[float, float]
    blind: float
    touched: tuple[str, ...]
    hazards: tuple[str, ...] | None


def main(arguments: Sequence[str] | None = None) -> int:
    """Drive all, and print the table."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--lidars", default=",".join(LIDARS))
    parser.add_argument("--workers", type=int, default=1)
    parser.add_argument("--hazards", action="store_true")
    parser.add_argument("--real", action="store_true", help="also in real time: needs an idle computer")
    options = parser.parse_args(arguments)
    logging.disable(logging.CRITICAL)
    words, failed = options.lidars.split(","), False
    print("| lidar | VESC | PCA9685 | blind | corners, doorway | hazards | p50 | CPU |")
    with ProcessPoolExecutor(options.workers) as pool:
        for word, one in zip(words, pool.map(driven, words, [options.hazards] * len(words)), strict=True):
            print(_row(word, one, asyncio.run(timed(word)) if options.real else None), flush=True)
            failed = failed or bool(one.touched or one.hazards)
    return int(failed)


def _row(word: str, one: LidarFigures, times_ms: tuple[float, float] | None) -> str:
    """Return a line of the table, and one for each hazard that was touched."""
    hazards = "-" if one.hazards is None else f"{len(one.hazards)} of {2 * len(HAZARDS)}"
    times = "- | -" if times_ms is None else f"{times_ms[0]:.2f} ms | {times_ms[1]:.2f} ms"
    row = (
        f"| {word} | {one.errors_m[0]:.3f} m | {one.errors_m[1]:.3f} m | {100 * one.blind:.0f} %"
        f" | {', '.join(one.touched) or 'clear'} | {hazards} | {times} |"
    )
    return "\n".join([row, *(f"    touched: {name}" for name in one.hazards or ())])


def driven(word: str, hazards: bool) -> LidarFigures:  # noqa: FBT001 - mapped over words
    """Return how the car drives by a lidar."""
    turning = "" if word == HOKUYO else word
    loop = _wall(turning, "loop", LOOP_S)
    pwm = PwmDrive("loop", SPEED_MPS, word, BEAMS)
    seen = pwm.run(LOOP_S)
    seen = seen[seen[:, 0] > SETTLED_S]
    places = {place: _wall(turning, place, PLACE_S) for place in PLACES}
    touched = [place for place, run in places.items() if run.contact is not None]
    touched += ["loop"] * (loop.contact is not None) + ["loop with a PCA9685"] * pwm.touched
    errors_m = loop.error_m[loop.time_s > SETTLED_S]
    return LidarFigures(
        (float(np.abs(errors_m[np.isfinite(errors_m)]).mean()), float(np.abs(seen[:, 2] - 1.0).mean())),
        float(seen[:, 3].mean()), tuple(touched), tuple(_hazards(turning)) if hazards else None,
    )  # fmt: skip


def _wall(turning: str, world: str, duration_s: float) -> SimulatedRun:
    follower, guard = build("ball", "left", 1.0, SPEED_MPS)
    return drive(
        Case(load_world(world, side="left"), turning=turning, lidar=BEAMS, duration_s=duration_s), follower, guard
    )


def _hazards(turning: str) -> list[str]:
    """Return the hazards that were touched while the car moved."""
    touched = []
    for name in HAZARDS:
        for side in ("left", "right"):
            cell = Cell("hazards", name, "ball", SPEED_MPS, 0.8, side, 1)
            case, blind = case_of_hazard(cell)
            run = drive_case(cell, replace(case, turning=turning), blind)
            if run.contact is not None and run.contact.speed_mps > 0.01:
                touched.append(f"{name}, {side}, at {run.contact.speed_mps:.2f} m/s")
    return touched


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
