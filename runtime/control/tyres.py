"""How far the axles slip aside in a bend, and what a steering angle turns the car by: one saturating tyre an axle."""

import cmath
import math
from dataclasses import replace
from typing import Final

from wallride.drivers.value import value
from wallride.runtime.control.vehicle import GRAVITY_MPS2

MOST_SHARE: Final = 0.97
"""Share of the grip above which a tyre slips without end."""

HEIGHT_SHARE: Final = 0.22
"""Height of the centre of gravity over the wheelbase, of F1TENTH cars: what a pull along moves of the load."""
MOST_PULL: Final = 0.5
"""Largest pull along that counts, as a share of the grip."""

MOST_OTHER: Final = 1.7
"""Largest ratio of the observed stiffness of tyres and the assumed one, either way."""
SLIPPERY: Final = (1.08, 1.18)
"""Ratios of the observed slip and the assumed one from which the floor has less grip, and from which it has all that
much less: with grip and tyres as assumed, noise has made up to 1.14."""

SLOWEST_MPS: Final = 1.0
"""Speed for rates and gains below it: at a standstill they would be infinite."""

LEAST_SLOWING, IN_BEND = 0.3, 0.6
"""Share of the grip by which a car may always slow down, of the grip aside it takes 5 %; and the share that a bend has
to take before it leaves less than a motor controller brakes with."""
OBEYS_S: Final = 0.08
"""Time in which the wheels follow the set speed."""

TURN_LAG_S: Final = 0.1
"""Time in which the turn follows the wheels: servo, tyres and inertia."""


@value()
class Tyres:
    """The tyres of a car as a single track.

    wheelbase_m: between the axles. mu: friction of the floor. front_per_rad, rear_per_rad: lateral force by slip angle,
    as a multiple of mu times the load. front_load, rear_load: of the axles over that at rest.
    """

    wheelbase_m: float
    mu: float
    front_per_rad: float
    rear_per_rad: float
    front_load: float = 1.0
    rear_load: float = 1.0

    @property
    def slip_s2pm(self) -> float:
        """Return the way aside of the rear axle over speed^2 * turn, by its stiffness alone."""
        return 1.0 / (self.mu * GRAVITY_MPS2 * self.rear_per_rad)

    def slipping(self, slip_s2pm: float) -> "Tyres":
        """Return tyres whose rear axle moves aside by slip * speed^2 * turn, as it was observed; the front alike."""
        share = self.slip_s2pm / max(slip_s2pm, 1e-3)
        share = min(max(share, 1.0 / MOST_OTHER), MOST_OTHER)
        return Tyres(self.wheelbase_m, self.mu, share * self.front_per_rad, share * self.rear_per_rad)

    def floor_mu(self, slip_s2pm: float) -> float:
        """Return the friction of the floor by the slip that was observed; as assumed, where that explains it."""
        ratio = slip_s2pm / self.slip_s2pm
        believed = min(max((ratio - SLIPPERY[0]) / (SLIPPERY[1] - SLIPPERY[0]), 0.0), 1.0)
        return self.mu / (1.0 + believed * (ratio - 1.0))

    def pulling(self, ahead_mps2: float) -> "Tyres":
        """Return tyres that speed the car up or slow it down: with less grip aside, and other loads."""
        most_mps2 = MOST_PULL * self.mu * GRAVITY_MPS2
        pull_mps2 = min(max(ahead_mps2, -most_mps2), most_mps2)
        aside = math.sqrt(1.0 - (pull_mps2 / (self.mu * GRAVITY_MPS2)) ** 2)
        moved = 2.0 * HEIGHT_SHARE * pull_mps2 / GRAVITY_MPS2
        return replace(self, front_load=aside * (1.0 - moved), rear_load=aside * (1.0 + moved))

    def slip_growth(self, lateral_mps2: float) -> float:
        """Return the slip of an axle over that by its stiffness alone: 1 where little of the grip is used."""
        used = min(abs(lateral_mps2) / (self.mu * GRAVITY_MPS2), MOST_SHARE)
        return float((1.0 - used**4) ** -0.25)

    def settles_radps(self, speed_mps: float) -> float:
        """Return how fast a slip of the rear axle dies away: slower with soft tyres, and the faster the car."""
        return self.mu * GRAVITY_MPS2 * self.rear_per_rad / max(speed_mps, SLOWEST_MPS)

    def most_radpm(self, speed_mps: float) -> float:
        """Return the tightest bend that the grip allows."""
        return MOST_SHARE * self.mu * GRAVITY_MPS2 / max(speed_mps, SLOWEST_MPS) ** 2

    def rear_slip_rad(self, lateral_mps2: float) -> float:
        """Return the angle by which the rear axle's way points outward from the car's heading, in a steady bend."""
        return slip_rad(lateral_mps2 / self.rear_load, self.rear_per_rad, self.mu)

    def understeer_rad(self, lateral_mps2: float) -> float:
        """Return by how much more than without slip the wheels have to be steered in a steady bend."""
        front_rad = slip_rad(lateral_mps2 / self.front_load, self.front_per_rad, self.mu)
        return front_rad - self.rear_slip_rad(lateral_mps2)

    def steering_rad(self, curvature_radpm: float, speed_mps: float) -> float:
        """Return the angle of the wheels for a bend."""
        return math.atan(self.wheelbase_m * curvature_radpm) + self.understeer_rad(speed_mps**2 * curvature_radpm)

    def turn_radps(self, steering_rad: float, speed_mps: float, turning_radps: float) -> float:
        """Return the turn that the wheels ask for. turning_radps: the present one, which tells how far they slip."""
        rolls_rad = steering_rad - self.understeer_rad(speed_mps * turning_radps)
        return speed_mps * math.tan(min(max(rolls_rad, -1.0), 1.0)) / self.wheelbase_m


