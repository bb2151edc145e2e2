"""State of an emergency from scan to scan: the active manoeuvre."""

import math
from collections import deque
from dataclasses import replace
from typing import Self

import numpy as np

from wallride.drivers.value import value
from wallride.runtime.control.perception.geometry import Floats, any_nearer
from wallride.runtime.control.safety.body import LOOK_SPARE_M
from wallride.runtime.control.safety.emergency_manoeuvre import (
    FULL_BRAKE,
    NARROW_M,
    EmergencyState,
    Manoeuvre,
    Outcome,
    best_of,
    candidates,
    is_clearly_better,
)
from wallride.runtime.control.safety.manoeuvre_rollout import MARGIN_M, STEP_S, RolloutStart
from wallride.runtime.control.safety.stopping import brake_beside_turning_mps2, stopping_distance_m
from wallride.runtime.control.safety.swept_path import Strip
from wallride.runtime.control.vehicle import GRAVITY_MPS2

PAST_S = 0.3
"""Length of the history of wheel angles: earlier angles have no effect on the tyres now."""
FORGOTTEN_AFTER_S = 0.1
"""Maximum time without a request after which a manoeuvre is over: the driver stood, or backed."""
MAX_SPEED_MPS = 30.0
"""Maximum plausible speed; faster reports are clamped, so that the rollouts stay finite."""
SUDDEN_SCANS = 5
SUDDEN_RAD = 0.1
"""Change of the steering within SUDDEN_SCANS scans that marks the beginning of a swerve."""
BOUND_SHARE = 0.6
"""A bend that takes more than this of a slippery floor's grip binds the car: it can hardly be given up for another."""
WIDE_M = 0.12
"""No bend runs so much wider than its swept way within a stopping distance."""
LATER_S = 0.03
"""Delay of a decision by one scan, with a small reserve; with a slow lidar its wait comes on top."""
TURNS_ON_M = 0.2
"""Maximum lateral offset of a braking car's corners from its path, because it still rotates."""
MAX_BRAKE_MPS2 = 2.0 * GRAVITY_MPS2


