"""`lab rooms`: a cluttered room, and people in the way, with the complete law of the car: follower, safety, recovery.

A person run measures three things: contact while the car moved, whether the car resumes when the way is free, and how
soon. "Free" is the simulator's truth: no walker in the strip that a car going straight on needs, 1.2 m long and 5 cm
wider on each side than the car. A car that backed out and went round before that has resumed after 0 s.
"""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from wallride.runtime.control.guidance import Follower, Guard
from wallride.runtime.control.vehicle import GRAVITY_MPS2
from wallride.sim.car.vehicle import VehicleSettings
from wallride.sim.lab import laws
from wallride.sim.lab.cell import Cell, CellChoice, Experiment, Figures, TabledCell
from wallride.sim.lab.courses.walls import world_of
from wallride.sim.lab.figures import Row, by_law, chosen, common, distinct, mean, number, text, worst
from wallride.sim.lab.safety import stopping_m
from wallride.sim.virtual.closed_loop import Case, SimulatedRun, drive
from wallride.sim.world.obstacles import ConstantMotion, Obstacle, Round, StandingObstacle, person
from wallride.sim.world.pose import CAR, Booleans, Floats, Pose
from wallride.sim.world.worlds import load_world

ROOMS = 12
CLUTTER_S = 60.0
GIVEN_UP_S = 15.0
"""Standstill that ends a run: longer than the car's patience and the whole decision about backing out."""
STUCK_S = 10.0
"""Standstill at the end from which on a car counts as stuck; less is patience."""
WAITS = ", waits"
"""Suffix of the scenario's variant in which the settings do not allow the car to back out."""
FREE_AHEAD_M, FREE_ASIDE_M = 1.2, 0.05
SOON_S = 5.0
GOES_ABOVE_MPS, GOES_FOR_S = 0.25, 1.0
STANDS_BELOW_MPS = 0.05
STOOD_S = 0.3
AT_M = 4.0
WALKER_RADIUS_M = 0.2
ASIDE_M = 2.6
LEAVES_AFTER_S = 4.0
COMES_SPARE_M = 0.4
REACTION_S, SLIPPERY_MU = 0.3, 0.5
MAX_CLUTTER_MPS, MAX_SPEED_MPS = 2.0, 3.0
WALKS_MPS = (1.0, 2.0, 3.0)
LEGEND: tuple[str, ...] = (
    "touched: runs with a contact while the car moved (of these avoidable by a brake 0.3 s after the person moved)",
    "stuck: runs that end in a standstill of 10 s or more. way m: mean way driven. tries: attempts to back out",
    "stood: runs in which a person stopped the car. freed: of these, those whose way became free again",
    "within 5 s: of the freed, those that drove on within 5 s; latest s: the longest that one of them took",
)


@dataclass(frozen=True, slots=True)
class Walker:
    """A person, for a wall on the left, who meets a car on its straight way; see `WAYS`."""

    name: str
    walking_mps: float

    def obstacle(self, speed_mps: float) -> Obstacle:
        """Return the person who meets a car of this speed."""
        arrives_s = (AT_M - CAR.front_m) / speed_mps
        return WAYS[self.name](self.walking_mps, arrives_s, speed_mps)

    def avoidable(self, speed_mps: float, mu: float) -> bool:
        """Return whether a brake REACTION_S after the person moved, or became visible, ends before the person."""
        motion = self.obstacle(speed_mps).motion
        arrives_s = (AT_M - CAR.front_m) / speed_mps
        if motion is None or not math.isfinite(motion.from_s) or motion.from_s > arrives_s:
            return True
        bumper_m = CAR.front_m + speed_mps * (motion.from_s + REACTION_S)
        return AT_M - WALKER_RADIUS_M - bumper_m > stopping_m(speed_mps, 0.04, mu * GRAVITY_MPS2)


def _crosses(walking_mps: float, arrives_s: float, _: float) -> Obstacle:
    """Return a walker from the free side through the way and the wall; in the middle when the bumper comes there."""
    from_m = min(ASIDE_M, walking_mps * arrives_s)
    return person(AT_M, -from_m, ConstantMotion(0.0, walking_mps, arrives_s - from_m / walking_mps))


def _stops(walking_mps: float, arrives_s: float, _: float) -> Obstacle:
    """Return the same walker, but only to the middle of the way, for good."""
    from_m = min(ASIDE_M, walking_mps * arrives_s)
    return person(AT_M, -from_m, ConstantMotion(0.0, walking_mps, arrives_s - from_m / walking_mps, arrives_s))


def _leaves(walking_mps: float, arrives_s: float, _: float) -> Obstacle:
    """Return a person in the way from the beginning, who leaves it to the free side after the car stood for some s."""
    return Obstacle(
        Round(WALKER_RADIUS_M), _at(AT_M, 0.0), ConstantMotion(0.0, -walking_mps, arrives_s + LEAVES_AFTER_S)
    )


