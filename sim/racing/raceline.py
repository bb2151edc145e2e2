"""The line of least curvature round a course, within its room and the car's tightest turn.

Heilmeier et al., "Minimum curvature trajectory planning and control for an autonomous race car", 2019: offsets n along
the normals N of a ring p minimize the sum of the second differences of p + n N, with bounds on n; linearized again
from each result.
"""

import math
from dataclasses import dataclass
from typing import Final

import clarabel
import numpy as np
from scipy import sparse
from scipy.interpolate import CubicSpline

from wallride.sim.racing.free_space import FreeSpace
from wallride.sim.racing.ring import SMOOTH_M, SPACING_M, even, lengths, ring_length_m
from wallride.sim.racing.speed_profile import Grip, lap_s, speeds_mps
from wallride.sim.world.pose import Floats

ROUNDS: Final = 14
SMOOTH_ROUNDS: Final = 10
"""Rounds that end with less and less smoothing, because a first move can fold the line; the last have none."""
FIRST_MOVE_M, LAST_MOVE_M = 0.6, 0.1
CROSSING_SHARE: Final = 0.7
"""Largest offset toward the inside of a bend as a share of its radius: normals must not cross."""
Aim = tuple[bool, float]
AIMS: Final[tuple[Aim, ...]] = ((False, 0.0), (False, 0.05), (True, 0.0))
"""Of what the line with the fastest lap is chosen: whether an offset n changes the curvature k by n'' + k^2 n (Frenet),
or by n'' - k^2 n, as differences at a fixed spacing have it, which favours shorter lines; and the weight of the squared
length beside the squared curvature."""
STEP_M: Final = 0.1
TURN_RESERVE: Final = 0.85
"""Share of the car's tightest curvature that a line may use: slip of the tyres, trim and corrections need the rest."""
OUTSIDE_COST: Final = 1e4
"""Cost of the square of an offset outside its bounds [1/m4]: a centimetre costs as much as a curvature of 1/m."""
TIGHT_COST: Final = 1e3
"""Cost of the square of what a curvature is above the car's."""


class NoLineError(ValueError):
    """No line can be driven; the text says where and why."""


@dataclass(frozen=True, slots=True, eq=False)
class RaceLine:
    """A closed line in the map's frame, points about STEP_M apart; all arrays have shape (n,).

    along_m: way from the first point, from 0. away_m: distance from the nearest wall or avoided place.
    curvature_radpm: positive to the left. acceleration_mps2: from each point to the next one.
    """

    along_m: Floats
    x_m: Floats
    y_m: Floats
    yaw_rad: Floats
    curvature_radpm: Floats
    speed_mps: Floats
    acceleration_mps2: Floats
    away_m: Floats
    length_m: float
    lap_s: float


def race_line(ring_m: Floats, space: FreeSpace, grip: Grip, *, keep_m: float, radius_m: float) -> RaceLine:
    """Return the line with the fastest lap that was found.

    ring_m: way round, shape (n, 2), evenly spaced. keep_m: wanted distance from walls; where the way round itself is
    nearer, as far as that. radius_m: the car's tightest turn.

    Raises: NoLineError where the line would turn more tightly than the car, or cross itself.
    """
    lines = [_with_speed(_optimized(ring_m, space, keep_m, radius_m, aim), space, grip) for aim in AIMS]
    fit = [line for line in lines if _fault(line, radius_m) is None]
    if not fit:
        raise NoLineError(_fault(lines[0], radius_m))
    return min(fit, key=lambda line: line.lap_s)


def _optimized(ring_m: Floats, space: FreeSpace, keep_m: float, radius_m: float, aim: Aim) -> Floats:
    """Return the ring moved in rounds, each of them a bounded least-squares problem."""
    line_m = ring_m
    for number in range(ROUNDS):
        most_m = FIRST_MOVE_M + (LAST_MOVE_M - FIRST_MOVE_M) * number / (ROUNDS - 1)
        _, normals, curvature = geometry(line_m)
        right_m, left_m = space.beside_m(line_m, normals, keep_m)
        inside_m = CROSSING_SHARE / np.maximum(np.abs(curvature), 1e-9)
        low_m = np.clip(np.maximum(right_m, np.where(curvature < 0, -inside_m, -np.inf)), -most_m, most_m)
        high_m = np.clip(np.minimum(left_m, np.where(curvature > 0, inside_m, np.inf)), -most_m, most_m)
        moved_m = line_m + _offsets(line_m, normals, (low_m, high_m), TURN_RESERVE / radius_m, aim)[:, None] * normals
        line_m = even(moved_m, SPACING_M, smooth_m=SMOOTH_M * max(0.0, 1.0 - number / SMOOTH_ROUNDS))
    return line_m


