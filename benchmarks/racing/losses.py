"""A pose that is lost in the middle of a lap at speed: stopped, or on along the wall, and without a contact?

Run: python -m benchmarks.racing.losses --data DATA

A car races on the map and line of a mapped lap (`wallride lab races`), its first lap at full speed. At a moment of its
seed, at 0.8 of its highest speed or more, one of these befalls it:

    covered, silent, half   the lidar reads 30 mm, reads nothing, or reads 100 mm within 70 degrees of ahead
    turned, carried         the car is lifted and set down there, turned by 90 or 180 degrees, or elsewhere on its way
    walls                   none: the walls within 4 m of there stand up to 0.6 m beside those of the map

With a blind lidar a contact counts when a full brake from that moment on would have had none, or a softer one. Exit
code 1 where one counts.
"""

import argparse
import math
import sys
from collections.abc import Callable, Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np

from benchmarks.racing.maps import MAPS, TRACKS
from wallride.runtime.control.guidance import Follower, Guard
from wallride.runtime.line_files import LINE_SUFFIX, read_line
from wallride.sim.car.vehicle import Vehicle
from wallride.sim.lab import laws
from wallride.sim.lab.courses.sudden import BrakingGuard
from wallride.sim.lab.covers import Cover
from wallride.sim.races.boxes import FULL_SPEED
from wallride.sim.races.mapped_lap import WHEELS, map_course, map_file
from wallride.sim.races.race_cell import RaceCell, case_of, planned_line
from wallride.sim.racing.line_file import text_of
from wallride.sim.virtual.closed_loop import Case, SimulatedRun, drive
from wallride.sim.world.beams import Millimetres
from wallride.sim.world.place import World
from wallride.sim.world.pose import Pose
from wallride.sim.world.segments import SegmentGeometry
from wallride.sim.world.worlds import load_world

COVERS: dict[str, tuple[int | None, float]] = {"covered": (30, 135.0), "silent": (None, 135.0), "half": (100, 70.0)}
LOSSES = (*COVERS, "turned", "carried", "walls")
MUS, SPEED_MPS, LAPS = (0.8, 0.5), 6.0, 2.2
FAST_SHARE, FIRST_S, LAST_S = 0.8, 3.0, 3.0
"""Share of the highest speed, time from the start, and time before the end, between which a loss may come."""
LASTS_S, STANDS_S = 60.0, 8.0
ASIDE_M, WITHIN_M, PIECE_M = 0.6, 2.0, 0.2
"""How far walls are moved at most, the standard deviation of where, and the pieces that they are moved in."""


@dataclass(frozen=True, slots=True)
class Loss:
    """One drive."""

    course: str
    kind: str
    mu: float
    seed: int


@dataclass(frozen=True, slots=True)
class LossOutcome:
    """What came of it. hit_mps, brake_mps: speed at a contact, and at that of a full brake, NaN for none."""

    loss: Loss
    at_mps: float
    stopped: bool
    hit_mps: float
    brake_mps: float

    @property
    def counts(self) -> bool:
        """Whether it touched what it could have missed."""
        return not math.isnan(self.hit_mps) and not self.hit_mps <= self.brake_mps


@dataclass(slots=True)
class Lifting:
    """Lifts the car at a moment and sets it down: in place of a cover, which is asked at each scan."""

    at_s: float
    place: Sequence[float]
    vehicle: Vehicle | None = None

    def meet(self, vehicle: Vehicle) -> None:
        """Know the car."""
        self.vehicle = vehicle

    def __call__(self, reported_mm: Millimetres, now_s: float) -> Millimetres:
        """Return the ranges as they are."""
        if now_s >= self.at_s and self.vehicle is not None:
            self.vehicle.halt()
            self.vehicle.x_m, self.vehicle.y_m, self.vehicle.yaw_rad = self.place
            self.vehicle = None
        return reported_mm


def course_of(place: str, data: Path) -> str:
    """Return a course as the lab names it."""
    return str(data / "maps" / f"{place}.yaml") if place in MAPS else place


def measure(loss: Loss, data: Path, folder: Path) -> LossOutcome:
    """Drive one race without and one with its loss."""
    course = course_of(loss.course, data)
    cell = RaceCell("races", course, "line+swept", SPEED_MPS, loss.mu, "left", loss.seed)
    file, world = map_file(course, folder), load_world(course)
    with TemporaryDirectory() as place:
        line_file = Path(place) / f"race{LINE_SUFFIX}"
        line_file.write_text(text_of(planned_line(cell, file), course), encoding="utf-8")
        line = read_line(line_file)
        known = (
            f"map.file={file}", f"map.line={line_file}", f"car.max_speed_mps={SPEED_MPS * WHEELS}",
            f"wall_follow.floor_mu={loss.mu}", f"wall_follow.{FULL_SPEED}=1",
        )  # fmt: skip

        def fresh() -> tuple[Follower, Guard]:
            follower, guard = laws.build(cell.law, cell.side, cell.desired_m, SPEED_MPS, known)
            assert guard is not None  # noqa: S101 - the law has one
            return follower, guard

        case = replace(
            case_of(cell, world, line), duration_s=LASTS_S, distance_m=LAPS * line.length_m, standing_s=STANDS_S,
            car=laws.settings_of(cell.law, cell.side, cell.desired_m, SPEED_MPS, known).car,
        )  # fmt: skip
        return _outcome(loss, case, drive(case, *fresh()), fresh)


