"""The least mean error that any steering could reach: what a figure has to be compared with.

Most of a run's mean error is the way from its start to the wanted distance, which no law can save. The limit is
found by optimal control of a car that knows everything: a kinematic bicycle of constant speed v, exact, with

    yaw' = v tan(steering) / L                         (Rajamani, Vehicle Dynamics and Control, 2nd ed., section 2.2)
    |steering| <= the stop, |steering'| <= the servo's rate, |tan(steering)| / L <= mu g / v^2, nothing for the delay

Minimised is the mean of |distance - wanted| over the way, by sequential linear programming (Nocedal & Wright, Numerical
Optimization, 2nd ed., section 18.5 with linear steps): along the present path the errors are linear in small changes of
the steering, |error| is the classic linear programme of least absolute deviations, all bounds are linear too, and a
trust region keeps the changes small. The answer is a path that exists, so the true limit may be lower, not higher; tyres
that need slip angle for their force can only do worse than the kinematic car.
"""

import math
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from scipy.optimize import linprog
from scipy.sparse import csr_array, eye_array, hstack, vstack

from sim.pose import Floats, Pose

GRAVITY_MPS2 = 9.81
STEP_M = 0.05
_ROUNDS = 60
_TRUST_RAD = 0.1
_GIVE_UP_RAD = 5e-4
_GUESS_AHEAD_M = 0.6


@dataclass(frozen=True, slots=True)
class Ability:
    """What the car can do. delay_s: from seeing to the wheels beginning to turn."""

    speed_mps: float
    grip_mu: float = 0.8
    wheelbase_m: float = 0.33
    max_steering_rad: float = 0.34
    steering_rate_radps: float = 3.2
    delay_s: float = 0.02

    @property
    def steering_bound_rad(self) -> float:
        """Largest angle that the stop and the grip allow."""
        by_grip_rad = math.atan(self.wheelbase_m * self.grip_mu * GRAVITY_MPS2 / self.speed_mps**2)
        return min(self.max_steering_rad, by_grip_rad)


Wall = tuple[tuple[float, float, float, float], ...]
"""The followed wall as segments (x0, y0, x1, y1)."""


@lru_cache(maxsize=256)
def least_mean_error_m(wall: Wall, start: Pose, desired_m: float, way_m: float, ability: Ability) -> float:
    """Return the least mean |error| found [m]; the distance counts from the rear axle to the nearest point."""
    problem = _Problem(np.array(wall), start, desired_m, round(way_m / STEP_M), ability)
    return min(problem.improved(guess) for guess in (problem.followed(), problem.straight()))


