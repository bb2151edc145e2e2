"""Laps of `ball` and of `line` on the maps of real courses, in virtual time, against the truth.

Run: python -m benchmarks.racing.laps --data DATA [--places levine ...] [--mu 0.8 0.5]

Each course is mapped by a lap of `ball` at 2 m/s (`wallride map`), and its line is computed (`wallride line`, default
shares, for the floor's friction). Then the car drives from the beginning of the map with another seed: 20 mm of noise,
2 % of outliers, the sweep skewed by the motion, wheels that report 3 % too much, a steering trim of 0.02 rad, no gyro.
`ball` is asked for the same speed. A lap counts from the second flying one; the errors are those of the true pose, put
on the map by the mapped lap around it. Exit code 1 where a car touched anything.
"""

import argparse
import json
import os
import sys
import tempfile
import time
from collections.abc import Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.racing.maps import MAPS, TRIM_RAD, WHEELS, MapDrive, recorded, world_of
from benchmarks.racing.poses import KnownMap
from wallride.drivers.vesc.settings import VescSettings
from wallride.runtime.arbitration.command import Source
from wallride.runtime.control.laws import LawStack
from wallride.runtime.control.line_following.line_follower import DRIVES
from wallride.runtime.control.line_following.race_line import CourseLine
from wallride.runtime.host.output_files import write_files
from wallride.runtime.line_files import LINE_SUFFIX, read_course, read_line
from wallride.runtime.map_files import read_map, walls_text
from wallride.runtime.settings.tree import Settings, load_settings
from wallride.sim.car.vehicle import VehicleSettings
from wallride.sim.car.wiring import WiringConversion, WiringErrors
from wallride.sim.mapping.closing import close_lap
from wallride.sim.mapping.map_output import map_files, path_of
from wallride.sim.mapping.odometry_path import of_the_axle
from wallride.sim.mapping.raster import rasterized
from wallride.sim.mapping.walls import walls_of
from wallride.sim.racing.free_space import FreeSpace
from wallride.sim.racing.line_file import text_of
from wallride.sim.racing.raceline import NoLineError, race_line
from wallride.sim.racing.ring import PATH_SUFFIX, read_path, ring_of_path
from wallride.sim.racing.speed_profile import Grip
from wallride.sim.virtual.closed_loop import Case, SimulatedRun, drive
from wallride.sim.world.lap import Lap, LapCounter
from wallride.sim.world.worlds import load_world

PLACES = (*MAPS, "track:seed=7", "loop")
LAPS = 5
"""Laps of a drive, the first from a standstill."""
FLYING = 3
"""The first lap that counts: by then the speed has reached what was asked."""
MAP_MPS, MAP_MU, MAP_SEED = 2.0, 0.8, 1000
RADIUS_M = 0.933
"""The car's tightest turn."""
SLOWEST_MPS, STANDS_S, MOVING_MPS = 1.2, 6.0, 0.3
"""Speed below which a drive is given up, the standstill that ends it, and the speed from which a stop counts."""


@dataclass(frozen=True, slots=True)
class Race:
    """Drives on one course. mu: friction of the floor. assumed: what the line and the follower take it for, over it.

    safety: "swept", or "none". delay_s: added to that of the servo. stiffness: of the tyres, over the assumed one.
    """

    place: str
    mu: float
    seed: int
    data: Path
    maps: Path
    speed_mps: float = 6.0
    assumed: float = 1.0
    safety: str = "swept"
    delay_s: float = 0.0
    stiffness: float = 1.0
    sets: tuple[str, ...] = ()
    lateral: float = 0.6
    brake: float = 0.45
    keep_m: float = 0.45


@dataclass(frozen=True, slots=True, eq=False)
class Raced:
    """A course ready for a race. known: its map, and how true poses are put on it. theory_s: of the line's lap."""

    file: Path
    line_file: Path
    known: KnownMap
    line: CourseLine
    theory_s: float


