"""Safety `swept`: may the car do what it is about to be told? Judged for that very drive, whoever gave it.

The outline is swept along the arc that will be driven (`footprint`); the way to the first contact is compared with
what stopping takes (`stopping`). Two limits: a graded one, which brakes gently and early, and a hard stop, which is
held for a moment. Section 5 of the project's control reference compares this with the alternatives.
"""

import math
from dataclasses import dataclass, field, replace

import numpy as np

from drivers.api import Clock, MotorState, Scan
from runtime.car_settings import CarSettings
from runtime.command import NO_LIMIT_MPS, Verdict
from runtime.control.behind import Behind
from runtime.control.footprint import ENOUGH_POINTS, NOTHING, Contact, Motion, Outline, Path, arc, first_contact
from runtime.control.geometry import Floats
from runtime.control.lidar_health import LidarHealth
from runtime.control.lidar_health_settings import LidarHealthSettings
from runtime.control.odometry import Odometry
from runtime.control.perception import Eyes, View
from runtime.control.stopping import (
    GRAVITY_MPS2,
    SlidingSpeed,
    brake_beside_turning_mps2,
    grip_curvature_per_m,
    speed_to_stop_within_mps,
    stopping_distance_m,
)
from runtime.control.swept_settings import SweptSettings

STANDING_MPS = 0.05
LOOK_SPARE_M = 0.25
SPEED_STEP_MPS = 0.25
"""Speeds are rounded up to this for the length of the look, so that a slowly rising wish is not swept anew."""
STOP_SPARE_M = 0.05
GRADED_SPARE_M = 0.10
NOSE_ON_M = 0.12
"""Less way than this is none: the graded limit is 0."""
OTHER_STEERINGS = (0.0, 0.5, -0.5, 1.0, -1.0)
FREE_WAY_M = 0.5
DARK_SHARE = 0.3
DARK_WINDOW_RAD = math.radians(10)


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
        self.clock = clock
        self.health = LidarHealth(health or LidarHealthSettings(), car.wheelbase_m, settings.doubtful_mps)
        self.behind = Behind(car.lidar_x_m)
        self.brake = _Brake()
        self.grip_mps2 = settings.grip_mu * GRAVITY_MPS2
        self.bare = Outline(car.front_m, car.rear_m, car.half_width_m)
        self.ahead = Outline(
            car.front_m + settings.front_margin_m, car.rear_m, car.half_width_m + settings.side_margin_m
        )
        self.aback = Outline(
            car.front_m, car.rear_m + settings.front_margin_m, car.half_width_m + settings.side_margin_m
        )
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
        return Outlook(self, view, speed_mps, wheel_rad)