class _Problem:
    """One start, one wall. Steering is constant within a step of STEP_M."""

    def __init__(self, wall: Floats, start: Pose, desired_m: float, steps: int, ability: Ability) -> None:
        self._wall, self._start, self._desired_m, self._ability = wall, start, desired_m, ability
        self._n = steps
        self._bound_rad = ability.steering_bound_rad
        self._turn_rad = ability.steering_rate_radps * STEP_M / ability.speed_mps
        self._blind = min(steps, math.ceil(ability.delay_s * ability.speed_mps / STEP_M - 0.5))
        self._slew = _differences(steps)

    def straight(self) -> Floats:
        """Return the guess "do nothing"."""
        return np.zeros(self._n)

    def followed(self) -> Floats:
        """Return the guess of a simple law: steer by the error at a point ahead."""
        at, steering_rad, guess = self._start, 0.0, np.zeros(self._n)
        for k in range(self._blind, self._n):
            ahead = at.ahead(_GUESS_AHEAD_M)
            error_m, normal = self._errors(np.array([[ahead.x_m, ahead.y_m]]))
            left = -math.sin(at.yaw_rad) * normal[0, 0] + math.cos(at.yaw_rad) * normal[0, 1]
            wanted_rad = -math.copysign(2.0 * float(error_m[0]), left) if error_m[0] * left else 0.0
            wanted_rad = -2.0 * float(error_m[0]) * (1.0 if left > 0 else -1.0)
            wanted_rad = min(max(wanted_rad, -self._bound_rad), self._bound_rad)
            steering_rad = min(max(wanted_rad, steering_rad - self._turn_rad), steering_rad + self._turn_rad)
            guess[k] = steering_rad
            turn_rad = STEP_M * math.tan(steering_rad) / self._ability.wheelbase_m
            moved = Pose(at.x_m, at.y_m, at.yaw_rad + turn_rad / 2).ahead(STEP_M)
            at = Pose(moved.x_m, moved.y_m, at.yaw_rad + turn_rad)
        return guess

    def improved(self, steering_rad: Floats) -> float:
        """Return the mean error after improving a guess as long as it gets better."""
        trust_rad = _TRUST_RAD
        path = self._path(steering_rad)
        error_m, normal = self._errors(path)
        cost = float(np.abs(error_m).mean())
        for _ in range(_ROUNDS):
            change = self._best_change(steering_rad, path, error_m, normal, trust_rad)
            tried = steering_rad + change
            new_path = self._path(tried)
            new_error, new_normal = self._errors(new_path)
            new_cost = float(np.abs(new_error).mean())
            if new_cost < cost:
                gain = cost - new_cost
                steering_rad, path, error_m, normal, cost = tried, new_path, new_error, new_normal, new_cost
                trust_rad = min(2 * trust_rad, 0.3)
                if gain < 1e-5:
                    break
            else:
                trust_rad /= 3
                if trust_rad < _GIVE_UP_RAD:
                    break
        return cost

    def _path(self, steering_rad: Floats) -> Floats:
        """Return the rear axle after each step, shape (n, 2)."""
        turn_rad = STEP_M * np.tan(steering_rad) / self._ability.wheelbase_m
        middle_rad = self._start.yaw_rad + np.cumsum(turn_rad) - turn_rad / 2
        x_m = self._start.x_m + STEP_M * np.cumsum(np.cos(middle_rad))
        y_m = self._start.y_m + STEP_M * np.cumsum(np.sin(middle_rad))
        return np.column_stack([x_m, y_m])

    def _errors(self, points: Floats) -> tuple[Floats, Floats]:
        """Return the error (n,) and the direction in which it grows (n, 2)."""
        start, step = self._wall[:, :2], self._wall[:, 2:] - self._wall[:, :2]
        to_point = points[:, None, :] - start
        share = np.clip(np.sum(to_point * step, axis=2) / np.sum(step**2, axis=1), 0.0, 1.0)
        away = to_point - share[:, :, None] * step
        distance = np.hypot(away[:, :, 0], away[:, :, 1])
        nearest = distance.argmin(axis=1)
        rows = np.arange(len(points))
        distance_m = np.maximum(distance[rows, nearest], 1e-9)
        return distance_m - self._desired_m, away[rows, nearest] / distance_m[:, None]

    def _best_change(
        self, steering_rad: Floats, path: Floats, error_m: Floats, normal: Floats, trust_rad: float
    ) -> Floats:
        """Solve the linear programme: variables are the changes of steering (n,) and the sizes of the errors (n,)."""
        n, before = self._n, np.vstack([[self._start.x_m, self._start.y_m], path[:-1]])
        # A turn by one radian within step i moves all later points round the place where step i was driven.
        pivot = (before + path) / 2
        turn_per_rad = STEP_M / (self._ability.wheelbase_m * np.cos(steering_rad) ** 2)
        dx = -(path[:, None, 1] - pivot[None, :, 1]) * turn_per_rad
        dy = (path[:, None, 0] - pivot[None, :, 0]) * turn_per_rad
        slope = np.tril(normal[:, :1] * dx + normal[:, 1:] * dy)
        size = -eye_array(n)
        nothing = csr_array((n, n))
        above = vstack(
            [
                hstack([csr_array(slope), size]),
                hstack([csr_array(-slope), size]),
                hstack([self._slew, nothing]),
                hstack([-self._slew, nothing]),
            ]
        )
        turned = self._slew @ steering_rad
        below = np.concatenate([-error_m, error_m, self._turn_rad - turned, self._turn_rad + turned])
        low = np.maximum(-trust_rad, -self._bound_rad - steering_rad)
        high = np.minimum(trust_rad, self._bound_rad - steering_rad)
        low[: self._blind] = high[: self._blind] = 0.0
        bounds = np.vstack([np.column_stack([low, high]), np.tile([0.0, np.inf], (n, 1))])
        answer = linprog(np.repeat([0.0, 1.0], n), A_ub=above, b_ub=np.maximum(below, -1e9), bounds=bounds, method="highs")
        if answer.x is None:
            return np.zeros(n)
        change: Floats = answer.x[:n]
        return change


def _differences(n: int) -> csr_array:
    """The matrix that takes steering to its change from step to step; before the first one it was 0."""
    return csr_array(eye_array(n) - eye_array(n, k=-1))
