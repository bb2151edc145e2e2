"""The way out for a car whose nose stands against something: back a little, steered so that the way ahead opens.

Creeping forward at any angle frees no car that touches with its margins; backing out blindly hits what is behind. So:
be patient first (people walk on), then try in thought what backing and then going forward at a few angles would lead
to, on all points seen and remembered, take the best, and let the safety judge every moment of it like any drive.
"""

import math
from collections.abc import Iterator
from dataclasses import dataclass

from drivers.api import Drive, MotorState
from runtime.control.footprint import STEP_M, Motion, Path, arc, contact_on_arc
from runtime.control.geometry import Places
from runtime.control.swept import STANDING_MPS, Outlook
from runtime.control.swept_settings import RecoverySettings

SETTLING_S = 0.3
"""The servo needs 0.2 s from one end to the other; the plan reckons with wheels that are there already."""
GIVE_UP_LEG_S = 0.5
BACKWARD_SHARES = (1.0, -1.0, 0.0)
FORWARD_SHARES = (0.0, 0.5, -0.5, 1.0, -1.0)
LOOKS_AHEAD_M = 2.0
WORTH_IT_M = 0.5
"""A manoeuvre that opens less way ahead than this is not begun."""
TURNS_OVER_M = 0.4
"""So much way, with full wheels, turns the car by 25 degrees."""
BACKING_COSTS = 0.5
REPEATING_COSTS_M = 0.7
PLANS_EVERY_S = 0.5
FREE_FOR_S = 0.25
"""Shorter than this, "free" is the lidar's noise at the edge of the margins, and patience goes on."""
ASKS_AFTER_S = 10.0
"""Who may not try anything himself waits so long for somebody to walk on before he asks for help."""
HELP = "boxed in: needs help"


@dataclass(frozen=True, slots=True)
class Advice:
    """What to do instead of the driver's wish: drive is None when there is nothing to add. words: for people."""

    drive: Drive | None
    words: str


@dataclass(frozen=True, slots=True)
class Leg:
    """A piece of a manoeuvre: a steering, and how far, negative backwards."""

    steering_rad: float
    travel_m: float


NO_ADVICE = Advice(None, "")


class Recovery:
    """Small state: since when the car is boxed in, which leg it drives, how often it has tried."""

    def __init__(self, settings: RecoverySettings) -> None:
        self._settings = settings
        self._since_s: float | None = None
        self._boxed_s = -math.inf
        self._planned_s = -math.inf
        self._tries = 0
        self._turning = False
        self._tried_at_m = 0.0
        self._legs: list[Leg] = []
        self._last: tuple[Leg, ...] = ()
        self._begun_s = 0.0
        self._begun_m = 0.0
        self._moving_s = 0.0

    def tune(self, settings: RecoverySettings) -> None:
        """Go on with other settings; a manoeuvre that is on is driven to its end."""
        self._settings = settings

    def step(self, outlook: Outlook, wish: Drive | None, motor: MotorState | None) -> Advice:
        """Answer one scan: wish is the driver's, before the safety."""
        if motor is None or wish is None or wish.speed_mps <= 0:
            self._since_s, self._legs = None, []
            return NO_ADVICE
        if self._legs:
            return self._drive_leg(outlook, motor)
        now_s = outlook.view.scan.stamp_s
        if not self._is_boxed_in(outlook, wish):
            if now_s - self._boxed_s > FREE_FOR_S or abs(outlook.speed_mps) > STANDING_MPS:
                self._since_s = None
            if motor.distance_m - self._tried_at_m > self._settings.forgotten_after_m:
                self._tries, self._turning, self._last = 0, False, ()
            return NO_ADVICE
        self._boxed_s = now_s
        if self._since_s is None:
            self._since_s = now_s
        patience_s = self._settings.boxed_for_s
        if not self._settings.tries:
            patience_s = max(patience_s, ASKS_AFTER_S)
        if now_s - self._since_s < patience_s or self._is_free(outlook, wish):
            return Advice(None, "waiting for the way to clear")
        if self._tries >= self._settings.tries and not self._turning:
            return Advice(None, HELP)
        return self._begin(outlook, motor)

    def _is_boxed_in(self, outlook: Outlook, wish: Drive) -> bool:
        """Whether the car stands and may not go ahead; what forbids both ways, a blind lidar, is no box."""
        if abs(outlook.speed_mps) > STANDING_MPS:
            return False  # and nothing is asked for a follower that perhaps is not the one who drives
        verdict = outlook.limit(wish.speed_mps, wish.steering_rad)
        return verdict.forward_mps <= 0 < verdict.reverse_mps

    def _is_free(self, outlook: Outlook, wish: Drive) -> bool:
        """Whether the way is free by now, and only a stop is still held."""
        return outlook.strip.contact(wish.steering_rad, WORTH_IT_M).travel_m >= WORTH_IT_M

    def _begin(self, outlook: Outlook, motor: MotorState) -> Advice:
        now_s = outlook.view.scan.stamp_s
        if now_s - self._planned_s < PLANS_EVERY_S:
            return Advice(None, HELP)
        self._planned_s = now_s
        legs = plan(outlook, self._settings, self._last)
        if not legs:
            return Advice(None, HELP)
        self._tries += not self._turning
        # A piece of a turn, and what comes after it, are one try; two such pieces in a row are not.
        self._turning = not self._turning and legs[1].travel_m < min(WORTH_IT_M, self._settings.forward_m)
        self._tried_at_m = motor.distance_m
        self._legs, self._last = list(legs), tuple(legs)
        self._enter_leg(now_s, motor)
        return self._drive_leg(outlook, motor)

    def _enter_leg(self, now_s: float, motor: MotorState) -> None:
        self._begun_s = self._moving_s = now_s
        self._begun_m = motor.distance_m

    def _drive_leg(self, outlook: Outlook, motor: MotorState) -> Advice:
        now_s, leg = outlook.view.scan.stamp_s, self._legs[0]
        words = f"{'backing' if leg.travel_m < 0 else 'turning'} out, try {self._tries} of {self._settings.tries}"
        if now_s - self._begun_s < SETTLING_S:
            return Advice(Drive(0.0, leg.steering_rad), words)
        speed_mps = math.copysign(self._settings.speed_mps, leg.travel_m)
        verdict = outlook.limit(speed_mps, leg.steering_rad)
        blocked = (verdict.forward_mps if speed_mps > 0 else verdict.reverse_mps) <= 0
        if not blocked:
            self._moving_s = now_s
        if abs(motor.distance_m - self._begun_m) >= abs(leg.travel_m) or now_s - self._moving_s > GIVE_UP_LEG_S:
            self._legs.pop(0)
            self._since_s = None
            if self._legs:
                self._enter_leg(now_s, motor)
            return Advice(Drive(0.0, leg.steering_rad), words)
        return Advice(Drive(speed_mps, leg.steering_rad), words)


