"""Judgement of a promised path: the outline swept along it, full braking from each of its points, and what hides it.

A promise that is not believed is judged by the arc of the present steering, as every other command.
"""

import cmath
import math
from typing import NamedTuple

import numpy as np

from wallride.drivers.accelerated import accelerated
from wallride.drivers.value import value
from wallride.runtime.arbitration.command import NO_LIMIT_MPS, Verdict
from wallride.runtime.arbitration.promise import Promise
from wallride.runtime.control.perception.geometry import ENOUGH_POINTS, Floats, Places
from wallride.runtime.control.perception.motion.own_motion import DrivenPlace
from wallride.runtime.control.perception.perception import Percept
from wallride.runtime.control.perception.view import View
from wallride.runtime.control.safety.body import Body
from wallride.runtime.control.safety.footprint import (
    MIN_SLEW_SPEED_MPS,
    NOTHING,
    STEP_M,
    Contact,
    PathMotion,
    arc,
    slide_room_m,
)
from wallride.runtime.control.safety.promise_record import LEAST_MARGIN_M, Given, PromiseRecord
from wallride.runtime.control.safety.promised_way import (
    CORRECTS_RAD,
    TOO_SHORT,
    WHEEL_SPARE_RAD,
    PromisedWay,
    Roadworthy,
    Unbelievable,
    points_of,
    way_of,
)
from wallride.runtime.control.safety.stopping import stopping_distance_m
from wallride.runtime.control.safety.swept_path import Strip
from wallride.runtime.control.tyres import eased_mps

SLID_S = 0.25
"""Time after locked wheels for which the odometry tells nothing of a promise."""
NEXT_S = 0.25
AHEAD_LEAST_M = 0.3
"""Way on which a command has to keep to the promise: until some scans later, and at least this."""
COMMAND_SPARE_M, COMMAND_SPARE_SHARE = 0.02, 0.08
"""How far the arc of a command may be beside the margin, here and with the way: it changes with the next scans."""
CORRECTS_MPS = 2.0
"""Speed below which a source corrects itself by more than CORRECTS_RAD, the more, the slower it is."""
FASTER_MPS = 0.5
"""How much faster than the fastest of the promised speeds a command may be."""
GRIPS_MORE = 1.1
"""Least grip of a floor over what a bend takes of it, where that is more than a slippery floor has."""
EACH = 3
"""Interval of poses from which braking is judged: 0.18 m."""
MOST_ASIDE = 0.9
"""Share of the grip above which a bend is not counted on to leave less: the early brake would come at once."""
STOP_SHARE = 0.5
"""Share of a margin for which a car brakes at full. For all of it it slows down: it may well pass, and a car that
brakes at full in a bend slides."""
LATER_S = 0.03
STOP_SPARE_M = 0.05
SLIDE_MARGIN_M = 0.02
IMPACT_MPS = 2.5
"""Least impact of a full brake for which a promise is not believed; below it the speed is limited."""
SIGHT_RAD = math.radians(1.5)
SIGHT_SPARE_M = 0.15
HIDDEN_SPARE_M = 0.1

SLID = "the wheels were locked"
OTHER_SCAN = "it is of another scan"
OTHER_COMMAND = "the command leads elsewhere"
TOO_FAST = "the command is faster"
NO_BRAKING = "no room to brake from its path"


CLEAR = Verdict(NO_LIMIT_MPS, NO_LIMIT_MPS, "clear")
HIDDEN = "slower: the way is hidden"


