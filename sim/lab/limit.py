"""Minimum mean error that any steering could reach: the reference for a run's figures.

Most of a run's mean error is the way from its start to the wanted distance, which no law can save. The limit is found
by optimal control of a car with full knowledge of the course: the single-track model of `wallride.sim.car.vehicle` at
constant speed (same tyres, same grip, same yaw inertia), with the steering's stop and its rate. The wheels do not move
before the answer to the first scan can reach them: `delay_s`, the 20 ms to the wire and the servo's 20 ms of every
clean run. Advantages of the limit over a law: no noise, the whole way known, an exact vehicle model.

Minimised is the mean of |distance - wanted| at the moments of the scans, the first one at the start included: exactly
what `wallride.sim.lab.figures` calls the mean error. (The start counts: half a metre at one scan of 114 is 4 mm of 38.)
It is done by sequential linear programming (Nocedal & Wright, Numerical Optimization, 2nd ed., chapter 18; Fletcher &
Sainz de la Maza 1989): near the present path the errors are linear in small changes of the steering, their absolute sum
is a linear programme, so are all bounds, and a trust region keeps the changes small. The result is a feasible path, so
the true limit can be lower but not higher. Contact is no part of the problem, only noticed afterwards. A law that
drives slower than asked can be better than the limit at that speed.
"""

import math
from dataclasses import dataclass, replace
from functools import lru_cache
from typing import Any

import numpy as np
from scipy.optimize import linprog
from scipy.sparse import csr_array, eye_array, hstack, vstack

from wallride.runtime.control.vehicle import GRAVITY_MPS2
from wallride.sim.car.vehicle_settings import VehicleSettings
from wallride.sim.world.pose import CAR, Floats, Pose
from wallride.sim.world.segments import SegmentGeometry

KNOT_M = 0.1
"""Distance between two knots of the steering, which is linear between them."""
SCAN_S = 0.025
"""Period of the scans, at which the errors count, as in the figures of a run."""
_MAX_STEP_S = 0.005
_ROUNDS = 40
_TRUST_RAD = 0.1
_GIVE_UP_RAD = 5e-4
_PROBE_RAD = 1e-4
_GUESSES_AHEAD_M = (0.4, 0.7, 1.1)
_FAN_RAD = np.radians(np.arange(-85.0, 86.0, 2.5))
_LP_SECONDS = 5.0
_VEHICLE = VehicleSettings()
SPEED_STEP_MPS = 0.5

Wall = tuple[tuple[float, float, float, float], ...]
"""The followed wall as segments (x0, y0, x1, y1)."""


@dataclass(frozen=True, slots=True)
class Task:
    """A start, a wall and a car. delay_s: from the scan to the first motion of the wheels."""

    wall: Wall
    start: Pose
    speed_mps: float
    way_m: float = 8.5
    desired_m: float = 1.0
    delay_s: float = 0.04
    vehicle: VehicleSettings = _VEHICLE


@lru_cache(maxsize=1024)
def least_mean_error_m(task: Task) -> float:
    """Return the least mean |error| found [m]; the distance counts from the rear axle to the nearest point.

    NaN when that path touches the wall: then the search found no steering free of contact.
    """
    cost, steering_rad = best_steering(task)
    return math.nan if SteeringProblem(task).touches(np.array(steering_rad)) else cost


@lru_cache(maxsize=1024)
def best_steering(task: Task) -> tuple[float, tuple[float, ...]]:
    """Return the least mean |error| [m] and its steering [rad] at every KNOT_M of the way.

    Corners have many local optima: there the solution for a slower car is one of the initial guesses.
    """
    problem = SteeringProblem(task)
    guesses = [problem.straight(), *(problem.followed(ahead_m) for ahead_m in _GUESSES_AHEAD_M)]
    guesses = sorted(guesses, key=problem.cost)[:2]
    if len(task.wall) > 1 and task.speed_mps > 1.0:
        slower = replace(task, speed_mps=max(1.0, task.speed_mps - SPEED_STEP_MPS))
        guesses.append(problem.possible(np.array(best_steering(slower)[1])))
    cost, steering_rad = min((problem.improved(guess) for guess in guesses), key=lambda found: found[0])
    return cost, tuple(steering_rad.tolist())