def plan(outlook: Outlook, settings: RecoverySettings, last: tuple[Leg, ...] = ()) -> list[Leg]:
    """Return the legs of the best manoeuvre, none when nothing opens enough way.

    Worth = free way ahead afterwards - half of the way back - a malus for what was tried last. Where none is worth it,
    a piece of a three-point turn is: back and ahead with opposite wheels both turn the car the same way.
    """
    best_worth_m, best = WORTH_IT_M, list[Leg]()
    farthest_m, turning = TURNS_OVER_M, list[Leg]()
    for legs, way_m in _manoeuvres(outlook, settings):
        back, ahead = legs
        if back.steering_rad * ahead.steering_rad < 0 and ahead.travel_m - back.travel_m > farthest_m:
            farthest_m, turning = ahead.travel_m - back.travel_m, legs
        worth_m = way_m + BACKING_COSTS * min(0.0, legs[0].travel_m)
        if last and [leg.steering_rad for leg in legs] == [leg.steering_rad for leg in last]:
            worth_m -= REPEATING_COSTS_M
        if worth_m > best_worth_m:
            best_worth_m, best = worth_m, legs
    return best or turning


def _manoeuvres(outlook: Outlook, settings: RecoverySettings) -> Iterator[tuple[list[Leg], float]]:
    """Yield every manoeuvre worth a thought, with the free way ahead after backing."""
    strip = outlook.strip
    most_rad = strip.body.car.max_steering_rad
    points_m = strip.points_around_m(LOOKS_AHEAD_M + settings.back_m)
    for backward in BACKWARD_SHARES:
        steering_rad = backward * most_rad
        path = arc(_settled(outlook, steering_rad, -1.0), steering_rad, settings.back_m)
        room_m = strip.contact(steering_rad, settings.back_m + STEP_M, -1.0).travel_m - STEP_M
        for pose in range(2, path.travel_m.size, 2):
            back_m = float(path.travel_m[pose])
            if back_m > room_m:
                break
            seen_m = _from_pose(path, pose, points_m)
            for forward in FORWARD_SHARES:
                ahead_rad = forward * most_rad
                motion = _settled(outlook, ahead_rad, 1.0)
                found = contact_on_arc(motion, ahead_rad, LOOKS_AHEAD_M, strip.body.ahead, seen_m)
                way_m = min(found.travel_m, LOOKS_AHEAD_M)
                legs = [Leg(steering_rad, -back_m), Leg(ahead_rad, min(settings.forward_m, way_m))]
                yield legs, way_m


def _settled(outlook: Outlook, wheel_rad: float, direction: float) -> Motion:
    car = outlook.strip.body.car
    return Motion(0.0, direction, wheel_rad, 0.0, car.steering_rate_radps, car.wheelbase_m)


def _from_pose(path: Path, pose: int, points_m: Places) -> Places:
    """Return the points in the car's frame at a pose of the path."""
    seen: Places = (points_m - path.place_m[pose]) * path.heading[pose].conjugate()
    return seen