def _passes(walking_mps: float, arrives_s: float, _: float) -> Obstacle:
    """Return a person who comes in the car's way and drifts aside, 0.55 m from its middle line 0.5 s before meeting."""
    drifts_s = max(0.5, arrives_s - 0.5)
    from_m = AT_M + walking_mps * arrives_s
    return Obstacle(Round(WALKER_RADIUS_M), _at(from_m, 0.2), ConstantMotion(-walking_mps, -0.75 / drifts_s))


def _comes(walking_mps: float, arrives_s: float, speed_mps: float) -> Obstacle:
    """Return a person who comes straight at the car and stops for good where a car at full speed could still stop."""
    room_m = COMES_SPARE_M + stopping_m(speed_mps, REACTION_S, SLIPPERY_MU * GRAVITY_MPS2)
    from_m = AT_M + room_m + walking_mps * arrives_s
    return Obstacle(Round(WALKER_RADIUS_M), _at(from_m, 0.0), ConstantMotion(-walking_mps, 0.0, -math.inf, arrives_s))


WAYS: dict[str, Callable[[float, float, float], Obstacle]] = {
    "crosses": _crosses,
    "stops in the way": _stops,
    "stands, then leaves": _leaves,
    "comes and passes": _passes,
    "comes and stops": _comes,
}
WALKERS = {f"{name} at {walking_mps:g} m/s": Walker(name, walking_mps) for name in WAYS for walking_mps in WALKS_MPS}
CLUTTER = "cluttered room "


def _at(x_m: float, y_m: float) -> StandingObstacle:
    return StandingObstacle(Pose(x_m, y_m, 0.0))


def cells(choice: CellChoice) -> list[Cell]:
    """Return what is to be run: clutter up to 2 m/s on one floor, people up to 3 m/s on all of them."""
    rooms = [f"{CLUTTER}{room}{variant}" for room in range(2 if choice.quick else ROOMS) for variant in ("", WAITS)]
    people = [name + variant for name in list(WALKERS)[:: 3 if choice.quick else 1] for variant in ("", WAITS)]
    mu = 0.8 if 0.8 in choice.mus else choice.mus[0]
    planned = choice.cells("rooms", [*rooms, *people])
    return [
        cell
        for cell in planned
        if (cell.speed_mps <= MAX_CLUTTER_MPS and cell.mu == mu and cell.scenario.startswith(CLUTTER))
        or (cell.speed_mps <= MAX_SPEED_MPS and not cell.scenario.startswith(CLUTTER))
    ]


def build(cell: Cell, case: Case) -> tuple[Follower, Guard]:
    """Return the car's laws, with or without recovery."""
    backs_out = f"safety.backs_out={str(not cell.scenario.endswith(WAITS)).lower()}"
    stack = laws.stack_in(cell, case, [backs_out] if cell.law.endswith("+swept") else [])
    return stack.follower, stack.judge


def run(cell: Cell) -> SimulatedRun:
    """Drive one cell."""
    scenario = cell.scenario.removesuffix(WAITS)
    vehicle = VehicleSettings(grip_mu=cell.mu)
    if scenario.startswith(CLUTTER):
        world = load_world("cluttered", side=cell.side, seed=int(scenario.removeprefix(CLUTTER)))
        case = Case(
            world, None, 0.0, side=cell.side, distance_m=CLUTTER_S * cell.speed_mps, duration_s=CLUTTER_S,
            standing_s=GIVEN_UP_S, vehicle=vehicle, seed=cell.seed,
        )  # fmt: skip
    else:
        case = Case(
            world_of("straight", cell.side), Pose(0.0, 0.0, 0.0), cell.speed_mps, side=cell.side, distance_m=12.0,
            duration_s=45.0, standing_s=GIVEN_UP_S, vehicle=vehicle, obstacles=(_walker(cell),), seed=cell.seed,
        )  # fmt: skip
    return drive(case, *build(cell, case))


def _walker(cell: Cell) -> Obstacle:
    thing = WALKERS[cell.scenario.removesuffix(WAITS)].obstacle(cell.speed_mps)
    return thing if cell.side == "left" else thing.mirrored()


def measure(cell: Cell) -> Figures:
    """Drive one cell."""
    done = run(cell)
    figures = common(done)
    clutter = cell.scenario.startswith(CLUTTER)
    moves = np.flatnonzero(np.abs(done.speed_mps[:, 0]) > STANDS_BELOW_MPS)
    stood_s = float(done.time_s[-1] - done.time_s[moves[-1]]) if moves.size else math.inf
    stuck = stood_s > STUCK_S and not figures["collided"]
    figures |= {
        "kind": "clutter" if clutter else cell.scenario.removesuffix(WAITS).partition(" at ")[0],
        "backs_out": not cell.scenario.endswith(WAITS),
        "stuck": stuck,
        "tries": tries(done.reasons),
        "last_words": done.reasons[-1],
        "stood": False,
        "freed": None,
        "resumed_after_s": None,
    }
    figures["avoidable"] = clutter or WALKERS[cell.scenario.removesuffix(WAITS)].avoidable(cell.speed_mps, cell.mu)
    if not clutter:
        figures |= resuming(done, done.case.obstacles[0])
    return figures


