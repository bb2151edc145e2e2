"""Maps of one simulated lap against the truth, and maps of broken recordings, which must be refused or corrected.

Run: python -m benchmarks.racing.maps --data DATA

Each drive is the lap of `wallride.sim.races.mapped_lap`, which names the errors of sensors, wheels and steering; every
other drive has no gyro. The errors are those of the path after one rigid alignment with the truth, the time that of
one core. Exit code 1 where a good map is refused, or a wrong one is called good.
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

from wallride.sim.mapping.closing import ClosedLap, close_lap
from wallride.sim.mapping.lap_record import LapRecord, read_record
from wallride.sim.mapping.verdict import judge_map
from wallride.sim.races.mapped_lap import WHEELS, MappingLap, keyframe_poses, recorded_lap
from wallride.sim.world.lap import Lap
from wallride.sim.world.place import World
from wallride.sim.world.pose import Floats, Pose
from wallride.sim.world.segments import SegmentGeometry, chain
from wallride.sim.world.worlds import load_world

MAPS = ("levine", "berlin", "skirk", "hangar", "track_porto", "stata_basement", "aut", "gbr")
TRACKS = ("track:seed=7", "track:seed=23")
SPEEDS_MPS, FRICTIONS = (2.0, 4.0), (0.5, 0.8)
RMS_M, MAX_M, TIME_S, REAL_RESIDUAL_M = 0.03, 0.10, 10.0, 0.016
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


def recorded(lap: MapDrive, data: Path) -> tuple[LapRecord, Floats]:
    """Return the recording of a drive, and the true poses of the rear axle at its scans, (n, 3)."""
    wheels = 1.10 if lap.flaw == "wheels" else WHEELS
    conditions = MappingLap(lap.speed_mps, lap.mu, lap.seed, lap.gyro, wheels)
    record, truth = recorded_lap(world_of(lap.place, data), conditions)
    return _flawed(record, truth, lap.flaw)


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
    poses = keyframe_poses(record, lap, truth)
    found, true = (some[:, 0] + 1j * some[:, 1] for some in (poses.found, poses.true))
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
