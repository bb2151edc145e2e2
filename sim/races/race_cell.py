"""One race: a car drives laps of a course by a law, on the map of a lap and with the line of that map.

The seed is another than that of the mapped lap. Besides the lidar's noise, the wheels report 3 % too much, the steering
is off by 0.02 rad, and there is no gyro. The true pose is put on the map by the mapped lap around it: errors from the
line are those of a car among the walls around it, and what the map is bent by does not count.
"""

from dataclasses import dataclass, replace
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np

from wallride.drivers.vesc.settings import VescSettings
from wallride.runtime.arbitration.command import Source
from wallride.runtime.control.line_following.race_line import CourseLine
from wallride.runtime.line_files import LINE_SUFFIX, read_line
from wallride.runtime.map_files import MapError, refusal_of
from wallride.runtime.settings.driven_car import driven_car
from wallride.runtime.settings.tree import Settings
from wallride.sim.car.vehicle import VehicleSettings
from wallride.sim.car.wiring import WiringConversion, WiringErrors
from wallride.sim.lab import laws
from wallride.sim.lab.cell import Cell, Figures
from wallride.sim.lab.courses.sudden import BrakingGuard
from wallride.sim.lab.figures import common, number
from wallride.sim.races.boxes import FULL_SPEED, MOVING, box_figures, surprises_at_s, timed, with_box
from wallride.sim.races.mapped_lap import TRIM_RAD, WHEELS, KeyframePoses, map_file, poses_of_map
from wallride.sim.racing.free_space import FreeSpace
from wallride.sim.racing.line_file import text_of
from wallride.sim.racing.raceline import NoLineError, RaceLine, race_line
from wallride.sim.racing.ring import NoRingError, driven_path, read_path, ring_of_path
from wallride.sim.racing.speed_profile import Grip
from wallride.sim.virtual.closed_loop import Case, SimulatedRun
from wallride.sim.world.lap import Lap, LapCounter
from wallride.sim.world.place import World
from wallride.sim.world.pose import Floats
from wallride.sim.world.worlds import load_world

BETWEEN_BORDERS = "corridor+"
"""Begin of the name of a law that plans its own way, and at what speed, without a map."""
FLYING = 3
"""The first lap that counts: by then the speed has reached what was asked."""
SLOWEST_MPS, STANDS_S, MOVING_MPS = 1.2, 6.0, 0.3
"""Speed below which a race is given up, the standstill that ends it, and the speed from which a stop counts."""
MORE_LAPS = 0.4
"""Way after the last lap, in laps, so that the pose has surely crossed the start line."""


@dataclass(frozen=True, slots=True)
class RaceCell(Cell):
    """A race on a course. laps: the first from a standstill. assumed: friction that line and follower assume, over mu.

    speed_mps: highest speed of line and car. delay_s: of the servo, on top of its own. stiffness: of the tyres, over
    what the follower assumes. lateral_share, brake_share, keep_m: of the line, as of `wallride line`.
    box: kind of one in the way (`boxes`), "" for none.
    """

    laps: int = 5
    assumed: float = 1.0
    delay_s: float = 0.0
    stiffness: float = 1.0
    lateral_share: float = 0.75
    brake_share: float = 0.6
    keep_m: float = 0.36
    box: str = ""


@dataclass(frozen=True, slots=True)
class Racing:
    """The work on a race. folder: of the maps (`map_course`)."""

    folder: Path

    def __call__(self, cell: RaceCell) -> Figures:
        """Return the figures of a race; with a "reason" where the map has no line, or is none to find a pose on."""
        file = map_file(cell.scenario, self.folder)
        try:
            planned = planned_line(cell, file)
            with TemporaryDirectory() as place:
                line_file = Path(place) / f"race{LINE_SUFFIX}"
                line_file.write_text(text_of(planned, cell.scenario), encoding="utf-8")
                line = read_line(line_file)
                poses = poses_of_map(file)
                run, box = _drive(cell, line, poses, (f"map.file={file}", f"map.line={line_file}"))
        except (NoRingError, NoLineError, MapError) as error:
            return not_raced(cell, str(error))
        figures = {
            "reason": "",
            "map_refused": refusal_of(file),
            "theory_s": number(planned.lap_s),
            **figures_of(run, line, poses),
            **box,
        }
        return cell.named(common(run) | figures)


def not_raced(cell: RaceCell, reason: str) -> Figures:
    """Return the row of a course without a race."""
    return cell.named({"reason": reason, "collided": False})


def planned_line(cell: RaceCell, file: Path) -> RaceLine:
    """Return the line of a map, as `wallride line` computes it. Raises: NoRingError, NoLineError."""
    path, car = driven_path(file), driven_car(Settings())
    assert path is not None  # noqa: S101 - `map_course` wrote it
    ring_m = ring_of_path(read_path(path), what=cell.scenario)
    grip = Grip(cell.mu * cell.assumed, cell.lateral_share, cell.brake_share, speed_mps=cell.speed_mps)
    radius_m = car.wheelbase_m / float(np.tan(car.narrower_end_rad))
    return race_line(ring_m, FreeSpace(load_world(file).outline_m), grip, keep_m=cell.keep_m, radius_m=radius_m)