@dataclass(slots=True, eq=False)
class Outlook:
    """One scan's answer to every drive. Cheap to ask again: sweeps are kept by steering, direction and length."""

    guard: SweptGuard
    view: View
    speed_mps: float
    wheel_rad: float
    _kept: dict[tuple[float, float, float], Contact] = field(default_factory=dict)
    _near_m: tuple[Floats, Floats] | None = None
    _hidden_m: Floats | None = None

    @property
    def age_s(self) -> float:
        """How old the scan is now, as well as can be known."""
        scan = self.view.scan
        now_s = self.guard.clock() if self.guard.clock is not None else scan.received_s
        return max(0.0, now_s - scan.stamp_s)

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

    def contact(self, steering_rad: float, length_m: float, direction: float = 1.0) -> Contact:
        """Return what the outline meets first on the way that this steering leads to."""
        key = (round(steering_rad, 3), length_m, direction)
        found = self._kept.get(key)
        if found is None:
            found = self._kept[key] = self._sweep(steering_rad, length_m, direction)
        return found

    def free_somewhere(self, length_m: float = FREE_WAY_M) -> bool:
        """Whether any steering leads the standing car so far ahead without a contact."""
        most_rad = self.guard.car.max_steering_rad
        return any(self.contact(share * most_rad, length_m).travel_m >= length_m for share in OTHER_STEERINGS)

    def _ceiling(self) -> Verdict:
        """What holds whatever is asked: the scan's age and the window."""
        settings, health, age_s = self.guard.settings, self.guard.health, self.age_s
        if age_s > settings.stale_s:
            return Verdict(0.0, 0.0, "the scan is too old", age_s)
        if health.ceiling_mps < settings.doubtful_mps or age_s <= settings.late_s:
            return Verdict(health.ceiling_mps, health.ceiling_mps, health.reason)
        return Verdict(settings.doubtful_mps, settings.doubtful_mps, "the scan is late", age_s)

    def _forward(self, wanted_mps: float, steering_rad: float) -> Verdict:
        guard, settings = self.guard, self.guard.settings
        speed_mps = max(self.speed_mps, 0.0)
        reaction_s = self.age_s + settings.actuation_s
        graded_mps2 = settings.graded_share * guard.grip_mps2
        look_mps = math.ceil(max(speed_mps, wanted_mps) / SPEED_STEP_MPS) * SPEED_STEP_MPS
        # The age is left out of the length: a look that grows with every tick would be swept at every tick.
        look_m = stopping_distance_m(look_mps, settings.actuation_s + 0.05, graded_mps2) + LOOK_SPARE_M
        found = self.contact(steering_rad, look_m)
        hard_m = STOP_SPARE_M + stopping_distance_m(speed_mps, reaction_s, settings.hard_share * guard.grip_mps2)
        if self._brakes(found.travel_m, hard_m, speed_mps):
            return self._hard(found, steering_rad, speed_mps)
        if found.travel_m > look_m:
            return self._into_the_dark(steering_rad, look_m)
        graded_mps = speed_to_stop_within_mps(found.travel_m - GRADED_SPARE_M, reaction_s, graded_mps2)
        where = "beside" if found.side else "ahead"
        if graded_mps >= settings.slowest_mps and found.travel_m >= NOSE_ON_M:
            return Verdict(graded_mps, NO_LIMIT_MPS, f"slower: wall {where}", found.travel_m)
        creep_m = STOP_SPARE_M + stopping_distance_m(
            settings.creep_mps, reaction_s, settings.hard_share * guard.grip_mps2
        )
        if found.travel_m > creep_m and self.free_somewhere():
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
        if found.side * steering_rad < 0 and self._grazes(steering_rad, found.travel_m):
            brake_mps2 = brake_beside_turning_mps2(speed_mps, found.curvature_per_m, self.guard.grip_mps2)
            return Verdict(0.0, NO_LIMIT_MPS, "braking: wall beside", found.travel_m, brake_mps2)
        return Verdict(0.0, NO_LIMIT_MPS, "braking: wall ahead", found.travel_m)

    def _grazes(self, steering_rad: float, way_m: float) -> bool:
        """Whether the car itself, without margins, gets past on this arc."""
        path = self._path(steering_rad, way_m + self.guard.car.front_m + LOOK_SPARE_M, 1.0)
        return first_contact(path, self.guard.bare, np.hstack(self._points_m())) == NOTHING

    def _standing(self, found: Contact) -> Verdict:
        reason = "wall ahead" if self.free_somewhere() else "boxed in"
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
        brake_mps2 = settings.graded_share * self.guard.grip_mps2
        look_m = stopping_distance_m(settings.reverse_mps, reaction_s, brake_mps2) + LOOK_SPARE_M
        found = self.contact(steering_rad, round(look_m, 2), -1.0)
        # The last centimetres may be used: nobody's nose is there, and the way out may be short.
        way_m = min(found.travel_m, left_m)
        allowed_mps = speed_to_stop_within_mps(way_m, reaction_s, brake_mps2)
        if allowed_mps < settings.slowest_mps:
            reason = "wall behind" if found.travel_m <= left_m else "backed far enough without seeing"
            return Verdict(NO_LIMIT_MPS, 0.0, reason, max(0.0, way_m))
        return Verdict(NO_LIMIT_MPS, min(allowed_mps, settings.reverse_mps), "backing slowly", found.travel_m)

    def _sweep(self, steering_rad: float, length_m: float, direction: float) -> Contact:
        guard = self.guard
        path = self._path(steering_rad, length_m, direction)
        free_m, touching_m = self._points_m()
        if direction < 0:
            free_m = np.hstack([free_m, self._points_behind_m()])
        outline = guard.ahead if direction > 0 else guard.aback
        if touching_m.shape[1]:
            outline = replace(outline, half_width_m=self._room_aside_m(touching_m, outline))
        found = first_contact(path, outline, free_m, direction)
        if touching_m.shape[1]:
            # What is within the margins already would stop the car for ever: it is judged by the bare outline.
            pressed = first_contact(path, guard.bare, touching_m, direction)
            found = min(found, pressed, key=lambda contact: contact.travel_m)
        return found if found.travel_m <= length_m else NOTHING

    def _room_aside_m(self, touching_m: Floats, outline: Outline) -> float:
        """Return the half width of the strip beside something within the margin: a wall there goes on ahead.

        It keeps half of what room there is; without this a car two centimetres from a wall never moves along it.
        """
        aside_m = np.abs(touching_m[1])
        aside_m = aside_m[aside_m > self.guard.bare.half_width_m]
        if aside_m.size < ENOUGH_POINTS:
            return outline.half_width_m
        third_m = float(np.partition(aside_m, ENOUGH_POINTS - 1)[ENOUGH_POINTS - 1])
        return (self.guard.bare.half_width_m + third_m) / 2

    def _path(self, steering_rad: float, length_m: float, direction: float) -> Path:
        guard = self.guard
        speed_mps = max(0.0, direction * self.speed_mps)
        grip_per_m = grip_curvature_per_m(speed_mps, guard.grip_mps2)
        latency_s = self.age_s + guard.settings.actuation_s
        car = guard.car
        motion = Motion(
            speed_mps, direction, self.wheel_rad, latency_s, car.steering_rate_radps, car.wheelbase_m, grip_per_m
        )
        return arc(motion, steering_rad, length_m)

    def _points_m(self) -> tuple[Floats, Floats]:
        """Return the solid points outside and inside the margins, (2, k) each."""
        if self._near_m is None:
            view, ahead, aback = self.view, self.guard.ahead, self.guard.aback
            points = np.stack([view.x_m[view.solid], view.y_m[view.solid]])
            inside = (points[0] <= ahead.front_m) & (points[0] >= -aback.rear_m)
            inside &= np.abs(points[1]) <= ahead.half_width_m
            self._near_m = (points[:, ~inside], points[:, inside]) if inside.any() else (points, points[:, :0])
        return self._near_m

    def points_around_m(self, within_m: float) -> Floats:
        """Return everything seen and remembered within a distance of the rear axle, (2, k), base_link."""
        points = np.hstack([*self._points_m(), self._points_behind_m()])
        return points[:, np.hypot(points[0], points[1]) < within_m]

    def _points_behind_m(self) -> Floats:
        if self._hidden_m is None:
            half_view_rad = float(np.abs(self.view.bearing_rad[[0, -1]]).min())
            self._hidden_m = self.guard.behind.points_m(half_view_rad)
        return self._hidden_m


def enclosed_dark(view: View, toward_rad: float, near_m: float) -> bool:
    """Whether more than 30 % of the beams around a bearing have no echo, with things nearer than near_m on both sides.

    No echo is no information. But in real corridors and halls the far end rarely answers (6 to 64 % of all beams): dark
    between walls that are seen far beyond the stopping distance is depth; dark that begins and ends near is a window, a
    black box or a blinded lidar.
    """
    step_rad = view.scan.angle_step_rad
    middle = round((toward_rad - view.scan.angle_min_rad) / step_rad)
    width = round(DARK_WINDOW_RAD / abs(step_rad))
    first, last = max(0, middle - width), min(view.no_echo.size, middle + width + 1)
    window = view.no_echo[first:last]
    if not window.size or np.count_nonzero(window) <= DARK_SHARE * window.size:
        return False
    dark = np.flatnonzero(window) + first
    right = np.flatnonzero(view.solid[: dark[0]])
    left = np.flatnonzero(view.solid[dark[-1] + 1 :]) + dark[-1] + 1
    if not right.size or not left.size:
        return False
    return bool(max(view.ranges_m[right[-1]], view.ranges_m[left[0]]) < near_m)