def tries(reasons: Sequence[str]) -> int:
    """Return the number of times the car began to back out."""
    backs = [reason.startswith("backing out") for reason in reasons]
    return sum(now and not before for before, now in pairwise(backs))


def resuming(done: SimulatedRun, walker: Obstacle) -> Figures:
    """Return whether the car stood, whether its way became free, and the time from then until it drove (None: never).

    The first standstill counts. It drives again when it goes forward for a second; a car that backed out and went round
    before the way was free has resumed at once.
    """
    stands = np.abs(done.speed_mps[:, 0]) < STANDS_BELOW_MPS
    stands[: int(np.argmax(~stands))] = False  # before the car set off
    rate_hz = done.case.lidar.rate_hz
    rows = np.flatnonzero(stands)
    if len(rows) < STOOD_S * rate_hz:
        return {"stood": False, "freed": None, "resumed_after_s": None}
    first = int(rows[0])
    later = np.flatnonzero(_for_good(way_free(done, walker)[first:]))
    goes = first + np.flatnonzero(_lasting(done.speed_mps[first:, 0] > GOES_ABOVE_MPS, round(GOES_FOR_S * rate_hz)))
    if not later.size:
        return {"stood": True, "freed": False, "resumed_after_s": None}
    freed_s = float(done.time_s[first + int(later[0])])
    after_s = number(max(0.0, float(done.time_s[goes[0]]) - freed_s)) if goes.size else None
    return {"stood": True, "freed": True, "resumed_after_s": after_s}


def _lasting(which: Booleans, rows: int) -> Booleans:
    """Return where a run of at least this many True begins or lasts for this many more."""
    ahead = np.convolve(which[::-1], np.ones(rows))[: which.size][::-1]
    lasting: Booleans = ahead > rows - 0.5
    return lasting


def _for_good(free: Booleans) -> Booleans:
    """Return the rows from which on the way stays free."""
    kept: Booleans = np.logical_and.accumulate(free[::-1])[::-1]
    return kept


def way_free(done: SimulatedRun, walker: Obstacle) -> Booleans:
    """Return, for each scan, whether the strip straight ahead is free."""
    at_m = walker_at(walker, done.time_s)
    dx, dy = at_m[0] - done.pose[:, 0], at_m[1] - done.pose[:, 1]
    cos, sin = np.cos(done.pose[:, 2]), np.sin(done.pose[:, 2])
    ahead_m, aside_m = cos * dx + sin * dy, np.abs(cos * dy - sin * dx)
    beyond_m = np.maximum(np.maximum(ahead_m - CAR.front_m - FREE_AHEAD_M, -CAR.rear_m - ahead_m), 0.0)
    off_m = np.hypot(beyond_m, np.maximum(aside_m - CAR.half_width_m - FREE_ASIDE_M, 0.0))
    free: Booleans = off_m > walker.half_length_m
    return free


def walker_at(walker: Obstacle, time_s: Floats) -> Floats:
    """Return the positions of a person, (2, n)."""
    if not isinstance(walker.appearance, StandingObstacle) or walker.motion is None:
        raise TypeError("a person stands somewhere and walks")
    motion, pose = walker.motion, walker.appearance.pose
    begins_s = max(motion.from_s, walker.appearance.from_s, 0.0)
    walked_s = np.clip(np.minimum(time_s, motion.until_s) - begins_s, 0.0, None)
    return np.stack([pose.x_m + motion.x_mps * walked_s, pose.y_m + motion.y_mps * walked_s])


def tables(rows: Sequence[Row]) -> list[TabledCell]:
    """Return one table per law: a row per kind, with and without backing out."""
    made = []
    for law, some in by_law(rows):
        lines = [
            _line(chosen(some, kind=kind, backs_out=backs), kind, backs=backs)
            for kind in distinct(some, "kind")
            for backs in (True, False)
            if chosen(some, kind=kind, backs_out=backs)
        ]
        columns = (
            "room", "way out", "runs", "touched (avoidable)", "stuck", "way m", "tries", "stood", "freed", "within 5 s",
            "latest s", "last words of who is stuck",
        )  # fmt: skip
        made.append(TabledCell(f"{law}: clutter and people", columns, tuple(lines), LEGEND))
    return made


def _line(rows: Sequence[Row], kind: str, *, backs: bool) -> tuple[str, ...]:
    freed = [row for row in rows if row["freed"]]
    soon = [row for row in freed if row["resumed_after_s"] is not None and row["resumed_after_s"] <= SOON_S]
    words = sorted({row["last_words"] for row in rows if row["stuck"]})
    return (
        kind,
        "backs out" if backs else "waits",
        str(len(rows)),
        f"{sum(row['collided'] for row in rows)} ({sum(row['collided'] and row['avoidable'] for row in rows)})",
        str(sum(row["stuck"] for row in rows)),
        text(mean(rows, "distance_m"), 1),
        str(sum(row["tries"] for row in rows)),
        str(sum(row["stood"] for row in rows)),
        str(len(freed)),
        f"{len(soon)} of {len(freed)}" if freed else "",
        text(worst(freed, "resumed_after_s"), 1),
        "; ".join(words),
    )


EXPERIMENT = Experiment(measure, cells, tables)
