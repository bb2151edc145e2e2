"""A pose on a map and what is learnt of the car's errors: predicted by wheels and steering, corrected by each scan.

Seven states: x [m], y [m], yaw [rad] of the rear axle on the map; its turn [rad/s]; true way over reported way; the
slip of the rear axle [s2/m], which moves aside by slip * speed^2 * turn; and the angle [rad] by which the wheels turn
the car more to the left than the steering says, by trim and tyres. The turn follows the wheels as a car with inertia
does. A scan is laid over the map with the prediction as prior (`scan_on_lines`); what that moves the pose by moves the
other states with it.
"""

import math
import operator
from dataclasses import dataclass
from typing import Final

import numpy as np

from wallride.runtime.control.localization.line_field import LineField
from wallride.runtime.control.localization.scan_on_lines import Numbers, lay_on_lines
from wallride.runtime.control.localization.scan_points import ScanPoints
from wallride.runtime.control.perception.geometry import Floats

WAY_SHARE, ASIDE_SHARE, STILL_M = 0.04, 0.04, 0.002
SLIP_SHARE: Final = 1.0
STILL_RAD: Final = 0.002
"""Standard deviations of a step: shares of its way and of its slip aside, and what a standing car has."""
TURN_LAG_S: Final = 0.1
"""Time in which a car's turn follows its steering: servo, tyres and inertia."""
TURN_STD_RADPS, TURN_SHARE = 0.5, 1.0
"""Standard deviation of the turn from scan to scan of a moving car: a constant, and a share of what it changes by."""
TURN_FIRST_RADPS: Final = 1.0
"""Standard deviation of the turn of a car that was just found."""
SLIDES_SHARE: Final = 0.35
"""Standard deviation of the way while the wheels are locked, as a share of it."""
SCALE_STD, SLIP_S2PM, SLIP_STD_S2PM = 0.02, 0.028, 0.01
SCALE_WALK, SLIP_WALK_S2PM = 1e-4, 1e-4
"""Standard deviations of the car's errors at first, and by how much they change from scan to scan."""
LEAN_STD_RAD, LEAN_WALK_RAD = 0.03, 0.005
"""The same of the steering, whose error changes from bend to bend. Left out, it leans the turn, and that the slip."""
UNMOVED: Final = np.eye(7)
"""How the states move where nothing does."""


@dataclass(frozen=True, slots=True)
class WheelStep:
    """What wheels and steering say of the time since the last scan.

    way_m, speed_mps: as reported. steering_rad: of the wheels, None where it is not known: the turn goes on then.
    slides: the wheels are locked, the way is a guess.
    """

    since_s: float
    way_m: float
    speed_mps: float
    steering_rad: float | None
    slides: bool = False


@dataclass(frozen=True, slots=True)
class Fit:
    """How a scan fits the map: beams that end on a wall, in known free space before one, or where nothing can be seen.

    determined: the ratio of the information in the two directions; below WEAK_SHARE the wheels have the weaker one.
    """

    on_wall: int
    before: int
    beyond: int
    determined: float

    @property
    def share(self) -> float:
        """Return the share of beams on a wall: one that ends before it, at a person, counts half, NaN without beams."""
        told = self.on_wall + 0.5 * self.before + self.beyond
        return self.on_wall / told if told else math.nan


