"""Maps of one simulated lap against the truth, and maps of broken recordings, which must be refused or corrected.

Run: python -m benchmarks.racing.maps --data DATA

Each drive is a lap along the wall and LATER_M more, with the default laws: ranges with 20 mm of noise and 2 % of
outliers, the sweep skewed by the motion, wheels that report 3 % too much, a steering trim of 0.02 rad, a gyro with a
bias of 0.01 rad/s, noise of 0.01 rad/s and a scale 1 % wrong (every other drive has none). The errors are those of the
path after one rigid alignment with the truth, the time that of one core. Exit code 1 where a good map is refused, or a
wrong one is called good.
"""

import argparse
import json
import sys
import time
from collections.abc import Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from wallride.drivers.api import MotorState, Scan
from wallride.runtime.control.guidance import Follower, Guidance
from wallride.runtime.control.vehicle import CarSettings
from wallride.sim.car.vehicle import VehicleSettings
from wallride.sim.lab.laws import build
from wallride.sim.mapping.closing import ClosedLap, close_lap
from wallride.sim.mapping.lap_record import LapRecord, read_record, record_of_scans
from wallride.sim.mapping.odometry_path import of_the_axle
from wallride.sim.mapping.verdict import judge_map
from wallride.sim.racing.ring import ring_length_m, ring_of
from wallride.sim.virtual.closed_loop import Case, drive
from wallride.sim.world.lap import Lap
from wallride.sim.world.place import World
from wallride.sim.world.pose import Floats, Pose
from wallride.sim.world.segments import SegmentGeometry, chain
from wallride.sim.world.worlds import load_world

MAPS = ("levine", "berlin", "skirk", "hangar", "track_porto", "stata_basement", "aut", "gbr")
TRACKS = ("track:seed=7", "track:seed=23")
SPEEDS_MPS, FRICTIONS = (2.0, 4.0), (0.5, 0.8)
LATER_M = 15.0
RMS_M, MAX_M, TIME_S, REAL_RESIDUAL_M = 0.03, 0.10, 10.0, 0.016
WHEELS, TRIM_RAD = 1.03, 0.02
GYRO_BIAS_RADPS, GYRO_NOISE_RADPS, GYRO_SCALE = 0.01, 0.01, 1.01
STANDING_S, RATE_S = 2.0, 0.02
FLAWS = ("open", "silent", "wheels")
"""Broken recordings: cut off before the lap is whole; 10 s without scans; wheels 10 % wrong."""
FLAWED = ("levine", "hangar", "track:seed=7")
COLONNADE = "colonnade"
"""A ring of 24 x 8 m, bare but for equal pillars 0.6 m apart along the side with the start: places that look alike."""
SILENT_S = 10.0


@dataclass(frozen=True, slots=True)
class MapDrive:
    """One lap. flaw: one of FLAWS, or "". gyro: whether the recording has one."""

    place: str
    speed_mps: float
    mu: float
    seed: int
    gyro: bool
    flaw: str = ""


class Taker:
    """A follower that keeps what it is given."""

    def __init__(self, follower: Follower) -> None:
        self._follower = follower
        self.scans: list[Scan] = []
        self.states: list[MotorState] = []

    def follow(self, scan: Scan, motor: MotorState | None) -> Guidance:
        """Answer as the follower does."""
        self.scans.append(scan)
        if motor is not None:
            self.states.append(motor)
        return self._follower.follow(scan, motor)


def recorded(lap: MapDrive, data: Path) -> tuple[LapRecord, Floats]:
    """Return the recording of a drive, and the true poses of the rear axle at its scans, (n, 3)."""
    world = world_of(lap.place, data)
    desired_m = min(1.0, world.room_m)
    follower, guard = build("ball", world.side, desired_m, lap.speed_mps)
    taker = Taker(follower)
    way_m = 1.05 * ring_length_m(ring_of(world)) + LATER_M
    case = Case(
        world, desired_m=desired_m, distance_m=way_m, duration_s=300.0, standing_s=5.0, seed=lap.seed,
        vehicle=VehicleSettings(grip_mu=lap.mu, trim_rad=TRIM_RAD),
    )  # fmt: skip
    run = drive(case, taker, guard)
    record = record_of_scans(lap.place, taker.scans, taker.states, CarSettings())
    wheels = 1.10 if lap.flaw == "wheels" else WHEELS
    reports = record.reports * np.array([1.0, wheels, wheels, 1.0])
    standing_s = np.arange(-STANDING_S, 0.0, RATE_S)
    stood = np.column_stack([standing_s, *np.zeros((3, standing_s.size))])
    record = replace(record, reports=np.vstack([stood, reports]))
    if lap.gyro:
        record = replace(record, gyro=_gyro(record.scan_s, run.pose[:, 2], standing_s, lap.seed))
    return _flawed(record, run.pose, lap.flaw)


