"""Car model of the safety layer: outlines with and without margins, grip of the floors, and braking on them."""

import math
from dataclasses import replace

from wallride.runtime.control.perception.geometry import Booleans, Places
from wallride.runtime.control.safety.footprint import NOTHING, Contact, Outline
from wallride.runtime.control.safety.stopping import speed_to_stop_within_mps, stopping_distance_m
from wallride.runtime.control.safety.swept_settings import SweptSettings
from wallride.runtime.control.vehicle import GRAVITY_MPS2, CarSettings

LOOK_SPARE_M = 0.25
SPEED_STEP_MPS = 0.25
"""Step to which speeds are rounded up for the look-ahead, so that a slowly rising command reuses the cached sweep."""
GRADED_SPARE_M = 0.10


class Body:
    """Outlines bare, with margins forward, with margins backward; the grip of a good floor and of a slippery one."""

    def __init__(self, settings: SweptSettings, car: CarSettings) -> None:
        self.settings = settings
        self.car = car
        wide_m, spare_m = car.half_width_m + settings.side_margin_m, settings.front_margin_m
        self.bare = Outline(car.front_m, car.rear_m, car.half_width_m)
        self.ahead = Outline(car.front_m + spare_m, car.rear_m, wide_m)
        self.wary = replace(self.ahead, half_width_m=wide_m + settings.wary_margin_m)
        self.aback = Outline(car.front_m, car.rear_m + spare_m, wide_m)
        beyond_m = max(self.ahead.front_m - car.lidar_x_m, self.aback.rear_m + car.lidar_x_m)
        self.reach_m = math.hypot(beyond_m, wide_m + abs(car.lidar_y_m))
        """Maximum distance from the lidar of a point within the margins."""
        self.grip_mps2 = settings.grip_mu * GRAVITY_MPS2
        self.slippery_mps2 = min(settings.slippery_mu, settings.grip_mu) * GRAVITY_MPS2
        self.around = replace(self.ahead, rear_m=self.aback.rear_m)

    def presses(self, points_m: Places) -> Booleans:
        """Return which points are within the margins, forward or backward, now."""
        return self.around.holds(points_m)

    def grip_for_mps2(self, found: Contact) -> float:
        """Return the grip of the floor for which this contact was found."""
        return self.slippery_mps2 if found.slippery else self.grip_mps2

    def graded_mps(self, found: Contact, reaction_s: float) -> float:
        """Return the graded limit: the speed from which gentle braking stops ten centimetres before the contact."""
        if found is NOTHING:
            return math.inf
        graded_mps2 = self.settings.graded_share * self.grip_for_mps2(found)
        return speed_to_stop_within_mps(found.travel_m - GRADED_SPARE_M, reaction_s, graded_mps2)

    def look_m(self, fastest_mps: float, waits_s: float = 0.0) -> float:
        """Return the look-ahead that a car at this speed needs for the graded limit.

        The scan's age is left out: a look-ahead that grows with every tick would be swept at every tick. waits_s: how
        much longer than at 40 Hz the next scan takes.
        """
        look_mps = math.ceil(fastest_mps / SPEED_STEP_MPS) * SPEED_STEP_MPS
        graded_mps2 = self.settings.graded_share * self.grip_mps2
        return stopping_distance_m(look_mps, self.settings.actuation_s + 0.05 + waits_s, graded_mps2) + LOOK_SPARE_M