def prepared(race: Race) -> Raced:
    """Return the map of a lap and its line; the map is made at the first call for a place."""
    name = race.place.replace(":", "-").replace("=", "-")
    file, poses = race.maps / f"{name}.yaml", race.maps / f"{name}.npz"
    if not poses.is_file():
        record, truth = recorded(MapDrive(race.place, MAP_MPS, MAP_MU, MAP_SEED, gyro=True), race.data)
        lap = close_lap(record)
        raster = rasterized(lap.frames, lap.poses, record.kind[1])
        about = f"of {race.place}"
        walls = walls_text(walls_of(lap, raster), lap.car.scale, about)
        write_files(map_files(file.with_suffix(""), raster, path_of(record, lap), walls, about))
        index = np.searchsorted(record.scan_s, [frame.time_s for frame in lap.frames])
        np.savez(poses, true=truth[index], found=of_the_axle(lap.poses, record.lidar_m))
    known, kept = read_map(file), np.load(poses)
    ring_m = ring_of_path(read_path(file.with_name(f"{name}{PATH_SUFFIX}")), what=race.place)
    grip = Grip(race.mu * race.assumed, race.lateral, race.brake, speed_mps=race.speed_mps)
    space = FreeSpace(load_world(file).outline_m)
    found = race_line(ring_m, space, grip, keep_m=race.keep_m, radius_m=RADIUS_M)
    line_file = race.maps / f"{name}-{os.getpid()}{LINE_SUFFIX}"
    line_file.write_text(text_of(found, race.place), encoding="utf-8")
    truth = KnownMap(known.field, known.scale, kept["true"], kept["found"])
    return Raced(file, line_file, truth, read_line(line_file), found.lap_s)


def settings_for(race: Race, ready: Raced, law: str) -> Settings:
    """Return the settings of a car that drives by a law."""
    world = world_of(race.place, race.data)
    wanted = [
        f"wall_follow.method={law}", f"wall_follow.side={world.side}", f"wall_follow.speed_mps={race.speed_mps}",
        f"wall_follow.desired_distance_m={min(1.0, world.room_m)}", f"car.max_speed_mps={race.speed_mps * WHEELS:.3f}",
        f"map.file={ready.file}", f"map.line={ready.line_file}",
        *([f"wall_follow.floor_mu={race.mu * race.assumed}"] if law == "line" else []),
        *(["safety.method=report", "safety.turn_below_m=0"] if race.safety == "none" else []),
    ]  # fmt: skip
    return load_settings(None, [*wanted, *(race.sets if law == "line" else ())])


def driven(race: Race, ready: Raced, law: str) -> tuple[SimulatedRun, LawStack]:
    """Drive the laps."""
    settings, world = settings_for(race, ready, law), world_of(race.place, race.data)
    tyres = VehicleSettings()
    vehicle = VehicleSettings(
        grip_mu=race.mu, trim_rad=TRIM_RAD, steering_delay_s=tyres.steering_delay_s + race.delay_s,
        cornering_front_per_rad=tyres.cornering_front_per_rad * race.stiffness,
        cornering_rear_per_rad=tyres.cornering_rear_per_rad * race.stiffness,
    )  # fmt: skip
    wired = WiringErrors(speed_gain_share=WHEELS).wired(settings.motor)
    case = Case(
        world, desired_m=settings.wall_follow.desired_distance_m, distance_m=(LAPS + 0.4) * ready.line.length_m,
        duration_s=LAPS * ready.line.length_m / SLOWEST_MPS, standing_s=STANDS_S, seed=race.seed, vehicle=vehicle,
        car=settings.car, wiring=WiringConversion(VescSettings(), wired),
    )  # fmt: skip
    course = read_course(settings.map, settings.car)
    laws = LawStack(settings.wall_follow, settings.safety, settings.car, course=course)
    return drive(case, laws.follower, None if race.safety == "none" else laws.judge), laws


def figures(ready: Raced, run: SimulatedRun) -> dict[str, Any]:
    """Return lap times, errors from the line, and what safety did."""
    found = ready.known.of(run.pose)
    places = found[:, 0] + 1j * found[:, 1]
    counter, begun = LapCounter(Lap(np.column_stack([ready.line.places_m.real, ready.line.places_m.imag]))), [0]
    for number, place in enumerate(places):
        if counter.update(place.real, place.imag) >= len(begun):
            begun.append(number)
    times_s = np.diff(run.time_s[begun])
    flying = slice(begun[FLYING - 1] if len(begun) > FLYING else len(places), begun[-1])
    on_line = np.array([reason == DRIVES for reason in run.reasons]) | (run.capped > 0.0)
    aside_m = np.abs([ready.line.nearest(complex(place)).aside_m for place in places[flying]])
    stops = [stop for stop in run.stops if stop.winner is Source.SAFETY and stop.speed_mps > MOVING_MPS]
    return {
        "laps": len(times_s), "times_s": times_s.round(2).tolist(),
        "lap_s": float(times_s[FLYING - 1 :].min()) if len(times_s) >= FLYING else None,
        "rms_m": float(np.sqrt(np.mean(aside_m**2))) if aside_m.size else None,
        "p99_m": float(np.percentile(aside_m, 99)) if aside_m.size else None,
        "contact": run.contact is not None, "stops": len(stops), "capped": float(run.capped[flying].mean()),
        "by_wall": float(1.0 - on_line.mean()), "last_reason": run.reasons[-1],
        "fastest_mps": float(run.speed_mps[:, 0].max()), "theory_s": ready.theory_s, "way_m": ready.line.length_m,
        "stop_reasons": sorted({stop.reason for stop in stops}),
    }  # fmt: skip


