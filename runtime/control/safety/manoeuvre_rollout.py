"""Rollouts of a manoeuvre, its path and its contacts: the vehicle model of the emergency manoeuvre.

Single-track model, both axles equally loaded, on a floor with grip G = mu g. C is the stiffness of the rear axle, and
FRONT_SHARE of it that of the front: the car understeers. Per step:

    the brake     a deceleration of G or more locks the wheels: straight on along the course, slowing by G. Less leaves
                  A = sqrt(G^2 - brake^2) for turning (Kamm's circle)
    the wheels    follow the past commands for the latency, then turn to the new angle at the servo's rate
    the tyres     side force per axle = -A / 2 sat(C slip angle), sat(z) = z / sqrt(1 + z^2)

State: speed ahead u and aside w of the middle, yaw rate r. With h half the wheelbase:

    w' = front + rear - u r      r' = YAW_RESPONSE (front - rear) / h      u' = -brake - front sin(steering) + w r

Below SLOW_MPS the car rolls without slip. Source: single-track model, e.g. Rajamani, Vehicle Dynamics and Control, 2.3.
"""

import math
from collections.abc import Iterator
from typing import Any, NamedTuple

import numpy as np

from wallride.drivers.accelerated import accelerated
from wallride.runtime.control.perception.geometry import ENOUGH_POINTS, Floats, Places

STEP_S = 0.01
LOOK_STEPS = 2
"""Interval in steps at which the outline is checked against the points: 8 cm at 4 m/s."""
HORIZON_STEPS = 100
"""Horizon of 1 s: after it a car of 4 m/s stands on a floor of 0.5. A car still rolling then brakes."""
LOCK_STEPS = 6
"""Interval in steps at which the wheels may be locked."""
MIN_TURN_S = 0.06
"""Minimum duration of a turn before a full brake: the next scans choose again, of a slow lidar later by its wait."""
YAW_RESPONSE = 2.0
"""Square of half the wheelbase through that of the radius of gyration (f1tenth_gym: 2.16)."""
FRONT_SHARE = 0.865
"""Cornering stiffness of the front axle through that of the rear (f1tenth_gym: 4.718 / 5.456): at full lock and two
thirds of the grip a bend runs 6 % wider than with equal axles."""
SLIDE_DAMPING = 1.0
"""Damping of the rotation with locked wheels, per distance slid; 2 without the load transfer of braking."""
SLOW_MPS = 1.0
STANDING_MPS = 0.05
MARGIN_M = 0.04
"""Distance below which a point counts as a contact: the noise of the lidar, and the error of the model."""
MAX_ROOM_M = 0.10
"""Maximum room that is rated; more is not better."""
MAX_FLOORS = 4
TINY = 1e-9


class RolloutStart(NamedTuple):
    """State of the car when the rollouts begin.

    speed_mps: forward, > 0. brake_mps2: deceleration until a new command takes effect, after latency_s.
    cornering_per_rad: C. The outline is the car's own: front_m, rear_m (backwards), half_width_m from the rear axle.
    waits_s: how much longer than at 40 Hz the next scan takes.
    """

    speed_mps: float
    brake_mps2: float
    latency_s: float
    rate_radps: float
    wheelbase_m: float
    cornering_per_rad: float
    front_m: float
    rear_m: float
    half_width_m: float
    waits_s: float = 0.0


class State(NamedTuple):
    """State of the car on its path. middle_m: between the axles. course_rad: direction of motion. yaw_radps: yaw rate.

    ahead_mps, aside_mps: of the middle. wheel_rad: angle of the front wheels.
    """

    middle_m: complex
    heading_rad: float
    course_rad: float
    speed_mps: float
    yaw_radps: float
    ahead_mps: float = 0.0
    aside_mps: float = 0.0
    wheel_rad: float = 0.0


Wheels = tuple[Floats, Floats]
"""Angle of the wheels at each step of the past, oldest first, and at the coming steps by the commands in flight."""


def _flat_rollouts(
    points_m: Places, steering_rad: Floats, brake_mps2: Floats, grip_mps2: Floats, wheels: Wheels, start: RolloutStart
) -> tuple[Any, ...]:
    return points_m, steering_rad, brake_mps2, grip_mps2, *wheels, *start