def world_of(place: str, data: Path) -> World:
    """Return a world by its name, or that of a map of the data."""
    if place == COLONNADE:
        return _colonnade()
    return load_world(place if ":" in place or place == "loop" else data / "maps" / f"{place}.yaml")


def _colonnade() -> World:
    walls = [
        *chain([(-12, -4), (12, -4), (12, 4), (-12, 4)], closed=True),
        *chain([(-10, -2), (10, -2), (10, 2), (-10, 2)], closed=True),
    ]
    pillars = [(x_m, 3.85, 0.06) for x_m in np.arange(-9.0, 9.1, 0.6)]
    centre = Lap([(-9.0, 3.0), (11.0, 3.0), (11.0, -3.0), (-11.0, -3.0), (-11.0, 3.0)])
    return World(COLONNADE, SegmentGeometry(np.array(walls), np.array(pillars)), Pose(-9.0, 3.0, 0.0), lap=centre)


def _gyro(time_s: Floats, yaw_rad: Floats, standing_s: Floats, seed: int) -> Floats:
    rates = np.diff(np.unwrap(yaw_rad)) / np.diff(time_s)
    true = np.concatenate([np.zeros(standing_s.size), rates])
    noise = np.random.default_rng(seed).normal(0.0, GYRO_NOISE_RADPS, true.size)
    at_s = np.concatenate([standing_s, (time_s[1:] + time_s[:-1]) / 2])
    return np.column_stack([at_s, GYRO_SCALE * true + GYRO_BIAS_RADPS + noise])


def _flawed(record: LapRecord, truth: Floats, flaw: str) -> tuple[LapRecord, Floats]:
    count = len(record.scan_s)
    keep = np.ones(count, dtype=bool)
    if flaw == "open":
        keep[int(0.6 * count) :] = False
    elif flaw == "silent":
        begin_s = float(record.scan_s[int(0.3 * count)])
        keep = ~((record.scan_s > begin_s) & (record.scan_s < begin_s + SILENT_S))
    return replace(record, scan_s=record.scan_s[keep], ranges_m=record.ranges_m[keep]), truth[keep]


def errors_m(lap: ClosedLap, record: LapRecord, truth: Floats) -> Floats:
    """Return the distance of each keyframe from the truth after one rigid alignment, (n,)."""
    axle = of_the_axle(lap.poses, record.lidar_m)
    found = axle[:, 0] + 1j * axle[:, 1]
    index = np.searchsorted(record.scan_s, [frame.time_s for frame in lap.frames])
    true = truth[index, 0] + 1j * truth[index, 1]
    found, true = found - found.mean(), true - true.mean()
    turn = np.vdot(found, true)
    return np.abs(found * turn / abs(turn) - true)


def measure(lap: MapDrive, data: Path) -> dict[str, Any]:
    """Return the figures of one drive's map."""
    record, truth = recorded(lap, data)
    begun_s = time.process_time()
    closed = close_lap(record)
    took_s = time.process_time() - begun_s
    verdict = judge_map(record, closed)
    off_m = errors_m(closed, record, truth)
    rms_m, max_m = float(np.sqrt(np.mean(off_m**2))), float(off_m.max())
    exact = rms_m <= RMS_M and max_m <= MAX_M
    return {
        "place": lap.place, "speed_mps": lap.speed_mps, "mu": lap.mu, "gyro": lap.gyro, "flaw": lap.flaw,
        "way_m": verdict.way_m, "rms_m": rms_m, "max_m": max_m, "took_s": took_s, "scale": closed.car.scale,
        "loops": verdict.loops, "full": verdict.full_loops, "chi2": verdict.contradiction,
        "residual_m": verdict.residual_m, "inliers": verdict.inliers, "reasons": verdict.reasons,
        "holds": exact and took_s <= TIME_S if verdict.good else bool(lap.flaw),
    }  # fmt: skip