@value()
class Emergency:
    """What is kept of an emergency from scan to scan: a value, of which each step returns the next.

    chosen: the active manoeuvre with its outcome; None while there is no emergency. follows_driver: whether its
    steering is the driver's own. asked: stamp and steering that it was chosen for. doubted: the same of the last turn
    that was rolled out, and whether it was in vain.
    """

    chosen: Outcome | None = None
    follows_driver: bool = False
    asked: tuple[float, float] = (math.nan, math.nan)
    doubted: tuple[tuple[float, float], bool] = ((math.nan, math.nan), False)

    def ended(self) -> "Emergency":
        """Return the state after the emergency, with the car returned to its driver."""
        return self if self.chosen is None else replace(self, chosen=None)

    @property
    def turns(self) -> bool:
        """Whether the active manoeuvre is other than a full brake."""
        return self.chosen is not None and self.chosen.manoeuvre != FULL_BRAKE

    @property
    def reason(self) -> str:
        """Description of the manoeuvre, one of a fixed set of texts."""
        if not self.turns:
            return "braking: wall ahead"
        return "braking in the bend: wall ahead" if self.follows_driver else "swerving: wall ahead"

    @property
    def steering_rad(self) -> float | None:
        """Steering angle imposed by the manoeuvre; None where the driver keeps the steering."""
        return None if self.chosen is None or self.follows_driver else self.chosen.manoeuvre.steering_rad

    def decided(self, strip: Strip, wish_rad: float, stamp_s: float) -> "Emergency":
        """Return the state with the manoeuvre for this scan; the same for the same scan and steering.

        wish_rad: the driver's own steering; a manoeuvre that uses it follows its changes.
        """
        if self.chosen is not None and self.asked == (stamp_s, wish_rad):
            return self
        active = None if stamp_s - self.asked[0] > FORGOTTEN_AFTER_S + strip.view.waits_s else self.chosen
        kept = FULL_BRAKE if active is None else active.manoeuvre
        if self.follows_driver and kept != FULL_BRAKE:
            kept = Manoeuvre(wish_rad, kept.brake_mps2)
        situation = _situation(strip, stamp_s, active)
        body = strip.body
        tried = candidates(wish_rad, body.car.steering_ends_rad, situation.grips_mps2, body.settings.gentle_share)
        if kept not in tried:
            tried.insert(1, kept)
        chosen = best_of(situation, tried, kept, wish_rad, active)
        return Emergency(chosen, chosen.manoeuvre.steering_rad == wish_rad, (stamp_s, wish_rad), self.doubted)

    def turns_in_vain(self, strip: Strip, wish_rad: float, stamp_s: float) -> tuple[bool, "Emergency"]:
        """Return whether the driver's turn may collide clearly harder than a full brake now, which is too late soon.

        The state returned keeps the answer for the next judgement of this scan.

        Two turns are judged. The swept path of a turn that has just begun is too short: tyres and body follow the
        wheels with a delay. The swept path of a bend that binds the car is too tight on a slippery floor: tyres lose
        steering before they lose all grip. A driver that steers from one side to the other is excluded: it may turn
        back (`reversal`).
        """
        if self.chosen is not None or strip.speed_mps < strip.body.settings.doubtful_mps:
            return False, self
        before_rad = strip.past_rad[max(0, len(strip.past_rad) - SUDDEN_SCANS)][1]
        sudden = abs(wish_rad - before_rad) >= SUDDEN_RAD
        bound = strip.needs_grip(wish_rad, strip.speed_mps, BOUND_SHARE * strip.body.slippery_mps2)
        if not (sudden or bound) or min(wish_rad * before_rad, 0.0) <= -(SUDDEN_RAD**2) or _stops_later(strip):
            return False, self
        if not sudden and _passes_wide(strip, wish_rad):
            return False, self
        if self.doubted[0] == (stamp_s, wish_rad):
            return self.doubted[1], self
        in_vain = _is_last_moment(_situation(strip, stamp_s), wish_rad, NARROW_M if bound else 0.0)
        return in_vain, replace(self, doubted=((stamp_s, wish_rad), in_vain))

    def may_release(self, strip: Strip, wish_rad: float, stamp_s: float) -> bool:
        """Return whether the driver's bend without a brake has NARROW_M of room on every floor, or the car is slow.

        Without this a brake in a bend ends as soon as the bend leaves grip for the motor, and the car is let go on a
        way that it no longer clears on a slippery floor.
        """
        if strip.speed_mps < strip.body.settings.doubtful_mps:
            return True
        (turn,) = _situation(strip, stamp_s, self.chosen).predict([Manoeuvre(wish_rad, 0.0)])
        return turn.is_free and turn.room_m >= NARROW_M

    def slowed_in_bend(self, strip: Strip, wish_rad: float, stamp_s: float) -> Self | None:
        """Return the state with a brake in the driver's bend by the grip left of a slippery floor; None if it hits.

        For a driver too fast for the obstacle ahead, in a bend that needs so much grip that the motor must not
        decelerate in it.
        """
        situation = _situation(strip, stamp_s, self.chosen)
        slippery_mps2 = min(situation.grips_mps2)
        bend_per_m = math.tan(wish_rad) / strip.body.car.wheelbase_m
        gentle_mps2 = strip.body.settings.gentle_share * slippery_mps2
        left_mps2 = brake_beside_turning_mps2(strip.speed_mps, bend_per_m, slippery_mps2)
        tried = [Manoeuvre(wish_rad, brake_mps2) for brake_mps2 in (max(left_mps2, gentle_mps2), gentle_mps2)]
        free = next((outcome for outcome in situation.predict(tried) if outcome.is_free), None)
        return None if free is None else replace(self, chosen=free, follows_driver=True, asked=(stamp_s, wish_rad))


