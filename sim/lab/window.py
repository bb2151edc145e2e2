"""`lab window`: learning of the lidar's window while driving: dirt found, and false dirt.

Clean runs are those without dirt; every beam classified as dirty there is a false one. Dirty runs measure the share of
the truly dirty beams that are classified so after 7 m of way.
"""

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

from wallride.drivers.api import MotorState, Scan
from wallride.runtime.arbitration.command import SafetyAssessment
from wallride.runtime.control.safety.swept import SweptGuard
from wallride.sim.car.vehicle import VehicleSettings
from wallride.sim.lab import laws
from wallride.sim.lab.cell import Cell, CellChoice, Experiment, Figures, TabledCell
from wallride.sim.lab.courses.walls import world_of
from wallride.sim.lab.figures import Row, chosen, common, distinct, mean, number, text, worst
from wallride.sim.virtual.closed_loop import Case, SimulatedRun, drive
from wallride.sim.world.beams import LidarSettings
from wallride.sim.world.pose import Booleans, Side

Sectors = tuple[tuple[float, float, float], ...]
WINDOWS: dict[str, Sectors] = {
    "clean": (),
    "one smudge": ((-96.0, -93.25, 0.10),),
    "two ahead": ((31.0, 33.0, 0.15), (-21.0, -19.0, 0.2)),
    "beside and behind": ((88.0, 90.0, 0.25), (-130.0, -128.0, 0.05)),
    "as on a real car": ((123.0, 135.0, 0.48),),
}
"""(from, to) [deg] and range [m]. The last is the one that four RACECAR recordings have at their left rear."""
WORLDS = ("straight", "loop", "doorway", "inside_corner", "curved", "u_turn")
LEARNT_M = 7.0
FOUND_SHARE = 0.95


@dataclass(slots=True)
class WatchedWindow:
    """A guard that also records, by way driven, the beams classified as dirty, and those as the car's own parts."""

    guard: SweptGuard
    way_m: list[float] = field(default_factory=list)
    dirty: list[Booleans] = field(default_factory=list)
    own: list[Booleans] = field(default_factory=list)

    def look(self, scan: Scan, motor: MotorState | None) -> SafetyAssessment:
        """Let the guard look, and record its beams."""
        assessment = self.guard.look(scan, motor)
        self.guard.learn()
        health = self.guard.perception.health
        mask = health.mask if health.mask is not None else np.zeros(scan.ranges_m.shape, np.bool_)
        self.way_m.append(motor.distance_m if motor is not None else 0.0)
        self.dirty.append(mask | health.blinded)
        self.own.append(health.own)
        return assessment

    def learn(self) -> None:
        """Do nothing: each look learns."""


def cells(choice: CellChoice) -> list[Cell]:
    """Return what is to be run."""
    names = [f"{window}, {world}" for window in WINDOWS for world in (WORLDS[:2] if choice.quick else WORLDS)]
    return choice.cells("window", names)


def run(cell: Cell) -> SimulatedRun:
    """Drive one cell."""
    return _watched(cell)[0]


def measure(cell: Cell) -> Figures:
    """Drive one cell and count the beams."""
    done, watched = _watched(cell)
    truth = truly_dirty(sectors(cell.scenario, cell.side), done.case.lidar)
    learnt = next((n for n, way_m in enumerate(watched.way_m) if way_m >= LEARNT_M), len(watched.way_m) - 1)
    ignored = [(mask | own) & truth for mask, own in zip(watched.dirty, watched.own, strict=True)]
    shares = [int(np.count_nonzero(beams)) / max(1, int(np.count_nonzero(truth))) for beams in ignored]
    found = next((n for n, share in enumerate(shares) if share >= FOUND_SHARE), None) if truth.any() else None
    bearing_deg = np.linspace(done.case.lidar.first_deg, done.case.lidar.last_deg, truth.size)
    false = [np.flatnonzero(mask & ~truth) for mask in watched.dirty]
    most = max(false, key=len)
    return {
        **common(done),
        "window": cell.scenario.partition(",")[0],
        "dirty_beams": int(np.count_nonzero(truth)),
        "found_share": number(shares[learnt]) if truth.any() else None,
        "found_after_m": number(watched.way_m[found]) if found is not None else None,
        "false_beams": len(most),
        "false_around_deg": number(bearing_deg[most].mean()) if most.size else None,
        "words": list(watched.guard.words),
    }


def sectors(scenario: str, side: Side) -> Sectors:
    """Return the dirt of a scenario, mirrored with the wall."""
    dirt = WINDOWS[scenario.partition(",")[0]]
    return dirt if side == "left" else tuple((-to, -begin, range_m) for begin, to, range_m in dirt)


def truly_dirty(dirt: Sectors, lidar: LidarSettings) -> Booleans:
    """Return the beams (beams,) with dirt."""
    bearing_deg = np.linspace(lidar.first_deg, lidar.last_deg, lidar.beams)
    dirty = np.zeros(lidar.beams, np.bool_)
    for begin_deg, to_deg, _ in dirt:
        dirty |= (bearing_deg >= begin_deg - 1e-6) & (bearing_deg <= to_deg + 1e-6)
    return dirty


def _watched(cell: Cell) -> tuple[SimulatedRun, WatchedWindow]:
    if not laws.check(cell.law).endswith("+swept"):
        raise ValueError(f"{cell.law}: only the safety `swept` knows its window; write --method ball")
    stack = laws.stack_of(cell.law, laws.settings_of(cell.law, cell.side, cell.desired_m, cell.speed_mps))
    follower, watched = stack.follower, WatchedWindow(stack.guard)
    lidar = LidarSettings(noise_std_m=0.02, outlier_share=0.02, dirty_sectors=sectors(cell.scenario, cell.side))
    case = Case(
        world_of(cell.scenario.partition(", ")[2], cell.side),
        None,
        cell.speed_mps,
        distance_m=LEARNT_M + 1.0,
        duration_s=30.0,
        standing_s=3.0,
        vehicle=VehicleSettings(grip_mu=cell.mu),
        lidar=lidar,
        seed=cell.seed,
    )
    return drive(case, follower, watched), watched


def tables(rows: Sequence[Row]) -> list[TabledCell]:
    """Return one table: a row per window."""
    lines = []
    for window in distinct(rows, "window"):
        some = chosen(rows, window=window)
        lines.append(
            (
                window,
                str(len(some)),
                text(100 * mean(some, "found_share"), 1),
                text(100 * min((row["found_share"] for row in some if row["dirty_beams"]), default=float("nan")), 0),
                text(worst(some, "found_after_m"), 1),
                f"{sum(row['false_beams'] > 0 for row in some)} ({worst(some, 'false_beams'):.0f} beams)",
                str(sum(row["safety_stops"] > 0 for row in some)),
                str(sum(row["collided"] for row in some)),
            )
        )
    columns = ("window", "runs", "found %", "worst %", "latest m", "runs with false beams", "stopped", "contacts")
    clean, dirty = chosen(rows, window="clean"), [row for row in rows if row["dirty_beams"]]
    found = sum(row["found_share"] * row["dirty_beams"] for row in dirty) / max(1, sum(r["dirty_beams"] for r in dirty))
    note = (
        f"{100 * found:.1f} % of dirty beams ignored after {LEARNT_M:g} m;"
        f" false beams in {sum(row['false_beams'] > 0 for row in clean)} of {len(clean)} clean runs"
    )
    return [TabledCell("the lidar's window", columns, tuple(lines), (note,))]


EXPERIMENT = Experiment(measure, cells, tables)