def _offsets(line_m: Floats, normals: Floats, bounds_m: tuple[Floats, Floats], most_radpm: float, aim: Aim) -> Floats:
    """Return the offsets with the least curvature (and length) by `aim`, shape (n,).

    They stay within their bounds and the curvature below `most_radpm`, or as near to that as can be: each has a slack
    with a price, because the bounds of a narrow place and of a tight turn may contradict each other.
    """
    (widens, mix), count, spacing_m = aim, len(line_m), ring_length_m(line_m) / len(line_m)
    here = np.arange(count)
    onward = sparse.csr_array((np.ones(count), (here, np.roll(here, -1))), shape=(count, count))
    same = sparse.eye_array(count, format="csr")
    second = (onward + onward.T - 2.0 * same) / spacing_m**2
    moves = [sparse.diags_array(part) for part in normals.T]
    bends: Floats = np.asarray(second @ line_m)
    turned: Floats = np.sum(normals * bends, axis=1)
    bent = sum((move @ second @ move for move in moves), sparse.csr_array((count, count)))
    turn = bent + sparse.diags_array(2.0 * np.minimum(turned**2, most_radpm**2))
    operators = [second] * (not widens) + [math.sqrt(mix) * (onward - same) / spacing_m] * (mix > 0.0)
    matrix = sparse.vstack([*[turn] * widens, *(op @ move for op in operators for move in moves)])
    wanted = -np.concatenate([*[turned] * widens, *(op @ part for op in operators for part in line_m.T)])
    rows = [(same, -same, None), (-same, -same, None), (None, -same, None), (turn, None, -same), (-turn, None, -same)]
    limits = [bounds_m[1], -bounds_m[0], np.zeros(count), most_radpm - turned, most_radpm + turned]
    settings = clarabel.DefaultSettings()
    settings.verbose = False
    solved = clarabel.DefaultSolver(
        sparse.csc_array(sparse.triu(sparse.block_diag([matrix.T @ matrix, OUTSIDE_COST * same, TIGHT_COST * same]))),
        np.concatenate([-(matrix.T @ wanted), np.zeros(2 * count)]), sparse.csc_array(sparse.block_array(rows)),
        np.concatenate(limits), [clarabel.NonnegativeConeT(5 * count)], settings,
    ).solve()  # fmt: skip
    return np.array(solved.x)[:count]


def geometry(line_m: Floats) -> tuple[Floats, Floats, Floats]:
    """Return yaw (n,), unit normals to the left (n, 2) and curvature (n,) of a ring, by differences of neighbours."""
    ahead, behind = np.roll(line_m, -1, axis=0) - line_m, line_m - np.roll(line_m, 1, axis=0)
    chord = ahead + behind
    yaw_rad = np.arctan2(chord[:, 1], chord[:, 0])
    cross = behind[:, 0] * ahead[:, 1] - behind[:, 1] * ahead[:, 0]
    curvature = 2.0 * cross / np.maximum(1e-12, lengths(ahead) * lengths(behind) * lengths(chord))
    return yaw_rad, np.column_stack([-np.sin(yaw_rad), np.cos(yaw_rad)]), curvature


def _with_speed(line_m: Floats, space: FreeSpace, grip: Grip) -> RaceLine:
    """Return the line as a periodic cubic spline, sampled anew, with its speed profile."""
    closed = np.vstack([line_m, line_m[:1]])
    knots_m = np.concatenate([[0.0], np.cumsum(lengths(np.diff(closed, axis=0)))])
    spline = CubicSpline(knots_m, closed, bc_type="periodic")
    count = max(16, round(float(knots_m[-1]) / STEP_M))
    at_m = knots_m[-1] * np.arange(count) / count
    points, first, second = spline(at_m), spline(at_m, 1), spline(at_m, 2)
    curvature = (first[:, 0] * second[:, 1] - first[:, 1] * second[:, 0]) / lengths(first) ** 3
    steps_m = lengths(np.roll(points, -1, axis=0) - points)
    speed = speeds_mps(curvature, steps_m, grip)
    acceleration = (np.roll(speed, -1) ** 2 - speed**2) / (2.0 * steps_m)
    return RaceLine(
        np.concatenate([[0.0], np.cumsum(steps_m)[:-1]]),
        points[:, 0], points[:, 1], np.arctan2(first[:, 1], first[:, 0]), curvature, speed, acceleration,
        space.away_m(points), float(steps_m.sum()), lap_s(speed, steps_m),
    )  # fmt: skip


def _fault(line: RaceLine, radius_m: float) -> str | None:
    """Return why a car cannot drive a line, None when it can."""
    tightest = int(np.argmax(np.abs(line.curvature_radpm)))
    needed_m = 1.0 / float(np.abs(line.curvature_radpm[tightest]))
    if needed_m < radius_m:
        at = f"x {line.x_m[tightest]:.1f} m, y {line.y_m[tightest]:.1f} m"
        return (
            f"at {at} the line turns on a radius of {needed_m:.2f} m, and the car needs {radius_m:.2f} m;"
            " a smaller --keep or --avoid may give it room"
        )
    crossing = _crossing(np.column_stack([line.x_m, line.y_m]))
    return None if crossing is None else f"the line crosses itself at x {crossing[0]:.1f} m, y {crossing[1]:.1f} m"


def _crossing(line_m: Floats) -> Floats | None:
    """Return a point where a closed polyline crosses itself, None without one."""
    begin, step = line_m, np.roll(line_m, -1, axis=0) - line_m
    for number in range(len(line_m) - 2):
        others = slice(number + 2, len(line_m) - (number == 0))
        gap, ways = begin[others] - begin[number], step[others]
        turn = step[number, 0] * ways[:, 1] - step[number, 1] * ways[:, 0]
        safe = np.where(turn == 0.0, np.inf, turn)
        here = (gap[:, 0] * ways[:, 1] - gap[:, 1] * ways[:, 0]) / safe
        there = (gap[:, 0] * step[number, 1] - gap[:, 1] * step[number, 0]) / safe
        if ((here >= 0) & (here < 1) & (there >= 0) & (there < 1) & (turn != 0.0)).any():
            at_m: Floats = begin[number]
            return at_m
    return None