def measure(race: Race, laws: Sequence[str]) -> list[dict[str, Any]]:
    """Return the figures of the laws on one course."""
    try:
        ready = prepared(race)
    except NoLineError as error:
        return [{"place": race.place, "mu": race.mu, "seed": race.seed, "law": "line", "reason": str(error)}]
    rows = []
    for law in laws:
        begun_s = time.process_time()
        run, _ = driven(race, ready, law)
        row = figures(ready, run) | {"took_s": time.process_time() - begun_s}
        rows.append({"place": race.place, "mu": race.mu, "seed": race.seed, "law": law} | row)
    ready.line_file.unlink()
    return rows


def shown(row: dict[str, Any]) -> str:
    """Return a row of the table."""
    if "reason" in row:
        return f"{row['place']:15} mu {row['mu']:g} no line: {row['reason']}"
    head = f"{row['place']:15} mu {row['mu']:g} {row['law']:5} {row['laps']} laps"
    lap = f"{row['lap_s']:6.2f} s" if row["lap_s"] is not None else "     - "
    tail = f"contact {'YES' if row['contact'] else 'no '} stops {row['stops']:2} capped {100 * row['capped']:2.0f} %"
    if row["law"] != "line" or row["rms_m"] is None:
        return f"{head} {lap} {' ':34} {tail}  {row['last_reason'] if row['lap_s'] is None else ''} {row['times_s']}"
    errors = f"{100 * row['rms_m']:4.1f} cm rms {100 * row['p99_m']:4.1f} p99"
    return f"{head} {lap} theory {row['theory_s']:6.2f} s {errors} {tail}  {row['times_s']}"


def main() -> int:
    """Measure and print."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").split("\n", 1)[0])
    parser.add_argument("--data", type=Path, required=True, help="folder with maps/")
    parser.add_argument("--maps", type=Path, help="folder in which the maps of the laps are kept (default: none)")
    parser.add_argument("--places", nargs="*", default=PLACES, help="maps and tracks (default: all ten)")
    parser.add_argument("--laws", nargs="*", default=("ball", "line"))
    parser.add_argument("--mu", nargs="*", type=float, default=(0.8,))
    parser.add_argument("--speed", type=float, default=6.0, help="highest speed of line and car")
    parser.add_argument("--lateral", type=float, default=0.6)
    parser.add_argument("--brake", type=float, default=0.45)
    parser.add_argument("--keep", type=float, default=0.45)
    parser.add_argument("--assumed", type=float, default=1.0, help="assumed friction over the floor's")
    parser.add_argument("--delay", type=float, default=0.0, help="further delay of the servo [s]")
    parser.add_argument("--stiffness", type=float, default=1.0, help="of the tyres, over the assumed one")
    parser.add_argument("--safety", choices=("swept", "none"), default="swept")
    parser.add_argument("--set", dest="sets", action="append", default=[], metavar="KEY=VALUE", help="of `line` alone")
    parser.add_argument("--seed", type=int, default=7000)
    parser.add_argument("--jobs", type=int, default=1)
    parser.add_argument("--json", type=Path, help="file for all figures")
    options = parser.parse_args()
    rows = []
    with tempfile.TemporaryDirectory() as folder, ProcessPoolExecutor(options.jobs) as pool:
        races = list(_races(options, options.maps or Path(folder)))
        for part in pool.map(measure, races, [options.laws] * len(races)):
            rows += part
            print("\n".join(map(shown, part)), flush=True)
    if options.json:
        options.json.write_text(json.dumps(rows, indent=1) + "\n")
    return 1 if any(row.get("contact", True) for row in rows) else 0


def _races(options: argparse.Namespace, maps: Path) -> Iterator[Race]:
    for number, place in enumerate(options.places):
        for mu in options.mu:
            yield Race(
                place, mu, options.seed + number, options.data, maps, options.speed, options.assumed, options.safety,
                options.delay, options.stiffness, tuple(options.sets), options.lateral, options.brake, options.keep,
            )  # fmt: skip


if __name__ == "__main__":
    sys.exit(main())