def measure_real(path: Path) -> dict[str, Any]:
    """Return the figures of a real recording, of which the truth is not known."""
    record = read_record(path)
    begun_s = time.process_time()
    verdict = judge_map(record, close_lap(record), is_open=True)
    return {
        "place": path.stem, "way_m": verdict.way_m, "took_s": time.process_time() - begun_s,
        "residual_m": verdict.residual_m, "inliers": verdict.inliers, "unmatched": verdict.unmatched,
        "reasons": verdict.reasons, "holds": verdict.residual_m <= REAL_RESIDUAL_M,
    }  # fmt: skip


def drives(seed: int, places: Sequence[str]) -> list[MapDrive]:
    """Return the good laps, then the flawed ones, and those of places that look alike."""
    good = [
        MapDrive(place, speed_mps, mu, seed + number, gyro=number % 2 == 0)
        for number, (place, speed_mps, mu) in enumerate(
            (place, speed_mps, mu) for place in places for speed_mps in SPEEDS_MPS for mu in FRICTIONS
        )
    ]
    flawed = [
        MapDrive(place, 2.0, 0.8, seed + 100 + number, gyro=number % 2 == 0, flaw=flaw)
        for number, (place, flaw) in enumerate((place, flaw) for place in FLAWED if place in places for flaw in FLAWS)
    ]
    alike = [
        MapDrive(COLONNADE, 2.0, mu, seed + 200 + number, gyro=number % 2 == 0, flaw="wheels")
        for number, mu in enumerate(FRICTIONS)
    ]
    return [*good, *flawed, *alike]


def shown(row: dict[str, Any]) -> str:
    """Return a row of the table."""
    words = "; ".join(row["reasons"]) or "good"
    mark = "" if row["holds"] else "  <-- does not hold"
    if "mu" not in row:
        return (
            f"{row['place']:24} {row['way_m']:6.1f} m  residual {1000 * row['residual_m']:4.1f} mm"
            f"  inliers {row['inliers']:.2f}  {row['took_s']:4.1f} s  {words}{mark}"
        )
    return (
        f"{row['place']:15} {row['speed_mps']:g} m/s mu {row['mu']:g} {'gyro' if row['gyro'] else '-':4}"
        f" {row['flaw']:8} {row['way_m']:6.1f} m  rms {100 * row['rms_m']:5.1f} cm  max {100 * row['max_m']:5.1f} cm"
        f"  {row['took_s']:4.1f} s  scale {row['scale']:.3f}  loops {row['full']}/{row['loops']}"
        f"  chi2 {row['chi2']:.3f}  residual {1000 * row['residual_m']:.1f} mm  {words}{mark}"
    )


def main() -> int:
    """Measure and print."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").split("\n", 1)[0])
    parser.add_argument("--data", type=Path, required=True, help="folder with maps/ and racecar/")
    parser.add_argument("--places", nargs="*", default=[*MAPS, *TRACKS], help="maps and tracks (default: all ten)")
    parser.add_argument("--seed", type=int, default=1000)
    parser.add_argument("--jobs", type=int, default=1)
    parser.add_argument("--no-real", action="store_true", help="leave out the real recordings")
    parser.add_argument("--json", type=Path, help="file for all figures")
    options = parser.parse_args()
    laps = drives(options.seed, options.places)
    rows = []
    with ProcessPoolExecutor(options.jobs) as pool:
        for row in pool.map(measure, laps, [options.data] * len(laps)):
            rows.append(row)
            print(shown(row), flush=True)
    for path in [] if options.no_real else sorted((options.data / "racecar").glob("*.npz")):
        if "standing" in path.stem or "no_scan" in path.stem or "foreign" in path.stem:
            continue
        rows.append(measure_real(path))
        print(shown(rows[-1]), flush=True)
    if options.json:
        options.json.write_text(json.dumps(rows, indent=1) + "\n")
    return 0 if all(row["holds"] for row in rows) else 1


if __name__ == "__main__":
    sys.exit(main())
