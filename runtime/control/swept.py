"""Safety `swept`: may the car do what it is about to be told? Judged for that very drive, whoever gave it.

The outline is swept along the arc that will be driven (`footprint`); the way to the first contact is compared with
what stopping takes (`stopping`). Two limits: a graded one, which brakes gently and early, and a hard stop, which is
held for a moment. Section 5 of the project's control reference compares this with the alternatives.
"""

import math
from dataclasses import dataclass

from drivers.api import Clock, MotorState, Scan
from runtime.car_settings import CarSettings
from runtime.command import NO_LIMIT_MPS, Verdict
from runtime.control.behind import Behind
from runtime.control.darkness import enclosed_dark
from runtime.control.footprint import Contact
from runtime.control.lidar_health import LidarHealth
from runtime.control.lidar_health_settings import LidarHealthSettings
from runtime.control.movers import Movers
from runtime.control.odometry import Odometry
from runtime.control.perception import Eyes, View
from runtime.control.stopping import (
    GRAVITY_MPS2,
    SlidingSpeed,
    brake_beside_turning_mps2,
    speed_to_stop_within_mps,
    stopping_distance_m,
)
from runtime.control.strip import LOOK_SPARE_M, Body, Strip
from runtime.control.swept_settings import SweptSettings

STANDING_MPS = 0.05
TURNING_SHARE = 0.3
"""A bend that takes more than this of the grip is braked with what it leaves: locked wheels go straight on."""
SPEED_STEP_MPS = 0.25
"""Speeds are rounded up to this for the length of the look, so that a slowly rising wish is not swept anew."""
STOP_SPARE_M = 0.05
GRADED_SPARE_M = 0.10


@dataclass(slots=True)
class _Brake:
    """The one thing that safety remembers about its own words: a hard stop is on."""

    until_s: float = -math.inf
    on: bool = False


class SweptGuard:
    """Looks at every scan once; the Outlook that it returns judges drives until the next scan.

    clock: where given, the scan's age is measured at every judgement, else taken as it was when the scan came.
    health: what is known about the lidar's window.
    """

    def __init__(
        self,
        settings: SweptSettings,
        car: CarSettings,
        eyes: Eyes,
        *,
        health: LidarHealthSettings | None = None,
        clock: Clock | None = None,
    ) -> None:
        self.settings = settings
        self.car = car
        self.body = Body(settings, car)
        self.clock = clock
        self.health = LidarHealth(health or LidarHealthSettings(), car.wheelbase_m, settings.doubtful_mps)
        self.behind = Behind(car.lidar_x_m)
        self.movers = Movers()
        self.brake = _Brake()
        self._eyes = eyes
        self._odometry = Odometry(car.wheelbase_m)
        self._speed = SlidingSpeed(GRAVITY_MPS2)
        self._last_m: float | None = None

    def look(self, scan: Scan, motor: MotorState | None) -> "Outlook":
        """Take in one scan; called once for each, in order."""
        view = self._eyes.see(scan)
        speed_mps = self._speed.update(motor.speed_mps if motor is not None else None, scan.stamp_s)
        pose = self._odometry.update(motor)
        last_m, self._last_m = self._last_m, motor.distance_m if motor is not None else None
        step_m = motor.distance_m - last_m if motor is not None and last_m is not None else 0.0
        self.behind.update(view, pose, step_m)
        self.health.update(view, motor)
        self._eyes.ignore(self.health.mask)
        most_rad = self.car.max_steering_rad
        wheel_rad = min(max(motor.steering_rad, -most_rad), most_rad) if motor is not None else 0.0
        walkers_m = self.movers.update(view, pose, scan.stamp_s)
        latency_s = max(0.0, self.now_s(scan) - scan.stamp_s) + self.settings.actuation_s
        strip = Strip(self.body, view, speed_mps, wheel_rad, latency_s, walkers_m, self.behind)
        return Outlook(self, view, speed_mps, strip)

    def now_s(self, scan: Scan) -> float:
        """Return the time, or that of the scan's arrival where there is no clock."""
        return self.clock() if self.clock is not None else scan.received_s


