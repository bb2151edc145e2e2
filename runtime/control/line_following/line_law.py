"""Steering and speed by a race line: feed-forward with tyres, and feedback at the pose when the answer takes effect.

    k = k_line(s + T v + 0.05 m) - (2 z w / v) sin(heading error + 0.08 s * excess turn) - (w / v)^2 * lateral
    steering = atan(wheelbase * k) + front slip - rear slip - trim

The heading error is that of the rear axle's way, which points outward from the car's heading by the rear slip. The
excess turn is the car's yaw rate less that of the line, which damps the swing that the lag of the turn makes. Sources:
reference figures of the prototype; the form is that of a pole pair with frequency w and damping z over time. w is at
most mu g C / v, at which a slip of the rear axle with cornering stiffness C dies away.
"""

import math
from typing import Final

from wallride.runtime.control.line_following.race_line import CourseLine, OnLine
from wallride.runtime.control.tyres import OBEYS_S, SLOWEST_MPS, Moving, Tyres
from wallride.runtime.control.wall_following.prediction import slew_towards

FREQUENCY_RADPS, DAMPING = 6.0, 1.1
AHEAD_S, AHEAD_M, AHEAD_SETTLING = 0.06, 0.05, 0.43
"""How far ahead of the car the curvature of the line is taken, in time and in times in which a slip of the rear axle
settles, whichever is more (T above): the turn follows the wheels with a lag, on a slippery floor with a longer one."""
LEAD_S: Final = 0.08
"""How far ahead the heading is taken, by the present turn: without it the lag of the turn lets the car weave."""
BRAKES_AHEAD_S: Final = 0.10
"""How far ahead a lower speed is taken: the lag of the motor controller. A higher one is not: a car that gains speed
early leaves a bend wide."""
SERVO_S: Final = 0.02
"""Time after a scan for which the wheels still stand as they were told before the last time. Without it the law takes
what it has just told for what the wheels have done, and near the grip tells them the opposite at every scan."""
SPARE_MPS: Final = 0.03
"""The set speed may be higher by what the wheels gain in OBEYS_S, and this. With 0.15 s and 0.1 they gained twice what
a bend leaves, and a car slid whose share of the line's speed had risen in it."""
MOST_ASIDE_M: Final = 0.4
"""Largest lateral error that counts, and so the steepest way to the line (half of a right angle's sine, when slow)."""
STEEPEST: Final = 0.5


class ToldWheels:
    """What the wheels were told by the last two answers, as fast as the servo turns. rad: by the last one."""

    def __init__(self, rate_radps: float) -> None:
        self._rate_radps = rate_radps
        self._before_rad = self.rad = 0.0

    def tell(self, steering_rad: float, since_s: float) -> None:
        """Take in an answer. since_s: time since the one before."""
        self._before_rad, self.rad = self.rad, slew_towards(self.rad, steering_rad, self._rate_radps * since_s)

    def mirror(self) -> None:
        """Take left for right."""
        self._before_rad, self.rad = -self._before_rad, -self.rad

    def ahead(self, car: Moving, in_s: float, tyres: Tyres) -> Moving:
        """Return the car after a time."""
        first_s = min(in_s, SERVO_S)
        return car.later(first_s, self._before_rad, tyres).later(in_s - first_s, self.rad, tyres)


def feedback_per_m(speed_mps: float, tyres: Tyres) -> float:
    """Return the poles' frequency over the speed. Feedback that the tyres cannot follow becomes a swing, and a spin."""
    return min(FREQUENCY_RADPS, tyres.settles_radps(speed_mps)) / max(speed_mps, SLOWEST_MPS)


def heading_error_rad(car: Moving, on: OnLine, tyres: Tyres) -> float:
    """Return the heading of the rear axle's way less the line's, as it is in a steady bend of the line."""
    slip_rad = tyres.rear_slip_rad(car.speed_mps**2 * on.curvature_radpm)
    return math.remainder(car.yaw_rad - slip_rad - on.yaw_rad, math.tau)


def steering_rad(car: Moving, line: CourseLine, on: OnLine, tyres: Tyres, pulled: Tyres | None = None) -> float:
    """Return the angle to tell the wheels. car: where it is when they obey. on: the line beside it.

    pulled: the tyres at the line's own acceleration. What that changes counts for the line's bend alone: a correction
    is over before the slip has followed it.
    """
    pulled = pulled or tyres
    per_m = feedback_per_m(car.speed_mps, tyres)
    most_m = min(MOST_ASIDE_M, 2.0 * DAMPING * STEEPEST / per_m)
    ahead_s = max(AHEAD_S, AHEAD_SETTLING / tyres.settles_radps(car.speed_mps))
    curvature_radpm = line.curvature_at(on.along_m + ahead_s * car.speed_mps + AHEAD_M)
    lateral_mps2 = car.speed_mps**2 * curvature_radpm
    more_rad = pulled.understeer_rad(lateral_mps2) - tyres.understeer_rad(lateral_mps2)
    off_rad = heading_error_rad(car, on, pulled) + LEAD_S * (car.turn_radps - car.speed_mps * on.curvature_radpm)
    curvature_radpm -= 2.0 * DAMPING * per_m * math.sin(off_rad)
    curvature_radpm -= per_m**2 * min(max(on.aside_m, -most_m), most_m)
    most_radpm = tyres.most_radpm(car.speed_mps)
    curvature_radpm = min(max(curvature_radpm, -most_radpm), most_radpm)
    return tyres.steering_rad(curvature_radpm, car.speed_mps) + more_rad - car.trim_rad


def speed_mps(car: Moving, line: CourseLine, on: OnLine) -> float:
    """Return the speed of the line when the motor has obeyed."""
    return min(line.speed_at(on.along_m), line.speed_at(on.along_m + BRAKES_AHEAD_S * car.speed_mps))


def gained_mps(speed_mps: float, used: float, gains_mps2: float) -> float:
    """Return the highest speed to ask of a motor that gains no more than a bend leaves. used: share of the grip."""
    return speed_mps + OBEYS_S * gains_mps2 * math.sqrt(1.0 - min(1.0, used) ** 2) + SPARE_MPS