@value(eq=False)
class JudgedWay:
    """A believed promise. found: first contact along it. toward_rad: bearing of its middle.

    stops: the contact to brake at full for, with less of the margin where the first one is too near to stop before it.
    cap_m, cap_mps: (k,) ways ahead and the most speed there, from which full braking ends before a contact, or 0 where
    the rest is hidden. left: (k,) share of the grip that the bends before leave to brake with. margin_m: to each side.
    eased_mps: lowest set speed that brakes by no more than the present bend leaves of the grip.
    """

    way: PromisedWay
    margin_m: float
    found: Contact
    stops: Contact
    toward_rad: float
    cap_m: Floats
    cap_mps: Floats
    left: Floats
    eased_mps: float = -math.inf

    def limit(self, body: Body, reaction_s: float) -> Verdict:
        """Return the limit from which the early brake keeps to every cap, and a hard stop to what is seen."""
        if not self.cap_m.size:
            return CLEAR
        settings = body.settings
        brakes_mps2 = np.where(self.cap_mps > 0.0, settings.graded_share * self.left, settings.hard_share)
        brakes_mps2 = brakes_mps2 * body.grip_mps2
        reach_mps = brakes_mps2 * reaction_s
        speeds_mps = np.sqrt(reach_mps**2 + 2.0 * brakes_mps2 * self.cap_m + self.cap_mps**2) - reach_mps
        tightest = int(speeds_mps.argmin())
        most_mps = max(settings.creep_mps, float(speeds_mps[tightest]))
        reason = HIDDEN if self.cap_mps[tightest] == 0.0 else "slower: a full brake needs the room"
        return Verdict(most_mps, NO_LIMIT_MPS, reason, float(self.cap_m[tightest]))


def least_limit_mps(way: JudgedWay | None) -> float:
    """Return the least limit for what is beside a way, in the outer half of its margin alone; -inf for anything else.

    A motor controller obeys a lower speed at once, and a car that brakes in a bend by more than it leaves of the grip
    spins.
    """
    return way.eased_mps if way is not None and way.stops is NOTHING else -math.inf


class _JudgedOnce(NamedTuple):
    """All that the judgement of a promise by one scan depends on, and what came of it."""

    promise: Promise
    given: Given
    here: DrivenPlace
    command: tuple[float, float]
    look_m: float
    way: JudgedWay | Unbelievable


def believed(
    seen: Percept, strip: Strip, command: tuple[float, float], promise: Promise, record: PromiseRecord, look_m: float
) -> tuple[JudgedWay | None, PromiseRecord]:
    """Return the way that is judged in place of the arc, None where the promise is not believed, and the next record.

    command: speed [m/s] and steering [rad] that were asked for with the promise. Asked again about the same one, it
    answers from what the strip keeps.
    """
    stamp_s = seen.scan.stamp_s
    if seen.motor is None:
        return None, record
    here, fresh = seen.motion.here, stamp_s > record.stamp_s
    record = record.corrected(seen.motion.before)
    points = points_of(promise)
    if isinstance(points, Unbelievable) or stamp_s - seen.slid_s < SLID_S:
        reason = points.reason if isinstance(points, Unbelievable) else SLID
        return None, record.restarted(here, reason) if fresh else record
    places_m, speeds_mps = points
    if promise.stamp_s == stamp_s:
        if fresh:
            record = record.after(here, here.in_frame_m(places_m), promise.margin_m)
    elif record.given and record.given[-1].here.stamp_s == promise.stamp_s:
        places_m = here.in_base_m(record.given[-1].path_m)
    else:
        return None, record.restarted(here, OTHER_SCAN) if fresh else record
    if not record.given or not record.trusts(here):
        return None, record
    given = record.given[-1]
    kept, asked = strip.judged, (here, command, look_m)
    if (
        not isinstance(kept, _JudgedOnce)
        or kept.promise is not promise
        or kept.given is not given
        or kept[2:5] != asked
    ):
        way = _judged(strip, (places_m, speeds_mps), command, given.margin_m, look_m, here.turn_radps)
        kept = strip.judged = _JudgedOnce(promise, given, here, command, look_m, way)
    judged = kept.way
    if isinstance(judged, Unbelievable):
        return None, record.refusing(judged.reason) if fresh else record
    return judged, record