@value()
class Moving:
    """A car that drives. place_m: rear axle, x + iy. trim_rad: angle of the wheels that are told to be straight."""

    place_m: complex
    yaw_rad: float
    speed_mps: float
    turn_radps: float
    trim_rad: float = 0.0

    def slipped_rad(self, before_rad: float, since_s: float, tyres: Tyres) -> float:
        """Return the slip of the rear axle, which follows a change of the turn with a lag. before_rad: earlier."""
        follows = 1.0 - math.exp(-since_s * tyres.settles_radps(self.speed_mps))
        return before_rad + follows * (tyres.rear_slip_rad(self.speed_mps * self.turn_radps) - before_rad)

    def later(self, in_s: float, steering_rad: float, tyres: Tyres) -> "Moving":
        """Return the car after a time. steering_rad: the angle that the wheels were told last."""
        asked_radps = tyres.turn_radps(steering_rad + self.trim_rad, self.speed_mps, self.turn_radps)
        change_radps = (1.0 - math.exp(-in_s / TURN_LAG_S)) * (asked_radps - self.turn_radps)
        turned_rad = (self.turn_radps + 0.5 * change_radps) * in_s
        slip_rad = tyres.rear_slip_rad(self.speed_mps * self.turn_radps)
        way = cmath.exp(1j * (self.yaw_rad + 0.5 * turned_rad - slip_rad))
        return Moving(
            self.place_m + self.speed_mps * in_s * way, self.yaw_rad + turned_rad, self.speed_mps,
            self.turn_radps + change_radps, self.trim_rad,
        )  # fmt: skip


def eased_mps(speed_mps: float, lateral_mps2: float, grip_mps2: float) -> float:
    """Return the lowest set speed for a car in a bend: braked by more than that leaves it spins. -inf on a straight."""
    used = abs(lateral_mps2) / grip_mps2
    left = max(LEAST_SLOWING, math.sqrt(1.0 - min(1.0, used) ** 2)) if used >= IN_BEND else math.inf
    return speed_mps - OBEYS_S * left * grip_mps2


def slip_rad(lateral_mps2: float, cornering_per_rad: float, mu: float) -> float:
    """Return the slip angle of an axle whose force saturates at the grip: z / (1 + z^4)^(1/4), solved for z."""
    used = min(abs(lateral_mps2) / (mu * GRAVITY_MPS2), MOST_SHARE)
    return math.copysign(used / (1.0 - used**4) ** 0.25 / cornering_per_rad, lateral_mps2)