class PoseFilter:
    """The pose of the rear axle on a map, `state` (7,) with its `covariance` (7, 7)."""

    def __init__(self, field: LineField, wheelbase_m: float, scale: float = 1.0) -> None:
        self._field = field
        self._wheelbase_m = wheelbase_m
        self.state = np.array([0.0, 0.0, 0.0, 0.0, scale, SLIP_S2PM, 0.0])
        self.covariance = np.diag([0.0, 0.0, 0.0, 0.0, SCALE_STD**2, SLIP_STD_S2PM**2, LEAN_STD_RAD**2])

    @property
    def scale(self) -> float:
        """Return the true way over the reported one."""
        return float(self.state[4])

    def place(self, x_m: float, y_m: float, yaw_rad: float, std_m: float, std_rad: float) -> None:
        """Set the pose down somewhere; what is known of the car's errors remains."""
        self.state[:4] = x_m, y_m, yaw_rad, 0.0
        errors = np.diag(self.covariance)[4:]
        self.covariance = np.diag([std_m**2, std_m**2, std_rad**2, TURN_FIRST_RADPS**2, *errors])

    def speeds(self, step: WheelStep) -> tuple[float, float, float]:
        """Return the speed ahead [m/s], the one to the left, and the turn [rad/s] that are expected of a step."""
        _, turn_radps, scale, slip, _ = self.state[2:].tolist()
        ahead_mps = scale * step.speed_mps
        asked_radps, follows = self._asked(step)
        turn_radps += 0.5 * follows * (asked_radps - turn_radps)
        return ahead_mps, -slip * ahead_mps**2 * turn_radps, turn_radps

    def _asked(self, step: WheelStep) -> tuple[float, float]:
        """Return the turn that the steering asks for [rad/s], and by which share the car follows within the step."""
        if step.steering_rad is None:
            return float(self.state[3]), 0.0
        steering_rad = step.steering_rad + float(self.state[6])
        asked_radps = float(self.state[4]) * step.speed_mps * math.tan(steering_rad) / self._wheelbase_m
        return asked_radps, 1.0 - math.exp(-step.since_s / TURN_LAG_S)

    def predict(self, step: WheelStep) -> None:
        """Move the pose by what wheels and steering say."""
        yaw_rad, turn_radps, scale, slip, _ = self.state[2:].tolist()
        asked_radps, follows = self._asked(step)
        change_radps = follows * (asked_radps - turn_radps)
        way_m, speed2 = scale * step.way_m, (scale * step.speed_mps) ** 2
        turn_rad = (turn_radps + 0.5 * change_radps) * step.since_s
        aside_m = -slip * speed2 * turn_rad
        cos, sin = math.cos(yaw_rad + 0.5 * turn_rad), math.sin(yaw_rad + 0.5 * turn_rad)
        dx_m, dy_m = cos * way_m - sin * aside_m, sin * way_m + cos * aside_m
        self.state[:4] += (dx_m, dy_m, turn_rad, change_radps)
        by_turn = (1.0 - 0.5 * follows) * step.since_s
        by_lean = follows * scale * step.speed_mps / self._wheelbase_m
        moves = UNMOVED.copy()
        moves[0, 2], moves[1, 2] = -dy_m, dx_m
        moves[0, 3], moves[1, 3], moves[2, 3] = -0.5 * by_turn * dy_m, 0.5 * by_turn * dx_m, by_turn
        moves[3, 3], moves[2, 6], moves[3, 6] = 1.0 - follows, 0.5 * by_lean * step.since_s, by_lean
        moves[0, 4], moves[1, 4] = dx_m / scale, dy_m / scale
        moves[0, 5], moves[1, 5] = sin * speed2 * turn_rad, -cos * speed2 * turn_rad
        self.covariance = moves @ self.covariance @ moves.T
        self._blur(step, way_m, change_radps, complex(cos, sin), aside_m)

    def _blur(self, step: WheelStep, way_m: float, change_radps: float, ahead: complex, slide_m: float) -> None:
        """Add what a step leaves open: along the way, aside, in heading and turn."""
        covariance, cos, sin = self.covariance, ahead.real, ahead.imag
        along = ((SLIDES_SHARE if step.slides else WAY_SHARE) * way_m) ** 2 + STILL_M**2
        aside = (ASIDE_SHARE * way_m) ** 2 + (SLIP_SHARE * slide_m) ** 2 + STILL_M**2
        covariance[0, 0] += cos * cos * along + sin * sin * aside
        covariance[1, 1] += sin * sin * along + cos * cos * aside
        covariance[0, 1] += cos * sin * (along - aside)
        covariance[1, 0] += cos * sin * (along - aside)
        covariance[2, 2] += STILL_RAD**2
        if step.way_m:
            covariance[3, 3] += TURN_STD_RADPS**2 + (TURN_SHARE * change_radps) ** 2
            covariance[4, 4] += SCALE_WALK**2
            covariance[5, 5] += SLIP_WALK_S2PM**2
            covariance[6, 6] += LEAN_WALK_RAD**2

    def correct(self, points: ScanPoints) -> Fit:
        """Lay a scan over the map, and return how it fits."""
        before = tuple(self.covariance[:3, :3].ravel().tolist())
        prior = inverse(before)
        pose = tuple(self.state[:3].tolist())
        moved, information, counts, determined = lay_on_lines(self._field, points, pose, before, prior)
        after = inverse(tuple(map(operator.add, prior, information)))
        self._take(np.array(moved), np.reshape(prior, (3, 3)), np.reshape(after, (3, 3)))
        return Fit(*counts, points.places_m.size - sum(counts), determined)

    def _take(self, move: Floats, prior: Floats, after: Floats) -> None:
        """Move all states by what a scan has moved the pose by, and leave the pose the covariance `after`."""
        gain = self.covariance[:, :3] @ prior
        self.state += gain @ move
        self.state[2] = math.remainder(self.state[2], math.tau)
        before = self.covariance[:3, :3]
        left = self.covariance - gain @ (before - after) @ gain.T
        self.covariance = 0.5 * (left + left.T)  # rounding grows from scan to scan where both halves may differ


def inverse(matrix: Numbers) -> Numbers:
    """Return the inverse of a matrix, both (9,) by rows: by its cofactors, in a tenth of numpy's time."""
    a, b, c, d, e, f, g, h, i = matrix
    first, second, third = e * i - f * h, f * g - d * i, d * h - e * g
    per = 1.0 / (a * first + b * second + c * third)
    return (
        per * first, per * (c * h - b * i), per * (b * f - c * e),
        per * second, per * (a * i - c * g), per * (c * d - a * f),
        per * third, per * (b * g - a * h), per * (a * e - b * d),
    )  # fmt: skip