def _outcome(loss: Loss, case: Case, alone: SimulatedRun, fresh: Callable[[], tuple[Follower, Guard]]) -> LossOutcome:
    """Return what comes of a loss at a moment of the race alone."""
    random, speed_mps = np.random.default_rng((loss.seed, LOSSES.index(loss.kind))), alone.speed_mps[:, 0]
    fast = (speed_mps > FAST_SHARE * speed_mps.max()) & (alone.time_s > FIRST_S)
    choices = np.flatnonzero(fast & (alone.time_s < alone.time_s[-1] - LAST_S))
    at, other = random.choice(choices, 2)
    at_s, meet = float(alone.time_s[at]), None
    if loss.kind in COVERS:
        case = replace(case, cover=Cover(*COVERS[loss.kind], at_s, loss.seed))
    elif loss.kind == "walls":
        case = replace(case, world=_moved(case.world, alone.pose[at], float(random.choice([-1.0, 1.0]))))
    else:
        turns = (math.pi / 2, -math.pi / 2, math.pi) if loss.kind == "turned" else (0.0, math.pi)
        x_m, y_m, yaw_rad = (float(part) for part in alone.pose[at if loss.kind == "turned" else other])
        fit = [turn for turn in turns if not case.world.collides(Pose(x_m, y_m, yaw_rad + turn))]
        lifting = Lifting(at_s, (x_m, y_m, yaw_rad + float(random.choice(fit or [0.0]))))
        case, meet = replace(case, cover=lifting), lifting.meet
    run, brake_mps = drive(case, *fresh(), meet), math.nan
    if run.contact is not None and loss.kind in COVERS:
        follower, guard = fresh()
        braked = drive(case, follower, BrakingGuard(guard, at_s)).contact
        brake_mps = braked.speed_mps if braked is not None else math.nan
    hit_mps = run.contact.speed_mps if run.contact is not None else math.nan
    return LossOutcome(loss, float(speed_mps[at]), run.distance_m < case.distance_m, hit_mps, brake_mps)


def _moved(world: World, pose: Sequence[float], side: float) -> World:
    """Return a world whose walls around a pose are moved to its side."""
    pieces = []
    for x0, y0, x1, y1 in world.outline_m:
        share = np.linspace(0.0, 1.0, 1 + max(1, math.ceil(math.hypot(x1 - x0, y1 - y0) / PIECE_M)))
        x_m, y_m = x0 + share * (x1 - x0), y0 + share * (y1 - y0)
        pieces.append(np.column_stack([x_m[:-1], y_m[:-1], x_m[1:], y_m[1:]]))
    ends_m = np.vstack(pieces).reshape(-1, 2)
    near = np.exp(-np.sum((ends_m - pose[:2]) ** 2, axis=1) / (2.0 * WITHIN_M**2))
    aside = side * np.array([-math.sin(pose[2]), math.cos(pose[2])])
    return replace(world, geometry=SegmentGeometry((ends_m + ASIDE_M * near[:, None] * aside).reshape(-1, 4)))


def main() -> int:
    """Measure and print."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").split("\n", 1)[0])
    parser.add_argument("--data", type=Path, required=True, help="folder with maps/")
    parser.add_argument("--places", nargs="*", default=[*MAPS, *TRACKS], help="maps and tracks (default: all ten)")
    parser.add_argument("--seed", type=int, default=3000)
    parser.add_argument("--seeds", type=int, default=1)
    parser.add_argument("--jobs", type=int, default=1)
    options = parser.parse_args()
    seeds = range(options.seed, options.seed + options.seeds)
    losses = [
        Loss(place, kind, mu, seed) for place in options.places for kind in LOSSES for mu in MUS for seed in seeds
    ]
    courses = [course_of(place, options.data) for place in options.places]
    with TemporaryDirectory() as place, ProcessPoolExecutor(options.jobs) as pool:
        folder = Path(place)
        refused = list(filter(None, pool.map(partial(map_course, folder=folder), courses)))
        outcomes = [] if refused else list(pool.map(partial(measure, data=options.data, folder=folder), losses))
    if refused:
        raise SystemExit("\n".join(refused))
    for kind in LOSSES:
        some = [one for one in outcomes if one.loss.kind == kind]
        touched = [one for one in some if not math.isnan(one.hit_mps)]
        print(
            f"{kind:8} {len(some)} drives at {min((one.at_mps for one in some), default=math.nan):.1f} m/s or more:"
            f" {sum(one.stopped for one in some)} stopped, {len(touched)} touched,"
            f" {sum(one.counts for one in touched)} what a full brake misses"
        )
        for one in touched:
            print(f"    {one.loss}: {one.hit_mps:.2f} m/s, full brake {one.brake_mps:.2f}")
    return 1 if any(one.counts for one in outcomes) else 0


if __name__ == "__main__":
    sys.exit(main())