@accelerated(flat=_flat_rollouts)
def roll_out_all(
    points_m: Places, steering_rad: Floats, brake_mps2: Floats, grip_mps2: Floats, wheels: Wheels, start: RolloutStart
) -> Floats:
    """Return, for each manoeuvre (n,), the impact [m/s] on each floor (f,) and the least room [m]: (n * (f + 1),).

    points_m: solid points around, (k,), base_link.
    """
    points_m, (past_rad, coming_rad) = points_m[np.isfinite(points_m)], wheels
    _check(start, steering_rad, brake_mps2, grip_mps2, past_rad, coming_rad)
    margin_m = _margin_m(start, points_m)
    begun = [latency_path(start, past_rad.tolist(), coming_rad.tolist(), grip) for grip in grip_mps2.tolist()]
    rows: list[float] = []
    for steering, brake in zip(steering_rad.tolist(), brake_mps2.tolist(), strict=True):
        floors = []
        for path, grip in zip(begun, grip_mps2.tolist(), strict=True):
            way = roll_out(start, path, steering, brake, grip)
            floors.append(_ends(start, way, points_m, brake, grip, margin_m))
        rows += _best_end(floors)
    return np.array(rows, np.float64)


def _check(
    start: RolloutStart, steering_rad: Floats, brake_mps2: Floats, grip_mps2: Floats, *wheel_rad: Floats
) -> None:
    """Raise ValueError for values that no car can have."""
    finite = all(bool(np.isfinite(values).all()) for values in (np.array(start), steering_rad, grip_mps2, *wheel_rad))
    outlined = start.front_m + start.rear_m >= 0.0 and start.half_width_m >= 0.0
    positive = outlined and start.brake_mps2 >= 0.0 and start.waits_s >= 0.0
    positive = positive and bool((grip_mps2 > 0.0).all() and (brake_mps2 >= 0.0).all())
    if not (finite and positive) or steering_rad.size != brake_mps2.size or not 1 <= grip_mps2.size <= MAX_FLOORS:
        raise ValueError("roll_outs: finite numbers, a steering for every brake, and 1 to 4 floors are needed")


def latency_path(start: RolloutStart, past_rad: list[float], coming_rad: list[float], grip_mps2: float) -> list[State]:
    """Return the state at every step until a new command takes effect, the present first, with the past's dynamics."""
    moves, wheel_rad = (start.speed_mps, 0.0, 0.0), 0.0
    for wheel_rad in past_rad:
        moves = _turned(start, (start.speed_mps, *moves[1:]), wheel_rad, 0.0, grip_mps2)
    middle_m, course_rad = complex(start.wheelbase_m / 2, 0.0), math.atan2(moves[1], moves[0])
    path = [State(middle_m, 0.0, course_rad, moves[0], moves[2], *moves[:2], wheel_rad)]
    for step in range(1, HORIZON_STEPS + 1):
        if step * STEP_S > start.latency_s:
            break
        wheel_rad = coming_rad[step - 1] if step <= len(coming_rad) else wheel_rad
        path.append(_next(start, path[-1], wheel_rad, start.brake_mps2, grip_mps2))
    return path


def roll_out(
    start: RolloutStart, path: list[State], steering_rad: float, brake_mps2: float, grip_mps2: float
) -> Iterator[State]:
    """Yield the state at every step up to the horizon, the latency's path first."""
    yield from path
    state, most_rad = path[-1], start.rate_radps * STEP_S
    for _ in range(len(path), HORIZON_STEPS + 1):
        wheel_rad = state.wheel_rad + min(max(steering_rad - state.wheel_rad, -most_rad), most_rad)
        state = _next(start, state, wheel_rad, brake_mps2, grip_mps2)
        yield state