def _judged(
    strip: Strip, points: tuple[Places, Floats], command: tuple[float, float], margin_m: float, look_m: float,
    turn_radps: float,
) -> JudgedWay | Unbelievable:  # fmt: skip
    body = strip.body
    car = _roadworthy(strip)
    way = way_of(*points, car, look_m)
    if isinstance(way, Unbelievable):
        return way
    stop_m = stopping_distance_m(car.speed_mps, car.latency_s, body.settings.hard_share * car.grip_mps2)
    if way.promised_m < stop_m:
        return Unbelievable(TOO_SHORT)
    if command[0] > float(points[1].max()) + FASTER_MPS:
        return Unbelievable(TOO_FAST)
    if _leads_elsewhere(way, car, command[1], margin_m):
        return Unbelievable(OTHER_COMMAND)
    margin_m = max(body.settings.side_margin_m, margin_m)
    found = strip.contact_along(way.path, look_m, margin_m)
    stops = found
    if found.travel_m < stop_m + STOP_SPARE_M:
        stops_m = max(body.settings.side_margin_m, LEAST_MARGIN_M, STOP_SHARE * margin_m)
        stops = strip.contact_along(way.path, look_m, stops_m)
    braked_m, room_m = _braking_room_m(strip, way, look_m)
    soon = braked_m <= car.speed_mps * (car.latency_s + LATER_S)
    if (car.speed_mps**2 - 2.0 * car.grip_mps2 * room_m[soon] > IMPACT_MPS**2).any():
        return Unbelievable(NO_BRAKING)
    most_mps = np.sqrt(2.0 * car.grip_mps2 * room_m)
    some = slice(0, EACH * most_mps.size, EACH)
    bend_per_m = np.maximum(np.abs(way.path.curvature_per_m[some]), 1e-6)
    most_mps = np.minimum(most_mps, np.sqrt(car.grip_mps2 / bend_per_m))
    binds = way.speed_mps[some] > most_mps
    hidden_m = _hidden_m(strip.view, way, body.bare.front_m)
    cap_m, cap_mps = braked_m[binds], most_mps[binds]
    left = cap_m
    if cap_m.size:
        aside = np.minimum(way.speed_mps[some] ** 2 * bend_per_m / car.grip_mps2, MOST_ASIDE)
        left = np.sqrt(1.0 - np.maximum.accumulate(aside) ** 2)[binds]
    if hidden_m < look_m:
        cap_m, cap_mps = np.append(cap_m, max(0.0, hidden_m - HIDDEN_SPARE_M)), np.append(cap_mps, 0.0)
        left = np.append(left, 1.0)
    middle_m, least_mps = _middle_m(way, look_m), _eased_mps(car.speed_mps, turn_radps, body)
    return JudgedWay(way, margin_m, found, stops, cmath.phase(middle_m), cap_m, cap_mps, left, least_mps)


def _middle_m(way: PromisedWay, look_m: float) -> complex:
    return complex(way.path.place_m[min(way.path.place_m.size - 1, int(look_m / 2 / STEP_M))])


def _eased_mps(speed_mps: float, turn_radps: float, body: Body) -> float:
    """Return the lowest set speed for a bend, on a floor that is slippery, or just holds the car in it."""
    lateral_mps2 = speed_mps * turn_radps
    return eased_mps(speed_mps, lateral_mps2, max(body.slippery_mps2, GRIPS_MORE * abs(lateral_mps2)))


def _roadworthy(strip: Strip) -> Roadworthy:
    body = strip.body
    grip_mps2 = body.grip_mps2
    return Roadworthy(
        max(0.0, strip.speed_mps), strip.wheel_rad, strip.latency_s, body.car.steering_rate_radps, body.car.wheelbase_m,
        body.car.max_steering_rad, grip_mps2, 1.0 / (grip_mps2 * body.settings.cornering_per_rad),
        body.car.max_acceleration_mps2,
    )  # fmt: skip


