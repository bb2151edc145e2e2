"""`lab safety`: the report's 28 obstacles, which appear 0.3 to 0.9 m before the lidar of a car at 1 to 4 m/s.

Most of them no car could stop for. What a brake can do (control-and-safety notes, section 1), with the gap counted from
the bumper and t the time from the scan's last byte to the brake's bite:

    stoppable when    gap > v t + v^2 / (2 a)          a: the brake's deceleration or the grip's mu g, whichever is less
    impact otherwise  sqrt(v^2 - 2 a (gap - v t))
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from drivers.api import Drive, MotorState, Scan
from runtime.control.guidance import Guidance
from sim.closed_loop import Case, Run, drive
from sim.lab import laws
from sim.lab.cell import Cell, Choice, Experiment, Figures, Tabled
from sim.lab.courses import with_own_parts, world_of
from sim.lab.figures import Row, chosen, common, distinct, number, worst
from sim.obstacles import LIDAR_AHEAD_M, sudden_box
from sim.pose import CAR
from sim.vehicle import GRAVITY_MPS2, VehicleSettings

DISTANCES_M = (0.3, 0.4, 0.5, 0.6, 0.7, 0.8, 0.9)
SURELY_M = 0.05
"""Cases nearer to the edge than this are left to chance."""
_APPEARS_S = 0.5


@dataclass(slots=True)
class Blind:
    """A navigator that looks at nothing: one speed, straight on until `turns_at_s`, then one steering angle."""

    speed_mps: float
    steering_rad: float = 0.0
    turns_at_s: float = 0.0

    def follow(self, scan: Scan, motor: MotorState | None) -> Guidance:  # noqa: ARG002 - blind
        """Answer every scan alike."""
        steering_rad = self.steering_rad if scan.stamp_s >= self.turns_at_s else 0.0
        return Guidance(Drive(self.speed_mps, steering_rad), math.nan, math.nan, math.nan, "blind")


def cells(choice: Choice) -> list[Cell]:
    """Return what is to be run."""
    return choice.cells("safety", [f"{distance_m:.1f} m" for distance_m in DISTANCES_M])


def run(cell: Cell) -> Run:
    """Drive one cell: straight on beside a wall, and a box across the way."""
    guard = laws.build(cell.law, cell.side, cell.desired_m, cell.speed_mps)[1]
    ahead_m = float(cell.scenario.split()[0])
    case = Case(
        world_of("straight", cell.side),
        None,
        cell.speed_mps,
        duration_s=_APPEARS_S + 4.0,
        standing_s=1.0,
        vehicle=VehicleSettings(grip_mu=cell.mu),
        obstacles=(sudden_box(ahead_m, from_s=_APPEARS_S),),
        seed=cell.seed,
    )
    return drive(with_own_parts(case, cell.own_parts), Blind(cell.speed_mps), guard)


def measure(cell: Cell) -> Figures:
    """Drive one cell and put it beside what physics allows."""
    done = run(cell)
    case = done.case
    gap_m = float(cell.scenario.split()[0]) + LIDAR_AHEAD_M - CAR.front_m
    first = int(np.flatnonzero(done.appeared)[0])
    speed_mps = float(done.speed_mps[first, 0])
    latency_s = case.latency_s + case.vehicle.drive_delay_s
    brake_mps2 = min(case.brake_limit_mps2, cell.mu * GRAVITY_MPS2)
    margin_m = gap_m - stopping_m(speed_mps, latency_s, brake_mps2)
    braked = np.flatnonzero(done.command[first:, 0] < 0.99 * cell.speed_mps)
    shown = done.time_s[first:]
    figures = common(done)
    expected = impact_mps(speed_mps, gap_m, latency_s, brake_mps2)
    figures |= {
        "stoppable": margin_m > 0,
        "margin_m": number(margin_m),
        "stopped": done.contact is None and abs(float(done.speed_mps[-1, 0])) < 0.1,
        "expected_impact_mps": number(expected),
        "impact_mps": figures["impact_mps"] or 0.0,
        "brake_latency_ms": number(1000 * (shown[braked[0]] - shown[0] + case.latency_s)) if braked.size else None,
        "moving_commands": moving_commands(done, first, gap_m, latency_s, brake_mps2),
    }
    figures["excess_mps"] = number(figures["impact_mps"] - expected)
    return figures


def stopping_m(speed_mps: float, latency_s: float, brake_mps2: float) -> float:
    """Return the way to a standstill."""
    return speed_mps * latency_s + speed_mps**2 / (2 * brake_mps2)


def impact_mps(speed_mps: float, gap_m: float, latency_s: float, brake_mps2: float) -> float:
    """Return the speed that is left after the gap, 0 when it is long enough."""
    braking_m = max(0.0, gap_m - speed_mps * latency_s)
    return math.sqrt(max(0.0, speed_mps**2 - 2 * brake_mps2 * braking_m))


def moving_commands(done: Run, first: int, gap_m: float, latency_s: float, brake_mps2: float) -> int:
    """Count commands to move, from scans that show the obstacle, that leave too little way to stop.

    A slow approach to an obstacle that is still far enough away is no fault.
    """
    at_m = np.hypot(*(done.pose[:, :2] - done.pose[first, :2]).T)
    count = 0
    for row in range(first, len(done.time_s)):
        left_m = gap_m - float(at_m[row])
        period_m = float(done.command[row, 0]) / done.case.lidar.rate_hz
        enough = left_m >= stopping_m(float(done.speed_mps[row, 0]), latency_s, brake_mps2) + period_m
        count += bool(done.command[row, 0] > 0 and not enough)
    return count


def tables(rows: Sequence[Row]) -> list[Tabled]:
    """Return one table per law and friction: a row per distance, a column per speed."""
    made = []
    for law in distinct(rows, "law"):
        for mu in sorted(distinct(rows, "mu")):
            some = chosen(rows, law=law, mu=mu)
            speeds = sorted(distinct(some, "speed_mps"))
            lines = [
                (name, *(_figure(chosen(some, scenario=name, speed_mps=speed)) for speed in speeds))
                for name in sorted(distinct(some, "scenario"))
            ]
            columns = ("appears at", *(f"{speed:g} m/s" for speed in speeds))
            made.append(
                Tabled(f"{law}, mu {mu:g}: stopped, or impact (physics) [m/s]", columns, tuple(lines), _notes(some))
            )
    return made


def _figure(rows: Sequence[Row]) -> str:
    failed = max(rows, key=lambda row: row["impact_mps"])
    if failed["stopped"]:
        return "stopped" if failed["stoppable"] else "stopped, lucky"
    mark = " !" if failed["stoppable"] else ""
    return f"{failed['impact_mps']:.2f} ({failed['expected_impact_mps']:.2f}){mark}"


def _notes(rows: Sequence[Row]) -> tuple[str, ...]:
    surely = [row for row in rows if row["margin_m"] > SURELY_M]
    hurried = [row for row in rows if row["margin_m"] <= SURELY_M]
    missed = [row for row in rows if not row["stoppable"]]
    stopped, stoppable = (sum(row[what] for row in rows) for what in ("stopped", "stoppable"))
    late = sum(row["moving_commands"] for row in rows)
    first = (
        f"stopped {stopped} of {len(rows)}, stoppable {stoppable};"
        f" of those with more than 5 cm to spare {sum(row['stopped'] for row in surely)} of {len(surely)}"
    )
    second = (
        f"impact above physics where stopping is impossible: at most {worst(missed, 'excess_mps'):.2f} m/s;"
        f" first slower command, where it hurries, after at most {worst(hurried, 'brake_latency_ms'):.0f} ms;"
        f" {late} commands to move without way to stop"
    )
    return first, second


EXPERIMENT = Experiment(cells, measure, tables)