def _next(start: RolloutStart, state: State, wheel_rad: float, slows_mps2: float, grip_mps2: float) -> State:
    """Return the state one step later."""
    moves, course_rad = (state.ahead_mps, state.aside_mps, state.yaw_radps), state.course_rad
    if slows_mps2 >= grip_mps2:
        moves = _slid(moves, course_rad - state.heading_rad, grip_mps2)
        heading_rad = state.heading_rad + moves[2] * STEP_S
    else:
        moves = _turned(start, moves, wheel_rad, slows_mps2, grip_mps2)
        heading_rad = state.heading_rad + moves[2] * STEP_S
        course_rad = heading_rad + math.atan2(moves[1], max(moves[0], STANDING_MPS))
    speed_mps = math.hypot(moves[0], moves[1])
    moved_m = (state.speed_mps + speed_mps) / 2 * STEP_S
    middle_m = state.middle_m + complex(moved_m * math.cos(course_rad), moved_m * math.sin(course_rad))
    return State(middle_m, heading_rad, course_rad, speed_mps, moves[2], *moves[:2], wheel_rad)


Moves = tuple[float, float, float]
"""Speed ahead and aside [m/s] of the middle, yaw rate [rad/s]."""


def _turned(start: RolloutStart, moves: Moves, wheel_rad: float, brake_mps2: float, grip_mps2: float) -> Moves:
    """Return the motion one step later while the wheels roll."""
    ahead, aside, yaw = moves
    half_m = start.wheelbase_m / 2
    if ahead < SLOW_MPS:
        ahead = max(0.0, ahead - brake_mps2 * STEP_S)
        yaw = ahead * math.tan(wheel_rad) / start.wheelbase_m
        return ahead, half_m * yaw, yaw
    axle_mps2 = math.sqrt(grip_mps2 * grip_mps2 - brake_mps2 * brake_mps2) / 2
    front_slip = FRONT_SHARE * start.cornering_per_rad * (math.atan2(aside + half_m * yaw, ahead) - wheel_rad)
    rear_slip = start.cornering_per_rad * math.atan2(aside - half_m * yaw, ahead)
    front = -axle_mps2 * front_slip / math.sqrt(1.0 + front_slip * front_slip)
    rear = -axle_mps2 * rear_slip / math.sqrt(1.0 + rear_slip * rear_slip)
    inward = front * math.cos(wheel_rad)
    return (
        ahead + (aside * yaw - brake_mps2 - front * math.sin(wheel_rad)) * STEP_S,
        aside + (inward + rear - ahead * yaw) * STEP_S,
        yaw + YAW_RESPONSE * (inward - rear) / half_m * STEP_S,
    )


def _slid(moves: Moves, drift_rad: float, grip_mps2: float) -> Moves:
    """Return the motion one step later while the wheels are locked; drift_rad: of the course from the heading."""
    before = math.hypot(moves[0], moves[1])
    speed = max(0.0, before - grip_mps2 * STEP_S)
    yaw = moves[2] * max(0.0, 1.0 - SLIDE_DAMPING * grip_mps2 * STEP_S / max(before, STANDING_MPS))
    return speed * math.cos(drift_rad), speed * math.sin(drift_rad), yaw


def _ends(
    start: RolloutStart, way: Iterator[State], points_m: Places, brake_mps2: float, grip_mps2: float, margin_m: float
) -> list[tuple[float, float]]:
    """Return impact and room for every moment at which the wheels may be locked.

    Ends at standstill and with a contact: all later moments have the same end.
    """
    ends: list[tuple[float, float]] = []
    room_m = MAX_ROOM_M
    for step, state in enumerate(way):
        if step % LOOK_STEPS == 0 and state.speed_mps > STANDING_MPS:
            room_m = min(room_m, distance_m(start, state, points_m) - margin_m)
            if room_m <= 0.0:
                return [*ends, (state.speed_mps, 0.0)]
        if not (stands := state.speed_mps == 0.0) and not _may_lock(start, brake_mps2, step):
            continue
        impact_mps, rest_m = slide(start, state, points_m, grip_mps2, margin_m)
        ends.append((impact_mps, min(rest_m, room_m)))
        if stands or not math.isfinite(brake_mps2):
            break
    return ends


def _may_lock(start: RolloutStart, brake_mps2: float, step: int) -> bool:
    """Return whether the wheels may be locked at this step: by a full brake at once, else at intervals and the end."""
    if not math.isfinite(brake_mps2):
        return step * STEP_S >= start.latency_s or step == HORIZON_STEPS
    first_s = start.latency_s + MIN_TURN_S + start.waits_s
    return step == HORIZON_STEPS or (step % LOCK_STEPS == 0 and step * STEP_S >= first_s)