class SteeringProblem:
    """Optimal control problem of the steering at n knots."""

    def __init__(self, task: Task) -> None:
        self.task = task
        self._wall = np.array(task.wall)
        self.knots = round(task.way_m / KNOT_M)
        self.knot_s = KNOT_M / task.speed_mps
        self._turn_rad = task.vehicle.steering_rate_radps * self.knot_s
        self._blind_s = task.delay_s
        self._slew = csr_array(eye_array(self.knots) - eye_array(self.knots, k=-1))
        self._weights = _scan_weights(self.knots, self.knot_s)
        start = np.array([[task.start.x_m, task.start.y_m]])
        self._start_cost_m = self._weights[0] * abs(float(self._errors(start)[0][0]))

    def straight(self) -> Floats:
        """Return the initial guess of zero steering."""
        return np.zeros(self.knots)

    def followed(self, ahead_m: float) -> Floats:
        """Return the initial guess of pure pursuit (Coulter 1992) after a ball of the wanted radius on a left wall."""
        at, angle_rad, guess = self.task.start, 0.0, np.zeros(self.knots)
        vehicle = self.task.vehicle
        for k in range(self.knots):
            bearings = at.yaw_rad + _FAN_RAD
            around = np.column_stack([at.x_m + ahead_m * np.cos(bearings), at.y_m + ahead_m * np.sin(bearings)])
            too_near = self._errors(around)[0] < 0
            aim_rad = float(_FAN_RAD[int(too_near.argmax())]) if too_near.any() else float(_FAN_RAD[-1])
            wanted_rad = math.atan(2 * vehicle.wheelbase_m * math.sin(aim_rad) / ahead_m)
            wanted_rad = min(max(wanted_rad, -vehicle.max_steering_rad), vehicle.max_steering_rad)
            angle_rad = min(max(wanted_rad, angle_rad - self._turn_rad), angle_rad + self._turn_rad)
            guess[k] = angle_rad
            turn_rad = KNOT_M * math.tan(angle_rad) / vehicle.wheelbase_m
            moved = Pose(at.x_m, at.y_m, at.yaw_rad + turn_rad / 2).ahead(KNOT_M)
            at = Pose(moved.x_m, moved.y_m, at.yaw_rad + turn_rad)
        return guess

    def possible(self, steering_rad: Floats) -> Floats:
        """Return a steering as near to the given one as the servo's rate allows."""
        last_rad, allowed = 0.0, np.empty(self.knots)
        for k, wanted_rad in enumerate(steering_rad):
            last_rad = min(max(wanted_rad, last_rad - self._turn_rad), last_rad + self._turn_rad)
            allowed[k] = last_rad
        return allowed

    def cost(self, steering_rad: Floats) -> float:
        """Return the mean |error| of a steering over the scans."""
        after_m = np.abs(self._errors(self.paths(steering_rad[None])[0])[0])
        cost_m: float = self._start_cost_m + (self._weights[1:] * after_m).sum()
        return float(cost_m)

    def touches(self, steering_rad: Floats) -> bool:
        """Return whether the car's outline touches the wall on its way; slip angles are neglected."""
        places = self.paths(steering_rad[None])[0]
        ways = np.diff(places, axis=0)
        geometry = SegmentGeometry(self._wall)
        poses = zip(places[1:], np.arctan2(ways[:, 1], ways[:, 0]), strict=True)
        return any(geometry.clearance(Pose(float(x), float(y), float(yaw)), CAR) <= 0.0 for (x, y), yaw in poses)

    def improved(self, steering_rad: Floats, trust_rad: float = _TRUST_RAD) -> tuple[float, Floats]:
        """Improve a guess until the search converges; return its mean error and the steering."""
        cost = self.cost(steering_rad)
        slope: Floats | None = None
        error_m = np.empty(0)
        for _ in range(_ROUNDS):
            if slope is None:
                error_m, slope = self._linearised(steering_rad)
            tried = steering_rad + self._best_change(steering_rad, error_m, slope, trust_rad)
            new_cost = self.cost(tried)
            if new_cost < cost:
                gain_m, cost, steering_rad, slope = cost - new_cost, new_cost, tried, None
                trust_rad = min(2 * trust_rad, 0.3)
                if gain_m < 2e-5:
                    break
            else:
                trust_rad /= 4
                if trust_rad < _GIVE_UP_RAD:
                    break
        return cost, steering_rad

    def _linearised(self, steering_rad: Floats) -> tuple[Floats, Floats]:
        """Return the errors (n,) and their slopes by each knot's steering (n, n), by trying each knot."""
        paths = self.paths(np.vstack([steering_rad, steering_rad + _PROBE_RAD * np.eye(self.knots)]))
        error_m, normal = self._errors(paths[0])
        slope = np.einsum("kd,ikd->ki", normal, paths[1:] - paths[0]) / _PROBE_RAD
        return error_m, slope

    def paths(self, steering_rad: Floats) -> Floats:
        """Return the rear axle's places after each knot for a batch of steerings (b, n), shape (b, n, 2)."""
        task, s = self.task, self.task.vehicle
        batch, speed = len(steering_rad), task.speed_mps
        parts = math.ceil(self.knot_s / _MAX_STEP_S)
        step_s = self.knot_s / parts
        x_m, y_m = np.full(batch, task.start.x_m), np.full(batch, task.start.y_m)
        yaw, left, rate = np.full(batch, task.start.yaw_rad), np.zeros(batch), np.zeros(batch)
        places = np.empty((batch, self.knots, 2))
        grip = s.grip_mu * GRAVITY_MPS2
        front_grip, rear_grip = grip * s.rear_axle_to_cg_m / s.wheelbase_m, grip * s.front_axle_to_cg_m / s.wheelbase_m
        per_moment = s.mass_kg / s.yaw_inertia_kgm2
        front_m, rear_m = s.front_axle_to_cg_m, s.rear_axle_to_cg_m
        known = np.hstack([np.zeros((batch, 1)), steering_rad])
        times_s = self.knot_s * np.arange(self.knots + 1)
        for step in range(self.knots * parts):
            at_s = max(0.0, (step + 0.5) * step_s - self._blind_s)
            knot = min(int(at_s / self.knot_s), self.knots - 1)
            share = (at_s - times_s[knot]) / self.knot_s
            angle = known[:, knot] * (1 - share) + known[:, knot + 1] * share
            slip_front = angle - np.arctan((left + front_m * rate) / speed)
            slip_rear = -np.arctan((left - rear_m * rate) / speed)
            front = front_grip * _saturated(s.cornering_front_per_rad * slip_front) * np.cos(angle)
            rear = rear_grip * _saturated(s.cornering_rear_per_rad * slip_rear)
            left = left + (front + rear - speed * rate) * step_s
            turned = rate + per_moment * (front_m * front - rear_m * rear) * step_s
            middle = (rate + turned) / 2
            heading = yaw + middle * step_s / 2
            aside = left - rear_m * middle
            cos, sin = np.cos(heading), np.sin(heading)
            x_m = x_m + (speed * cos - aside * sin) * step_s
            y_m = y_m + (speed * sin + aside * cos) * step_s
            yaw, rate = yaw + middle * step_s, turned
            if (step + 1) % parts == 0:
                places[:, step // parts, 0], places[:, step // parts, 1] = x_m, y_m
        return places

    def _errors(self, points: Floats) -> tuple[Floats, Floats]:
        """Return the error at points (n, 2), shape (n,), and the direction in which it grows (n, 2)."""
        start, step = self._wall[:, :2], self._wall[:, 2:] - self._wall[:, :2]
        to_point = points[:, None, :] - start
        share = np.clip(np.sum(to_point * step, axis=2) / np.sum(step**2, axis=1), 0.0, 1.0)
        away = to_point - share[:, :, None] * step
        distance = np.hypot(away[:, :, 0], away[:, :, 1])
        nearest = distance.argmin(axis=1)
        rows = np.arange(len(points))
        distance_m = np.maximum(distance[rows, nearest], 1e-9)
        return distance_m - self.task.desired_m, away[rows, nearest] / distance_m[:, None]

    def _best_change(self, steering_rad: Floats, error_m: Floats, slope: Floats, trust_rad: float) -> Floats:
        """Solve the linear programme; its variables are the changes (n,) and the sizes of the errors (n,)."""
        n, stop_rad = self.knots, self.task.vehicle.max_steering_rad
        size, nothing = -eye_array(n), csr_array((n, n))
        dense = csr_array(slope)
        above = vstack(
            [
                hstack([dense, size]),
                hstack([-dense, size]),
                hstack([self._slew, nothing]),
                hstack([-self._slew, nothing]),
            ]
        )
        turned: Floats = np.asarray(self._slew @ steering_rad)
        below = np.concatenate([-error_m, error_m, self._turn_rad - turned, self._turn_rad + turned])
        low = np.minimum(np.maximum(-trust_rad, -stop_rad - steering_rad), 0.0)
        high = np.maximum(np.minimum(trust_rad, stop_rad - steering_rad), 0.0)
        bounds = np.vstack([np.column_stack([low, high]), np.tile([0.0, np.inf], (n, 1))])
        solve: Any = linprog  # its stubs lack sparse matrices
        cost, options = np.concatenate([np.zeros(n), self._weights[1:]]), {"time_limit": _LP_SECONDS}
        answer = solve(cost, A_ub=above, b_ub=below, bounds=bounds, method="highs-ds", options=options)
        if answer.x is None:
            return np.zeros(n)  # no better one found in time: the trust region shrinks
        change: Floats = answer.x[:n]
        return change


def _scan_weights(knots: int, knot_s: float) -> Floats:
    """Return the weights of the error at the start and after each knot in the mean over the scans, shape (n + 1,)."""
    at = np.arange(0.0, knots * knot_s - 1e-9, SCAN_S) / knot_s  # between two knots the error is taken as linear
    before = np.minimum(at.astype(np.intp), knots - 1)
    share = at - before
    weights = np.bincount(before, 1.0 - share, knots + 1) + np.bincount(before + 1, share, knots + 1)
    mean: Floats = weights / at.size
    return mean


def _saturated(z: Floats) -> Floats:
    z2 = z * z
    saturated: Floats = z / np.sqrt(np.sqrt(1.0 + z2 * z2))
    return saturated