def _situation(strip: Strip, stamp_s: float, active: Outcome | None = None) -> EmergencyState:
    body, car = strip.body, strip.body.car
    brake_mps2 = 0.0 if active is None else min(active.manoeuvre.brake_mps2, MAX_BRAKE_MPS2)
    start = RolloutStart(
        min(max(0.0, strip.speed_mps), MAX_SPEED_MPS),
        brake_mps2,
        strip.latency_s,
        car.steering_rate_radps,
        car.wheelbase_m,
        body.settings.cornering_per_rad,
        car.front_m,
        car.rear_m,
        car.half_width_m,
        strip.view.waits_s,
    )
    grips_mps2 = body.grip_mps2, body.slippery_mps2
    way_m = stopping_distance_m(start.speed_mps, start.latency_s, body.slippery_mps2)
    points_m = strip.points_around_m(way_m + car.front_m + LOOK_SPARE_M)
    points_m = points_m[~body.bare.holds(points_m)]  # points inside the outline are the car itself, or dirt
    return EmergencyState(start, points_m, grips_mps2, *_wheels_rad(strip, stamp_s))


def _wheels_rad(strip: Strip, stamp_s: float) -> tuple[Floats, Floats]:
    """Return the wheel angles at each past step and during the latency; commands act after the actuation delay."""
    steps = round(PAST_S / STEP_S)
    first_s = stamp_s - strip.body.settings.actuation_s - STEP_S * (steps - 1)
    recent: deque[tuple[float, float]] = deque()
    for noted in reversed(strip.past_rad):
        recent.appendleft(noted)
        if noted[0] <= first_s:
            break
    stamps_s, angles_rad = np.array(recent).reshape(-1, 2).T
    told_s = first_s + STEP_S * np.arange(steps + math.ceil(strip.latency_s / STEP_S))
    wheels_rad = np.interp(told_s, stamps_s, angles_rad)
    return wheels_rad[:steps], wheels_rad[steps:]


def _stops_later(strip: Strip) -> bool:
    """Return whether a full brake one scan later stops before everything that is seen, for any steering of the driver.

    Gives the same answer as the rollouts in a hundredth of their time: in most bends of a drive.
    """
    body, view = strip.body, strip.view
    way_m = stopping_distance_m(strip.speed_mps, strip.latency_s + LATER_S + view.waits_s, body.slippery_mps2)
    return not (
        strip.more_m.size or any_nearer(view.solid, view.ranges_m, body.reach_m + way_m + MARGIN_M + TURNS_ON_M)
    )


def _passes_wide(strip: Strip, wish_rad: float) -> bool:
    """Whether nothing is within WIDE_M of the swept way as far as a stop takes: for a tenth of the rollouts' time."""
    body, later_s = strip.body, strip.latency_s + LATER_S + strip.view.waits_s
    way_m = stopping_distance_m(strip.speed_mps, later_s, body.slippery_mps2) + TURNS_ON_M
    return strip.passes(wish_rad, way_m, replace(body.ahead, half_width_m=body.ahead.half_width_m + WIDE_M))


def _is_last_moment(situation: EmergencyState, wish_rad: float, narrow_m: float = 0.0) -> bool:
    """Whether a turn may hit something, a full brake is clearly better, and would come too late a scan later.

    Less room than narrow_m, or than half of what the brake leaves now, is too little for the turn where a full brake
    hits nothing, and for the brake a scan later.
    """
    (turn,) = situation.predict([Manoeuvre(wish_rad, 0.0)])
    if turn.is_free and turn.room_m >= narrow_m:
        return False
    (brake,) = situation.predict([FULL_BRAKE])
    enough_m = min(narrow_m, brake.room_m / 2)
    if turn.is_free and turn.room_m >= enough_m:
        return False
    if not (brake.is_free or is_clearly_better(brake, turn)):
        return False
    start = situation.start
    later = start._replace(latency_s=start.latency_s + LATER_S + start.waits_s)
    (late_brake,) = replace(situation, start=later).predict([FULL_BRAKE])
    return not late_brake.is_free or late_brake.room_m < enough_m