def slide(
    start: RolloutStart, state: State, points_m: Places, grip_mps2: float, margin_m: float
) -> tuple[float, float]:
    """Return impact and room of a car that locks its wheels: straight on along its course, while it turns a little.

    A point is met where a line through it against the course enters the outline (slab method).
    """
    speed = state.speed_mps
    heading = state.heading_rad + state.yaw_radps * speed / (2 * (SLIDE_DAMPING + 1) * grip_mps2)
    drift = state.course_rad - heading
    ahead_m, aside_m = _from_outline(start, state.middle_m, heading, points_m)
    long_m, wide_m = (start.front_m + start.rear_m) / 2 + margin_m, start.half_width_m + margin_m
    cos, sin = math.cos(drift), math.copysign(max(abs(math.sin(drift)), TINY), drift)
    wide_m = math.copysign(wide_m, sin)
    enters_m = np.maximum((ahead_m - long_m) / cos, (aside_m - wide_m) / sin)
    leaves_m = np.minimum((ahead_m + long_m) / cos, (aside_m + wide_m) / sin)
    met = (enters_m <= leaves_m) & (leaves_m >= 0.0)
    left = speed * speed - 2 * grip_mps2 * max(0.0, _third(np.where(met, enters_m, np.inf)))
    if left > 0.0:
        return math.sqrt(left), 0.0
    way_m = speed * speed / (2 * grip_mps2) * complex(math.cos(state.course_rad), math.sin(state.course_rad))
    rests = State(state.middle_m + way_m, heading, 0.0, 0.0, 0.0)
    halfway = State(state.middle_m + way_m / 2, heading, 0.0, 0.0, 0.0)
    nearest_m = min(distance_m(start, rests, points_m), distance_m(start, halfway, points_m))
    return 0.0, min(max(0.0, nearest_m - margin_m), MAX_ROOM_M)


def distance_m(start: RolloutStart, state: State, points_m: Places) -> float:
    """Return the distance of the third-nearest point from the outline, infinity where there are fewer."""
    ahead_m, aside_m = _from_outline(start, state.middle_m, state.heading_rad, points_m)
    ahead_m = np.maximum(np.abs(ahead_m) - (start.front_m + start.rear_m) / 2, 0.0)
    aside_m = np.maximum(np.abs(aside_m) - start.half_width_m, 0.0)
    return _third(np.sqrt(ahead_m * ahead_m + aside_m * aside_m))


def _margin_m(start: RolloutStart, points_m: Places) -> float:
    """Return the margin, reduced where a point is nearer already, so that it does not count as a contact."""
    here = State(complex(start.wheelbase_m / 2, 0.0), 0.0, 0.0, 0.0, 0.0)
    return min(MARGIN_M, 0.5 * distance_m(start, here, points_m) - TINY)


def _from_outline(
    start: RolloutStart, middle_m: complex, heading_rad: float, points_m: Places
) -> tuple[Floats, Floats]:
    """Return the points relative to the outline's centre: distances ahead and to the left."""
    ahead_m = (start.front_m - start.rear_m - start.wheelbase_m) / 2
    turned = complex(math.cos(heading_rad), math.sin(heading_rad))
    seen = (points_m - (middle_m + ahead_m * turned)) * turned.conjugate()
    return seen.real, seen.imag


def _third(values: Floats) -> float:
    few = values.size < ENOUGH_POINTS
    return math.inf if few else float(np.partition(values, ENOUGH_POINTS - 1)[ENOUGH_POINTS - 1])


def _best_end(floors: list[list[tuple[float, float]]]) -> list[float]:
    """Return the impacts and the room of the best moment to lock the wheels, the same on all floors.

    floors: of each, impact and room at every such moment; the last one of a floor holds for all later ones.
    """
    best, best_energy, best_room_m = [math.inf] * len(floors), math.inf, 0.0
    for moment in range(max(map(len, floors))):
        ends = [floor[min(moment, len(floor) - 1)] for floor in floors]
        energy = sum(impact * impact for impact, _ in ends)
        room_m = min(room for _, room in ends)
        if energy < best_energy - TINY or (energy <= best_energy + TINY and room_m > best_room_m + TINY):
            best, best_energy, best_room_m = [impact for impact, _ in ends], energy, room_m
    return [*best, best_room_m]