@dataclass(slots=True, eq=False)
class Outlook:
    """One scan's answer to every drive. Cheap to ask again: the strip keeps its sweeps."""

    guard: SweptGuard
    view: View
    speed_mps: float
    strip: Strip

    @property
    def age_s(self) -> float:
        """How old the scan is now, as well as can be known."""
        return max(0.0, self.guard.now_s(self.view.scan) - self.view.scan.stamp_s)

    def limit(self, speed_mps: float, steering_rad: float) -> Verdict:
        """Judge a drive; nonsense and standstill are never a reason to move."""
        ceiling = self._ceiling()
        if ceiling.forward_mps <= 0 or not speed_mps or not math.isfinite(speed_mps + steering_rad):
            return ceiling
        most_rad = self.guard.car.max_steering_rad
        steering_rad = min(max(steering_rad, -most_rad), most_rad)
        verdict = self._forward(speed_mps, steering_rad) if speed_mps > 0 else self._backward(steering_rad)
        if speed_mps > 0:
            return verdict if verdict.forward_mps <= ceiling.forward_mps else ceiling
        return verdict if verdict.reverse_mps <= ceiling.reverse_mps else ceiling

    def _ceiling(self) -> Verdict:
        """What holds whatever is asked: the scan's age and the window."""
        settings, health, age_s = self.guard.settings, self.guard.health, self.age_s
        if age_s > settings.stale_s:
            return Verdict(0.0, 0.0, "the scan is too old", age_s)
        if health.ceiling_mps < settings.doubtful_mps or age_s <= settings.late_s:
            return Verdict(health.ceiling_mps, health.ceiling_mps, health.reason)
        return Verdict(settings.doubtful_mps, settings.doubtful_mps, "the scan is late", age_s)

    def _forward(self, wanted_mps: float, steering_rad: float) -> Verdict:
        body, settings = self.guard.body, self.guard.settings
        speed_mps = max(self.speed_mps, 0.0)
        reaction_s = self.age_s + settings.actuation_s
        graded_mps2 = settings.graded_share * body.grip_mps2
        look_mps = math.ceil(max(speed_mps, wanted_mps) / SPEED_STEP_MPS) * SPEED_STEP_MPS
        # The age is left out of the length: a look that grows with every tick would be swept at every tick.
        look_m = stopping_distance_m(look_mps, settings.actuation_s + 0.05, graded_mps2) + LOOK_SPARE_M
        found = self.strip.contact(steering_rad, look_m)
        grip_mps2 = body.slippery_mps2 if found.slippery else body.grip_mps2
        hard_m = STOP_SPARE_M + stopping_distance_m(speed_mps, reaction_s, settings.hard_share * grip_mps2)
        if self._brakes(found.travel_m, hard_m, speed_mps):
            return self._hard(found, steering_rad, speed_mps)
        if found.travel_m > look_m:
            return self._into_the_dark(steering_rad, look_m)
        graded_mps = speed_to_stop_within_mps(
            found.travel_m - GRADED_SPARE_M, reaction_s, settings.graded_share * grip_mps2
        )
        where = "beside" if found.side else "ahead"
        if graded_mps >= settings.slowest_mps:
            return Verdict(graded_mps, NO_LIMIT_MPS, f"slower: wall {where}", found.travel_m)
        creep_m = STOP_SPARE_M + stopping_distance_m(
            settings.creep_mps, reaction_s, settings.hard_share * body.grip_mps2
        )
        if found.travel_m > creep_m and self.strip.free_somewhere():
            return Verdict(settings.creep_mps, NO_LIMIT_MPS, f"creeping: wall {where}", found.travel_m)
        return self._standing(found)

    def _brakes(self, way_m: float, hard_m: float, speed_mps: float) -> bool:
        """Whether a hard stop is on: begins at once, lasts a moment, ends with room to spare or at standstill."""
        brake, settings, now_s = self.guard.brake, self.guard.settings, self.view.scan.stamp_s
        if way_m < hard_m:
            brake.on = True
            brake.until_s = now_s + settings.hold_s
        elif brake.on and now_s >= brake.until_s:
            brake.on = speed_mps > STANDING_MPS and way_m < hard_m + settings.release_m
        return brake.on

    def _hard(self, found: Contact, steering_rad: float, speed_mps: float) -> Verdict:
        """Brake with all there is, unless the car turns away and only its margin will touch: grip is for that first.

        Full braking in mid-turn lets the car go straight on into the wall that it was just avoiding.
        """
        if speed_mps <= STANDING_MPS:
            return self._standing(found)
        if found.side * steering_rad < 0 and self.strip.grazes(steering_rad, found.travel_m):
            brake_mps2 = brake_beside_turning_mps2(speed_mps, found.curvature_per_m, self.guard.body.grip_mps2)
            return Verdict(0.0, NO_LIMIT_MPS, "braking: wall beside", found.travel_m, brake_mps2)
        grip_mps2 = self.guard.body.grip_mps2
        if speed_mps * speed_mps * abs(found.curvature_per_m) > TURNING_SHARE * grip_mps2:
            brake_mps2 = brake_beside_turning_mps2(speed_mps, found.curvature_per_m, grip_mps2)
            return Verdict(0.0, NO_LIMIT_MPS, "braking in a bend: wall ahead", found.travel_m, brake_mps2)
        return Verdict(0.0, NO_LIMIT_MPS, "braking: wall ahead", found.travel_m)

    def _standing(self, found: Contact) -> Verdict:
        reason = "wall ahead" if self.strip.free_somewhere() else "boxed in"
        return Verdict(0.0, NO_LIMIT_MPS, reason, found.travel_m)

    def _into_the_dark(self, steering_rad: float, look_m: float) -> Verdict:
        """No contact: consent, unless the way leads into an enclosed patch without echoes nearer than the look."""
        toward_rad = math.tan(steering_rad) / self.guard.car.wheelbase_m * look_m / 2
        if enclosed_dark(self.view, toward_rad, look_m + LOOK_SPARE_M):
            return Verdict(self.guard.settings.doubtful_mps, NO_LIMIT_MPS, "no information ahead", look_m)
        return Verdict(NO_LIMIT_MPS, NO_LIMIT_MPS, "clear")

    def _backward(self, steering_rad: float) -> Verdict:
        settings = self.guard.settings
        left_m = settings.reverse_unseen_m - self.guard.behind.backed_m
        reaction_s = self.age_s + settings.actuation_s
        brake_mps2 = settings.graded_share * self.guard.body.grip_mps2
        look_m = stopping_distance_m(settings.reverse_mps, reaction_s, brake_mps2) + LOOK_SPARE_M
        found = self.strip.contact(steering_rad, round(look_m, 2), -1.0)
        # The last centimetres may be used: nobody's nose is there, and the way out may be short.
        way_m = min(found.travel_m, left_m)
        allowed_mps = speed_to_stop_within_mps(way_m, reaction_s, brake_mps2)
        if allowed_mps < settings.slowest_mps:
            reason = "wall behind" if found.travel_m <= left_m else "backed far enough without seeing"
            return Verdict(NO_LIMIT_MPS, 0.0, reason, max(0.0, way_m))
        return Verdict(NO_LIMIT_MPS, min(allowed_mps, settings.reverse_mps), "backing slowly", found.travel_m)
