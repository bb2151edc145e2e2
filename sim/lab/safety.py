"""`lab safety`: obstacles that appear 0.3 to 0.9 m before the lidar of a car at 1 to 4 m/s.

Speeds and distances are the lab report's 28; it does not say what was put into the way, where beside, nor who drove.
Three drivers meet them (`wallride.sim.lab.courses.sudden`): a blind one, the car's own follower, and a human who
swerves. Physics is that of a straight full brake; the human's car already rotates and hits with a corner first, so it
is compared with itself, braked in full on the first scan, where that is worse.

Most of them no car could stop for. What a brake can do (control-and-safety notes, section 1), with the gap counted from
the bumper and t the time from the scan's last byte to the brake's bite:

    stoppable when    gap > v t + v^2 / (2 a)          a: the brake's deceleration or the grip's mu g, whichever is less
    impact otherwise  sqrt(v^2 - 2 a (gap - v t))
"""

import math
from collections.abc import Sequence

import numpy as np

from wallride.runtime.control.vehicle import GRAVITY_MPS2
from wallride.sim.lab.cell import Cell, CellChoice, Experiment, Figures, TabledCell
from wallride.sim.lab.courses.sudden import APPEARS_S, BrakingGuard, SuddenRun, case_of, navigator_of, scenarios
from wallride.sim.lab.figures import Row, by_law_and_friction, chosen, common, distinct, number, speed_table, worst
from wallride.sim.lab.laws import drive_case
from wallride.sim.virtual.closed_loop import SimulatedRun
from wallride.sim.world.obstacles import LIDAR_AHEAD_M
from wallride.sim.world.pose import CAR

DISTANCES_M = (0.3, 0.4, 0.5, 0.6, 0.7, 0.8, 0.9)
EXCESS_MPS = 0.15
"""Maximum excess of the impact speed over that after a straight full brake."""
SURELY_M = 0.05
"""Margin of certainty; cases nearer to the limit are undecided."""


def cells(choice: CellChoice) -> list[Cell]:
    """Return what is to be run."""
    blind = [f"{distance_m:.1f} m" for distance_m in DISTANCES_M]
    return choice.cells("safety", [*blind, *scenarios(DISTANCES_M, quick=choice.quick)])


def run(cell: Cell) -> SimulatedRun:
    """Drive one cell."""
    return drive_case(cell, case_of(cell), navigator_of(cell))


def measure(cell: Cell) -> Figures:
    """Drive one cell and compare it with the physical limit."""
    done = run(cell)
    case = done.case
    sudden = SuddenRun.named(cell.scenario)
    gap_m = sudden.ahead_m + LIDAR_AHEAD_M - CAR.front_m
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
        "driver": sudden.driver,
        "stoppable": margin_m > 0,
        "margin_m": number(margin_m),
        "stopped": done.contact is None and abs(float(done.speed_mps[-1, 0])) < 0.1,
        "expected_impact_mps": number(expected),
        "clear": done.contact is None,
        "above_formula_mps": number((figures["impact_mps"] or 0.0) - expected),
        "impact_mps": figures["impact_mps"] or 0.0,
        "brake_latency_ms": number(1000 * (shown[braked[0]] - shown[0] + case.latency_s)) if braked.size else None,
        "moving_commands": moving_commands(done, first, gap_m, latency_s, brake_mps2),
    }
    if sudden.driver == "human" and done.contact is not None:
        expected = max(expected, braked_impact_mps(cell))
        figures["stoppable"] &= expected == 0.0
    figures["excess_mps"] = number(figures["impact_mps"] - expected)
    return figures


def braked_impact_mps(cell: Cell) -> float:
    """Return the impact of the same car that brakes in full on the first scan.

    The formula's car goes straight on. One whose driver has begun to swerve rotates, and hits with a corner first.
    """
    contact = drive_case(cell, case_of(cell), navigator_of(cell), BrakingGuard(None, APPEARS_S)).contact
    return contact.speed_mps if contact is not None else 0.0


def stopping_m(speed_mps: float, latency_s: float, brake_mps2: float) -> float:
    """Return the braking distance to a standstill."""
    return speed_mps * latency_s + speed_mps**2 / (2 * brake_mps2)


def impact_mps(speed_mps: float, gap_m: float, latency_s: float, brake_mps2: float) -> float:
    """Return the speed left after the gap, 0 if it is long enough."""
    braking_m = max(0.0, gap_m - speed_mps * latency_s)
    return math.sqrt(max(0.0, speed_mps**2 - 2 * brake_mps2 * braking_m))


def moving_commands(done: SimulatedRun, first: int, gap_m: float, latency_s: float, brake_mps2: float) -> int:
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


def tables(rows: Sequence[Row]) -> list[TabledCell]:
    """Return, per law and friction, a row per distance for the blind driver, and one per place and box for others."""
    made = []
    for title, some in by_law_and_friction(rows):
        reacting = [driver for driver in distinct(some, "driver") if driver != "blind"]
        made += [_driven(f"{title}, {driver}", chosen(some, driver=driver)) for driver in reacting]
        blind = chosen(some, driver="blind")
        if blind:
            lines = [((name,), chosen(blind, scenario=name)) for name in sorted(distinct(blind, "scenario"))]
            what = f"{title}: stopped, or impact (physics) [m/s]"
            made.append(speed_table(what, ("appears at",), lines, _figure, _notes(blind)))
    return made


def _driven(title: str, rows: Sequence[Row]) -> TabledCell:
    """Return the table of a driver that reacts, a row per place and box, a column per speed."""
    lines: dict[tuple[str, ...], list[Row]] = {}
    for row in rows:
        lines.setdefault((" ".join(row["scenario"].split()[1:3]),), []).append(row)
    title = f"{title}: clear of stoppable; impact above physics in the others [m/s]"
    return speed_table(title, ("place, box",), list(lines.items()), _outcome, _driven_notes(rows))


def _outcome(rows: Sequence[Row]) -> str:
    stoppable, others = chosen(rows, stoppable=True), chosen(rows, stoppable=False)
    clear = sum(row["clear"] for row in stoppable)
    text = f"{clear} of {len(stoppable)}{' !' if clear < len(stoppable) else ''}"
    if not others:
        return text
    excess_mps = worst(others, "excess_mps")
    return f"{text}; {excess_mps:+.2f}{' !' if excess_mps > EXCESS_MPS else ''}"


def _driven_notes(rows: Sequence[Row]) -> tuple[str, ...]:
    stoppable, others = chosen(rows, stoppable=True), chosen(rows, stoppable=False)
    beyond = [row for row in others if row["excess_mps"] > EXCESS_MPS]
    first = (
        f"clear in {sum(row['clear'] for row in stoppable)} of {len(stoppable)} stoppable runs and in"
        f" {sum(row['clear'] for row in others)} of {len(others)} others"
    )
    second = (
        f"{len(beyond)} of the others hit more than {EXCESS_MPS:g} m/s harder than a straight full brake would,"
        f" at most {worst(others, 'excess_mps'):+.2f} m/s"
    )
    return first, second


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


EXPERIMENT = Experiment(measure, cells, tables)