def _leads_elsewhere(way: PromisedWay, car: Roadworthy, steering_rad: float, margin_m: float) -> bool:
    """Whether a steering is none of those that the promise that comes with it leads through soon, or leaves its margin.

    A source corrects its errors by other angles than the path's own, and in a bend steers further into it, by as much
    as the front tyres slip more than the rear ones.
    """
    motion = PathMotion(
        car.speed_mps, 1.0, car.wheel_rad, car.latency_s, car.rate_radps, car.wheelbase_m,
        car.grip_mps2, car.slip_rad_per_mps2,
    )  # fmt: skip
    driven = arc(motion, steering_rad, max(AHEAD_LEAST_M, car.speed_mps * (car.latency_s + NEXT_S)))
    count = min(driven.place_m.size, way.path.place_m.size)
    apart_m = (driven.place_m[:count] - way.path.place_m[:count]) * way.course[:count].conj()
    allowed_m = margin_m + COMMAND_SPARE_M + COMMAND_SPARE_SHARE * driven.travel_m[:count]
    bend_per_m = way.path.curvature_per_m[:count]
    grip_used = np.minimum(np.maximum(bend_per_m * (car.speed_mps * car.speed_mps / car.grip_mps2), -1.0), 1.0)
    inward_m = WHEEL_SPARE_RAD / car.wheelbase_m * STEP_M * STEP_M * grip_used.cumsum().cumsum()
    least_m, most_m = np.minimum(inward_m, 0.0) - allowed_m, np.maximum(inward_m, 0.0) + allowed_m
    wheels_rad = np.arctan(car.wheelbase_m * bend_per_m)
    spare_rad = CORRECTS_RAD * max(1.0, CORRECTS_MPS / max(car.speed_mps, MIN_SLEW_SPEED_MPS))
    beside = steering_rad > wheels_rad.max() + spare_rad or steering_rad < wheels_rad.min() - spare_rad
    return bool(beside or (apart_m.imag > most_m).any() or (apart_m.imag < least_m).any())


def _braking_room_m(strip: Strip, way: PromisedWay, look_m: float) -> tuple[Floats, Floats]:
    """Return ways along the promised part (k,), and how far the nose may slide straight on from each (k,)."""
    count = int(way.path.travel_m.searchsorted(min(look_m, way.promised_m), side="right"))
    some = slice(0, max(1, count), EACH)
    points_m = strip.points_ahead_m()
    travel_m = way.path.travel_m[some]
    if points_m.size < ENOUGH_POINTS:
        return travel_m, np.full(travel_m.size, math.inf)
    half_width_m = strip.body.bare.half_width_m + SLIDE_MARGIN_M
    room_m = slide_room_m(way.path.place_m[some], way.course[some], points_m, strip.body.bare.front_m, half_width_m)
    return travel_m, np.maximum(room_m - STOP_SPARE_M, 0.0)


def _hidden_m(view: View, way: PromisedWay, front_m: float) -> float:
    """Return the way to where the nose would be behind something that is seen; infinity without such a place."""
    scan = view.scan
    nose_m = way.path.place_m + front_m * way.path.heading - view.lidar_m
    first = first_hidden(nose_m, view.ranges_m, scan.angle_min_rad, scan.angle_step_rad)
    return float(way.path.travel_m[first]) if first >= 0 else math.inf


@accelerated
def first_hidden(nose_m: Places, ranges_m: Floats, first_rad: float, step_rad: float) -> int:
    """Return the first of some places (n,) in the lidar frame that is hidden by a scan or beside it; -1 for none.

    ranges_m: (beams,), of beams from first_rad on, in steps.
    """
    bearings_rad = np.arctan2(nose_m.imag, nose_m.real)
    beams = np.rint((bearings_rad - first_rad) / step_rad).astype(np.int64)
    width = max(1, round(SIGHT_RAD / abs(step_rad)))
    window = beams[:, None] + np.arange(-width, width + 1)
    outside = (window < 0) | (window >= ranges_m.size)
    seen_m = ranges_m.take(window, mode="clip")
    nearer = (seen_m < (np.abs(nose_m) - SIGHT_SPARE_M)[:, None]) | outside  # NaN is no echo: the law of visibility
    hidden = nearer.sum(axis=1) > width
    first = int(hidden.argmax())
    return first if hidden[first] else -1