def _drive(
    cell: RaceCell, line: CourseLine, poses: KeyframePoses, on_map: tuple[str, ...]
) -> tuple[SimulatedRun, Figures]:
    """Drive the race; return it, and how its box was met. on_map: the settings of map and line."""
    case = case_of(cell, load_world(cell.scenario), line)
    known = (*on_map, f"car.max_speed_mps={cell.speed_mps * WHEELS:.3f}", *_of_the_law(cell), *cell.settings)
    driven = replace(cell, settings=known)
    if not cell.box:
        return laws.drive_case(driven, case), {}
    alone = laws.drive_case(driven, timed(case, line)) if cell.box == MOVING else None
    case = with_box(case, cell.box, line, poses, alone)
    run, braked = laws.drive_case(driven, case), None
    surprise_s = surprises_at_s(run, case)
    if surprise_s is not None and run.contact is not None:
        follower, guard = laws.build(cell.law, cell.side, case.desired_m, cell.speed_mps, known)
        braked = laws.drive_case(driven, case, follower, BrakingGuard(guard, surprise_s))
    return run, box_figures(run, braked)


def _of_the_law(cell: RaceCell) -> tuple[str, ...]:
    """Return the settings that the law has of these: assumed friction, and a first lap at full speed before a box.

    `corridor` is told the floor as `line` is; `line` has `assumed_mu`, too, for the wall, which keeps its default.
    """
    follow = laws.settings_of(cell.law, cell.side, cell.desired_m, cell.speed_mps).wall_follow
    friction = "assumed_mu" if cell.law.startswith(BETWEEN_BORDERS) else "floor_mu"
    wanted = {friction: cell.mu * cell.assumed} | ({FULL_SPEED: 1.0} if cell.box else {})
    return tuple(f"wall_follow.{name}={value}" for name, value in wanted.items() if hasattr(follow, name))


def case_of(cell: RaceCell, world: World, line: CourseLine) -> Case:
    """Return the conditions of a race."""
    usual = VehicleSettings()
    vehicle = VehicleSettings(
        grip_mu=cell.mu, trim_rad=TRIM_RAD, steering_delay_s=usual.steering_delay_s + cell.delay_s,
        cornering_front_per_rad=usual.cornering_front_per_rad * cell.stiffness,
        cornering_rear_per_rad=usual.cornering_rear_per_rad * cell.stiffness,
    )  # fmt: skip
    configured = VescSettings()
    return Case(
        world, desired_m=min(cell.desired_m, world.room_m), distance_m=(cell.laps + MORE_LAPS) * line.length_m,
        duration_s=cell.laps * line.length_m / SLOWEST_MPS, standing_s=STANDS_S, seed=cell.seed, vehicle=vehicle,
        wiring=WiringConversion(configured, WiringErrors(speed_gain_share=WHEELS).wired(configured)),
    )  # fmt: skip


def figures_of(run: SimulatedRun, line: CourseLine, poses: KeyframePoses) -> Figures:
    """Return lap times, errors from the line in the laps that count, and the stops of a moving car by safety."""
    found = poses.of(run.pose)
    places = found[:, 0] + 1j * found[:, 1]
    begins = lap_begins(places, line)
    times_s = np.diff(run.time_s[begins])
    flying = slice(begins[FLYING - 1] if len(begins) > FLYING else len(places), begins[-1])
    aside_m = np.abs([line.nearest(complex(place)).aside_m for place in places[flying]])
    stops = [stop for stop in run.stops if stop.winner is Source.SAFETY and stop.speed_mps > MOVING_MPS]
    return {
        "way_m": number(line.length_m),
        "laps_driven": len(times_s),
        "lap_times_s": times_s.round(3).tolist(),
        "lap_s": number(times_s[FLYING - 1 :].min()) if len(times_s) >= FLYING else None,
        "rms_m": number(np.sqrt(np.mean(aside_m**2))) if aside_m.size else None,
        "p99_m": number(np.percentile(aside_m, 99)) if aside_m.size else None,
        "hard_stops": len(stops),
        "hard_stops_at": [[number(stop.from_s), number(stop.speed_mps), stop.reason] for stop in stops],
    }


def lap_begins(places: Floats, line: CourseLine) -> list[int]:
    """Return the index of the place at which each lap begins, the last one's end included. places: x + iy, (n,)."""
    counter, begins = LapCounter(Lap(np.column_stack([line.places_m.real, line.places_m.imag]))), [0]
    for index, place in enumerate(places):
        if counter.update(place.real, place.imag) >= len(begins):
            begins.append(index)
    return begins
